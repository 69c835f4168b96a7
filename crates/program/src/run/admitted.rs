//! A running system is asked on the command line for more than there is time for.

use std::sync::Arc;

use super::{One, options, with_robots};
use crate::cli::{ClockChoice, RunArgs, run_args, typed};
use crate::error::{Failure, Paint};

/// 3 of 10 above 10 of 40: by hand 3 and 16 on one processor.
const SYSTEM: &str = "
[agent.image]
is = \"wall-follower\"
period = \"10ms\"
period_max = \"30ms\"
cost = \"3ms\"
executor = \"reflex\"
[agent.plan]
is = \"wall-follower\"
period = \"40ms\"
cost = \"10ms\"
executor = \"control\"
";

/// 4 of 8 above both.
const THIRD: [&str; 6] = ["third", "is", "wall-follower", "period=8ms", "cost=4ms", "executor=receive"];

fn args(file: &str) -> RunArgs {
    run_args(&["run", file, "--for", "10000h", "--processors", "1", "--no-log"])
}

#[test]
fn what_does_not_fit_is_refused_and_fits_once_others_make_room_as_proposed() {
    let name = format!("admitted-{}", std::process::id());
    let file = std::env::temp_dir().join(format!("{name}.toml"));
    std::fs::write(&file, format!("name = \"{name}\"\n{SYSTEM}")).unwrap();
    let args = args(file.to_str().unwrap());
    let scenario = options::scenario(&args, with_robots(agents::registry())).unwrap();
    std::fs::remove_file(&file).unwrap();
    let one = One {
        facts: None,
        args: &args,
        scenario: &scenario,
        seed: 1,
        clock: ClockChoice::Sim,
        watched: false,
        place: None,
        asked_to_end: Arc::default(),
        serves: true,
        repeat: None,
        knowing: None,
    };
    let ask = |verb: &[&str], words: &[&str]| -> Result<(), Failure> {
        typed(&[verb, &["--json", "--system", &name], words].concat()).map(drop)
    };
    let summary = std::thread::scope(|scope| {
        let run = scope.spawn(|| one.run(scenario.prepare(1).unwrap()).unwrap());
        // Whatever becomes of the test, the run ends.
        let _end = Ends(&one.asked_to_end);
        while ask(&["ls"], &[]).is_err() && !run.is_finished() {
            std::thread::yield_now();
        }
        let refused = ask(&["add"], &THIRD).unwrap_err();
        assert_eq!(refused.code, 2);
        let told = refused.to_text(Paint::Plain);
        assert!(
            told.starts_with("error: the deadlines would not be met: plan might never be done"),
            "{told}"
        );
        let expected = "third fits with a period of 9.5ms or longer; --force does it all the same; or make room first, \
            with image every 13 ms: sinew set image period=13ms";
        assert!(told.contains(expected), "{told}");

        let (_, command) = told.trim_end().split_once(": sinew ").unwrap();
        let words: Vec<&str> = command.split(' ').map(|word| word.trim_matches('\'')).collect();
        ask(&words[..1], &words[1..]).unwrap();
        ask(&["add"], &THIRD).unwrap();

        // Now nobody has anything left to give.
        let fourth = ["fourth", "is", "wall-follower", "period=8ms", "cost=3ms", "executor=reflex"];
        let refused = ask(&["add"], &fourth).unwrap_err().to_text(Paint::Plain);
        assert!(!refused.contains("make room"), "{refused}");
        ask(&["add", "--force"], &fourth).unwrap();
        ask(&["quit"], &[]).unwrap();
        run.join().unwrap()
    });
    let names: Vec<&str> = summary.agents.iter().map(|agent| agent.name.as_str()).collect();
    assert_eq!(names, ["image", "plan", "third", "fourth"]);
    let told = summary.to_text(false);
    assert!(told.contains("admitted by force: the deadlines would not be met: "), "{told}");
}

struct Ends<'a>(&'a std::sync::atomic::AtomicBool);

impl Drop for Ends<'_> {
    fn drop(&mut self) {
        self.0.store(true, std::sync::atomic::Ordering::Relaxed);
    }
}
