//! Agents that block on purpose: one in real time, which RealtimeSanitizer must see, and one that may, which it must not.
//!
//! The step `sanitize` of the tests looks for the names of these functions in what the sanitizer has told.

use core::hint::black_box;
use core::sync::atomic::{AtomicU64, Ordering};

use runtime::{Agent, Fault, Live, NoObserver, Options, Plan, Step, registry};
use types::Duration;

use crate::options;

/// How often somebody has blocked.
static TIMES: AtomicU64 = AtomicU64::new(0);

/// Blocks where nobody may.
#[derive(Agent)]
struct Blocker {}

impl Agent for Blocker {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        opens_a_file_in_real_time();
        takes_memory_in_real_time();
        Ok(())
    }
}

/// Blocks where everybody may.
#[derive(Agent)]
struct Idler {}

impl Agent for Idler {
    fn step(&mut self, _: &mut Step) -> Result<(), Fault> {
        opens_a_file_where_it_may();
        Ok(())
    }
}

#[inline(never)]
fn opens_a_file_in_real_time() {
    let _ = black_box(std::fs::File::open("/dev/null"));
}

#[inline(never)]
fn takes_memory_in_real_time() {
    drop(black_box(vec![black_box(1u8); 100]));
    TIMES.fetch_add(1, Ordering::Relaxed);
}

#[inline(never)]
fn opens_a_file_where_it_may() {
    let _ = black_box(std::fs::File::open("/dev/null"));
    TIMES.fetch_add(1, Ordering::Relaxed);
}

#[test]
fn an_agent_that_blocks_on_purpose() {
    let mut plan = Plan::new("blocking");
    plan.add::<Blocker>("blocker", Default::default());
    plan.add::<Idler>("idler", Default::default());
    for (agent, executor) in [("blocker", "reflex"), ("idler", "ordinary")] {
        plan.agent_mut(agent).unwrap().executor = Some(executor.into());
        plan.every(agent, Duration::millis(10));
    }
    let options = Options { observer: Box::new(NoObserver), ..options(200) };
    Live::new(&plan, &registry![Blocker, Idler], options).unwrap().run().unwrap();
    assert!(TIMES.load(Ordering::Relaxed) > 2, "both were to block");
}
