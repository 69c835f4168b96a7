//! Chores of this repository.
//!
//! | command | does |
//! |---|---|
//! | `cargo xtask test` | everything that must hold, step by step; stops at the first failure and says what to do |
//! | `cargo xtask test --list` | the steps |
//! | `cargo xtask test --only tidy,unit` | some of them |
//! | `cargo xtask tidy` | the checks of structure alone: layers, purity, names in the documents |
//! | `cargo xtask peers` | builds the program that measures other systems beside ours |
#![allow(clippy::print_stdout, reason = "a program for the terminal")]

mod failure;
mod peers;
mod steps;
mod tidy;
mod tool;
mod workspace;

use std::process::ExitCode;

use failure::Failure;
use workspace::Workspace;

/// The words that may follow `cargo xtask`; the documents may name no other.
const COMMANDS: [&str; 3] = ["peers", "test", "tidy"];

const USAGE: &str = "\
Usage: cargo xtask COMMAND

  test                 all steps in order; stops at the first failure
  test --list          the steps and what each shows
  test --only A[,B]    only these steps
  tidy                 layers, purity, lengths, and the names in the documents
  peers                builds other systems, for `sinew bench` to measure beside ours

Environment: SINEW_DATA, the folder with recordings of real robots (default ../shared/data);
SINEW_FUZZ_SECONDS, how long each target of the step fuzz runs (default 10);
SINEW_FAULTS, which sample of the faults the step faults tries (default 0), or \"all\";
SINEW_PROGRAM, a program that the steps take in place of a release build.";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    match run(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::from(failure.code)
        }
    }
}

fn run(words: &[&str]) -> Result<(), Failure> {
    match words {
        [] | ["help" | "--help" | "-h"] => {
            println!("{USAGE}");
            Ok(())
        }
        ["peers"] => peers::build(&Workspace::find()?),
        ["tidy"] => tidy::run(&Workspace::find()?),
        ["test", "--list"] => {
            steps::list();
            Ok(())
        }
        ["test"] => steps::run(&Workspace::find()?, &steps::ALL),
        ["test", "--only", names] => steps::run(&Workspace::find()?, &steps::named(names)?),
        _ => Err(Failure::usage(format!("\"{}\" is no command", words.join(" ")), USAGE)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wrong_word_is_refused_with_the_usage() {
        let failure = run(&["tset"]).unwrap_err();
        assert_eq!(failure.code, 2);
        assert!(failure.to_string().contains("cargo xtask COMMAND"), "{failure}");
        assert!(run(&["test", "--only", "unti"]).unwrap_err().to_string().contains("unti"));
    }
}
