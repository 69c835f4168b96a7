//! A plan that is written and read again is the same plan.

use program::file::{self, Shelf, read_plan, write_plan};
use proptest::prelude::*;
use runtime::{
    AgentPlan, ExecutorPlan, Giving, OnDeath, Overload, Plan, QueuePlan, TimedRequest, WireFilter, WirePlan,
};
use types::value::{Span, Table, Value};
use types::{Category, Duration, Priority};

use crate::registry;

/// The plan without the places of its text, and with the wires of each output together.
fn bare(mut plan: Plan) -> Plan {
    plan.agents.iter_mut().for_each(|agent| agent.at = Span::default());
    plan.executors.iter_mut().for_each(|executor| executor.at = Span::default());
    plan.requests.iter_mut().for_each(|request| request.place = Span::default());
    plan.wires.iter_mut().for_each(|wire| wire.at = Span::default());
    plan.queues.iter_mut().for_each(|queue| queue.at = Span::default());
    let outputs: Vec<String> = plan.wires.iter().map(|wire| wire.from.clone()).collect();
    plan.wires.sort_by_key(|wire| outputs.iter().position(|output| *output == wire.from));
    plan
}

fn again(plan: &Plan) -> Plan {
    let text = write_plan(plan);
    bare(
        read_plan(&text, "written.toml", &registry()).unwrap_or_else(|mistakes| panic!("{mistakes}\n{text}")),
    )
}

