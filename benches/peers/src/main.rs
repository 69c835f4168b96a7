//! The work of Sinew's benches, done with other systems.
//!
//! `peers NAME` does one measurement in this process and prints one JSON document. `sinew bench` starts it once a round, so that
//! ours and theirs take turns on the machine.
//!
//! | to find | look in |
//! |---|---|
//! | what can be measured | [`measurements`] |
//! | copper: hop, hop with its log, caterpillar | [`copper`] |
//! | queues in one thread | [`rings`], [`channels`] |
//! | the machine's own limits | [`futex`], [`chain`], [`nanosleep`], [`spin`] |
//! | shared memory | `iceoryx2`, where that feature is on |
//! | the document | [`document`] |
#![allow(clippy::print_stdout, reason = "a program for the terminal")]

mod chain;
mod channels;
mod copper;
mod document;
mod futex;
#[cfg(feature = "iceoryx2")]
mod iceoryx2;
mod machine;
mod measurements;
mod nanosleep;
mod rings;
mod settings;
mod spin;

use std::process::ExitCode;

use serde_json::json;

use measurements::Measurement;
use settings::Settings;

const USAGE: &str = "\
Usage: peers NAME [--iterations N] [--cpu A[,B]] [--period NS] [--phase NS] [--fifo PRIORITY]
       peers list [--json]

Prints one JSON document.

  --iterations N    how often; each measurement has its own default
  --cpu A[,B]       the processors of its first and second thread
  --period NS       the time between iterations (nanoseconds); hop is as fast as it can be without
  --phase NS        the remainder of the times of iterations by the period, on the monotonic clock (nanosleep)
  --fifo PRIORITY   SCHED_FIFO for its threads; the document says what was granted";

/// Why iceoryx2 cannot be measured, where its feature is off.
const NOT_BUILT_IN: &str = "iceoryx2 is not built in: it is where libclang is (Debian: apt-get install libclang-dev); then `cargo xtask peers` builds this program anew";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let (code, what) = match words[..] {
        [] | ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            return ExitCode::SUCCESS;
        }
        ["list"] => {
            measurements::ALL.iter().for_each(|one| println!("{:<18} {}", one.name, one.what));
            return ExitCode::SUCCESS;
        }
        ["list", "--json"] => {
            println!("{}", list());
            return ExitCode::SUCCESS;
        }
        [name, ref rest @ ..] => match (measurements::named(name), Settings::read(rest)) {
            (None, _) if name == "iceoryx2" => (1, NOT_BUILT_IN.to_owned()),
            (None, _) => (2, format!("there is no measurement \"{name}\"\n\n{USAGE}")),
            (_, Err(what)) => (2, format!("{what}\n\n{USAGE}")),
            (Some(measurement), Ok(settings)) => match (measurement.measure)(&settings) {
                Ok(document) => {
                    println!("{}", document.to_json(measurement.name, &settings));
                    return ExitCode::SUCCESS;
                }
                Err(what) => (1, format!("{name}: {what}")),
            },
        },
    };
    eprintln!("{what}");
    ExitCode::from(code)
}

fn list() -> serde_json::Value {
    let row = |one: &Measurement| json!({"name": one.name, "what": one.what, "peer": one.peer, "figures": one.figures});
    json!({"measurements": measurements::ALL.iter().map(row).collect::<Vec<_>>()})
}
