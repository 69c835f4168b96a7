//! World files: what stands in them, what a seed draws, and the goal.
#![no_main]

use libfuzzer_sys::fuzz_target;
use sim::{Goal, Simulator, Vary, WorldPlan};
use types::value::{Entry, Mistake, Span, Table, Value};

fuzz_target!(|text: &str| {
    let world = match program::file::tree(text) {
        Ok(Value::Table(world)) => world,
        Ok(_) => unreachable!("a file is a table"),
        Err(mistakes) => {
            assert!(mistakes.list.iter().all(|mistake| mistakes.sources.place(mistake.at).is_some()));
            return;
        }
    };
    let mut mistakes = Vec::new();
    let plan = WorldPlan::read(&world, &mut mistakes);
    assert_eq!(plan.is_none(), !mistakes.is_empty());
    let mut said: Vec<Mistake> = mistakes;
    if let Some(Value::Table(vary)) = value(&world, "vary") {
        let _ = Vary::read(vary, &mut said);
    }
    if let Some(plan) = &plan {
        if let Some(Value::Table(goal)) = value(&world, "goal") {
            let _ = Goal::read(goal, Span::default(), plan, &mut said);
        }
        raise(plan);
    }
    for mistake in said {
        assert!(mistake.at.end as usize <= text.len() && !mistake.what.is_empty(), "{mistake}");
    }
});

fn value<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    table.get(key).map(|Entry { value, .. }| value)
}

/// What was read can be simulated for a moment.
fn raise(plan: &WorldPlan) {
    let mut simulator = Simulator::new(plan, 1);
    simulator.step();
}