#[test]
fn every_scenario_is_right_and_survives() {
    for name in Shelf::Scenarios.names() {
        let loaded = file::check(name, &[], &registry()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
        let plan = bare(loaded.plan);
        assert!(plan.agents.len() > 2 && plan.wires.len() > 2, "{name} is more than a heading");
        assert_eq!(again(&plan), plan, "{name}");
    }
}

#[test]
fn what_the_file_says_is_in_the_plan() {
    let text = r#"
        world = "laboratory"
        robot.h1 = { driver = "sim", age_limit = "200ms" }
        agent.safety = { is = "safety-monitor", on = "ranges", deadline = "5ms", executor = "reflex", stop_distance = 0.3 }
        agent.decision = { is = "decision-maker", period = "100ms", on = ["safety"], on_death = "leave" }
        executor.reflex = { priority = 75, cpus = [1], spin = "20us" }
        wires."safety.safety" = [{ to = "decision.safety", depth = 2, overload = "refuse", every = 3, priority = "high", recipient = "decision" }]
        decide.danger.near = { safety = 1.0 }
        at = [{ time = "40s", do = ["fault", "h1.sonar", "off"] }]
    "#;
    let plan =
        read_plan(text, "some/lesson.toml", &registry()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(plan.name, "lesson");
    let safety = plan.agent("safety").unwrap();
    assert_eq!((safety.kind.as_str(), safety.deadline), ("safety-monitor", Some(Duration::millis(5))));
    assert_eq!(
        (safety.on.as_slice(), safety.executor.as_deref()),
        (&["ranges".to_owned()][..], Some("reflex"))
    );
    assert_eq!(safety.params.get("stop_distance").unwrap().value, Value::Float(0.3));
    let robot = plan.agent("h1").unwrap();
    assert_eq!((robot.kind.as_str(), robot.executor.as_deref()), ("robot", Some("gate")));
    assert_eq!(robot.params.get("age_limit").unwrap().value, Value::from("200ms"));
    let decision = plan.agent("decision").unwrap();
    assert_eq!((decision.on_death, decision.period), (OnDeath::Leave, Some(Duration::millis(100))));
    let table = decision.params.get("table").unwrap().value.as_table().unwrap();
    assert_eq!(table.at_path("\"danger.near\".safety").unwrap().value, Value::Float(1.0));
    let executor = &plan.executors[0];
    assert_eq!((executor.priority, executor.cpus.as_slice()), (Some(75), &[1][..]));
    assert_eq!(executor.spin, Duration(20_000));
    let wire = &plan.wires[0];
    assert_eq!((wire.from.as_str(), wire.to.as_str()), ("safety.safety", "decision.safety"));
    assert_eq!((wire.depth, wire.overload, wire.filter.every), (Some(2), Some(Overload::Refuse), 3));
    assert_eq!(wire.filter.least_priority.0, Priority::High);
    assert_eq!(wire.filter.recipient.as_deref(), Some("decision"));
    let request = &plan.requests[0];
    assert_eq!((request.at, request.words.join(" ").as_str()), (Duration::secs(40), "fault h1.sonar off"));
    assert_eq!(plan.sections.get("world").unwrap().value, Value::from("laboratory"));
}

#[test]
fn a_table_of_decisions_with_conditions_survives_whichever_way_its_keys_are_written() {
    let text = r#"
        name = "deciding"
        agent.safety = { is = "safety-monitor", on = "ranges" }
        agent.track = { is = "image-tracker", on = "rgb" }
        agent.decision = { is = "decision-maker", on = "safety", signals = ["faces"] }
        wires."safety.safety" = "decision.safety"
        [decide]
        battery.low = { when = "battery < 0.2", until = "battery > 0.3", priority = 60, goal = "charge", safety = 0.0 }
        "crowd" = { when = 'faces > 3 && !(nearest < 1.5)', safety = { active = false } }
        target.seen = { goal = "follow", safety = { weight = 1.0, importance = 1, rate = 0.5, active = true }, track = { method = "exact" } }
        "free" = { safety = { rate = 0.25 } }
    "#;
    let plan = read_plan(text, "deciding.toml", &registry()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let table = plan.agent("decision").unwrap().params.get("table").unwrap().value.as_table().unwrap();
    let keys: Vec<&str> = table.rows().iter().map(|row| row.key.as_str()).collect();
    assert_eq!(keys, ["battery.low", "crowd", "target.seen", "free"]);
    assert_eq!(table.at_path("crowd.when").unwrap().value, Value::from("faces > 3 && !(nearest < 1.5)"));
    assert_eq!(table.at_path("\"target.seen\".safety.rate").unwrap().value, Value::Float(0.5));
    assert_eq!(again(&plan), bare(plan));
}

#[test]
fn a_queue_is_read_with_the_wires_to_it_and_from_it() {
    let text = r#"
        name = "shared"
        [agent.eyes]
        is = "sonar"
        on = "echoes"
        [agent.left]
        is = "safety-monitor"
        on = "ranges"
        [agent.right]
        is = "safety-monitor"
        on = "ranges"
        [queue.seen]
        depth = 8
        overload = "oldest-wins"
        [wires]
        "eyes.filtered" = ["seen"]
        seen = ["left.ranges", { to = "right.ranges", serving = 80 }]
    "#;
    let plan = read_plan(text, "shared.toml", &registry()).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let queue = &plan.queues[0];
    assert_eq!((queue.name.as_str(), queue.depth(), queue.overload()), ("seen", 8, Overload::OldestWins));
    let wires: Vec<_> = plan.wires.iter().map(|wire| (&*wire.from, &*wire.to, wire.serving)).collect();
    let expected =
        [("eyes.filtered", "seen", None), ("seen", "left.ranges", None), ("seen", "right.ranges", Some(80))];
    assert_eq!(wires, expected);
    assert_eq!(again(&plan), bare(plan));

    for (right, wrong, said) in [
        ("[\"seen\"]", "[\"sen\"]", "\"sen\" is no port\n"),
        ("[\"seen\"]", "[\"sen\"]", "did you mean the queue \"seen\"?"),
        ("serving = 80", "serving = 100", "\"serving\" is 100, it must lie from 0 to 99"),
        ("right.ranges", "left.ranges", "there are two wires from seen to left.ranges"),
        ("[\"seen\"]", "[{ to = \"seen\", depth = 3 }]", "depth and overload are those of queue \"seen\""),
        ("\"left.ranges\"", "{ to = \"left.ranges\", every = 2 }", "has a filter"),
        ("eyes.filtered", "left.safety", "queue \"seen\" holds Safety, left.ranges has Ranges"),
    ] {
        let text = text.replacen(right, wrong, 1);
        let mistakes = read_plan(&text, "shared.toml", &registry()).unwrap_err().to_string();
        assert!(mistakes.contains(said), "{mistakes}");
    }
}

#[test]
fn the_store_of_a_system_survives_and_lies_beside_its_file() {
    let text = r#"
        name = "home"
        [agent.decision]
        is = "decision-maker"
        period = "100ms"
        [decide]
        free = { decision = 1.0 }
        [knowledge]
        file = "../home.db"
        begins = "2026-03-02 07:59"
        decide = "home"
    "#;
    let folder = std::path::Path::new("some");
    let loaded = file::read(text, "home.toml", Some(folder), &[], &registry());
    let loaded = loaded.unwrap_or_else(|mistakes| panic!("{mistakes}"));
    assert_eq!(loaded.store, Some("some/../home.db".into()));
    assert_eq!(again(&loaded.plan), bare(loaded.plan));
}

#[test]
fn a_change_changes_one_entry_and_nothing_else() {
    let sets = ["agent.drive.period=40ms".to_owned()];
    let mut wanted = bare(file::load("exploration", &[], &registry()).unwrap().plan);
    wanted.agent_mut("drive").unwrap().period = Some(Duration::millis(40));
    assert_eq!(bare(file::load("exploration", &sets, &registry()).unwrap().plan), wanted);
}

#[test]
fn a_group_brings_its_agents_under_its_name() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/groups");
    let path = folder.join("robot.toml");
    let loaded = file::load(path.to_str().unwrap(), &[], &registry()).unwrap_or_else(|m| panic!("{m}"));
    let names: Vec<&str> = loaded.plan.agents.iter().map(|agent| agent.name.as_str()).collect();
    assert_eq!(names, ["h1", "body.eyes.sonar", "body.safety", "wall"]);
    let eyes = loaded.plan.agent("body.eyes.sonar").unwrap();
    assert_eq!((eyes.robot.as_deref(), eyes.deadline), (Some("h1"), Some(Duration::millis(9))));
    let wires: Vec<String> =
        loaded.plan.wires.iter().map(|wire| format!("{} > {}", wire.from, wire.to)).collect();
    assert_eq!(
        wires,
        ["body.eyes.sonar.filtered > body.safety.ranges", "body.eyes.sonar.filtered > wall.ranges"]
    );
    assert_eq!(loaded.plan.wires[0].filter.recipient.as_deref(), Some("body.safety"));
    let plan = bare(loaded.plan);
    assert_eq!(again(&plan), plan);
}

fn times() -> impl Strategy<Value = Duration> {
    (1i64..10_000_000_000).prop_map(Duration)
}

fn executors() -> impl Strategy<Value = Vec<ExecutorPlan>> {
    let by_priority =
        (proptest::option::of(1u8..95), proptest::collection::vec(0usize..64, 0..3), 0i64..1_000_000);
    let one = proptest::option::weighted(0.7, by_priority);
    proptest::collection::vec(one, 0..3).prop_map(|all| {
        let named = all.into_iter().enumerate();
        named
            .map(|(i, one)| {
                let name = ["reflex", "own one", "x.y"][i];
                let (priority, cpus, spin) = match one {
                    Some(one) => one,
                    // On the first, a usual one, there are agents that the kernel would not take.
                    None if i == 0 => (None, Vec::new(), 0),
                    None => return ExecutorPlan::by_deadline(name),
                };
                ExecutorPlan { cpus, spin: Duration(spin), ..ExecutorPlan::new(name, priority) }
            })
            .collect()
    })
}

/// Followers of a wall, each with a safety monitor beside it, under all kinds of names.
fn agents() -> impl Strategy<Value = Vec<AgentPlan>> {
    let one = (times(), 0i64..1000, any::<bool>(), any::<bool>(), 0.1f64..2.0, proptest::option::of(times()));
    proptest::collection::vec(one, 1..5).prop_map(|all| {
        let named = all.into_iter().enumerate();
        named
            .map(|(i, (period, gap, leave, ranged, keep, hang_after))| {
                let mut params = Table::new();
                params.set("keep", Value::Float(keep));
                AgentPlan {
                    name: ["wall", "group.wall", "ä \"b\"", "é\\c", "w_-1"][i].to_owned(),
                    kind: "wall-follower".to_owned(),
                    period: Some(period),
                    period_range: ranged.then(|| (Duration(period.0 / 2 + 1), period * 2)),
                    deadline: ranged.then_some(period),
                    on: if leave { vec!["ranges".into(), "odometry".into()] } else { vec!["ranges".into()] },
                    min_gap: Duration(gap),
                    wake_gap: Duration(999 - gap),
                    executor: leave.then(|| "control".to_owned()),
                    on_death: if leave { OnDeath::Leave } else { OnDeath::Restart },
                    hang_after,
                    params,
                    giving: Giving {
                        importance: leave.then_some(keep / 2.0),
                        elasticity: ranged.then_some(keep),
                        gap_max: ranged.then_some(Duration(gap + 1)),
                        may_suspend: leave,
                        is_rigid: ranged,
                        is_suspended: leave && ranged,
                    },
                    ..AgentPlan::default()
                }
            })
            .collect()
    })
}

fn wire(to: String) -> impl Strategy<Value = WirePlan> {
    let policy = prop_oneof![
        Just(None),
        Just(Some(Overload::NewestWins)),
        Just(Some(Overload::OldestWins)),
        Just(Some(Overload::Refuse)),
    ];
    let category = proptest::option::of(proptest::sample::select(Category::ALL.to_vec()));
    let priority = proptest::sample::select(Priority::ALL.to_vec());
    let marker = proptest::option::of(any::<u32>());
    let recipient = proptest::sample::select(vec![None, Some("eyes"), Some("wall")]);
    (proptest::option::of(1usize..1000), policy, category, priority, marker, recipient, 0u32..9).prop_map(
        move |(depth, overload, category, priority, marker, recipient, every)| WirePlan {
            depth,
            overload,
            filter: WireFilter {
                category,
                least_priority: types::header::LeastPriority(priority),
                marker,
                recipient: recipient.map(str::to_owned),
                every,
            },
            ..WirePlan::new("eyes.filtered", to.clone())
        },
    )
}

fn queue() -> impl Strategy<Value = (QueuePlan, Option<u8>)> {
    let policies = vec![None, Some(Overload::NewestWins), Some(Overload::OldestWins), Some(Overload::Refuse)];
    let parts = (proptest::option::of(1usize..1000), proptest::sample::select(policies), any::<Option<u8>>());
    parts.prop_map(|(depth, overload, serving)| {
        (QueuePlan { depth, overload, ..QueuePlan::new("seen") }, serving)
    })
}

fn plans() -> impl Strategy<Value = Plan> {
    let whole =
        (executors(), agents(), "\\PC{0,12}", proptest::option::of(times()), proptest::option::of(queue()));
    whole.prop_flat_map(|(executors, mut agents, name, time, queue)| {
        let wires: Vec<_> = agents.iter().map(|agent| wire(format!("{}.ranges", agent.name))).collect();
        agents.push(AgentPlan {
            name: "eyes".into(),
            kind: "sonar".into(),
            on: vec!["echoes".into()],
            ..AgentPlan::default()
        });
        let mut queued = Vec::new();
        let mut queues = Vec::new();
        if let Some((queue, serving)) = queue {
            queued.push(WirePlan::new("eyes.filtered", queue.name.clone()));
            let inputs = agents.iter().filter(|agent| agent.name != "eyes");
            queued.extend(inputs.map(|agent| {
                let serving = serving.map(|serving| serving % (1 + runtime::MOST_SERVING));
                WirePlan { serving, ..WirePlan::new(queue.name.clone(), format!("{}.ranges", agent.name)) }
            }));
            queues.push(queue);
        }
        let requests = time.map(|at| TimedRequest {
            at,
            words: ["fault", agents[0].name.as_str(), "slow"].map(str::to_owned).to_vec(),
            place: Span::default(),
        });
        wires.prop_map(move |wires| Plan {
            name: name.clone(),
            executors: executors.clone(),
            agents: agents.clone(),
            queues: queues.clone(),
            wires: wires.into_iter().chain(queued.clone()).collect(),
            requests: requests.iter().cloned().collect(),
            sections: Table::new(),
        })
    })
}

proptest! {
    #[test]
    fn any_plan_survives(plan in plans()) {
        let plan = bare(plan);
        prop_assert_eq!(again(&plan), plan);
    }
}
