//! `sinew bench`: what a machine makes of the runtime and the simulator.

mod hop;
mod machine;
mod peers;
mod simulation;
mod wake;

use std::process::ExitCode;

use clap::Args;
use runtime::Registry;
use serde_json::{Value as Json, json};

use crate::error::Failure;
use crate::terminal;

/// What `sinew bench` can be told.
#[derive(Args, Debug)]
pub(crate) struct BenchArgs {
    /// Which; "list" says what there is.
    #[arg(value_name = "NAME")]
    name: String,
}

/// The measurements.
const BENCHES: [(&str, &str); 3] = [
    ("hop", "a message of 64 bytes from a source over three agents to a sink, on one executor"),
    ("wake", "from sending to the step of an agent that slept, on the same and on another processor"),
    ("sim", "how many times as fast as real time simulations run"),
];

/// A measured quantity, unfiltered.
pub(super) struct Measured {
    name: String,
    unit: &'static str,
    values: Vec<f64>,
}

/// Ours and theirs, from the same run.
pub(super) struct Ratio {
    name: &'static str,
    ours: f64,
    theirs: f64,
    value: f64,
}

/// What a measurement gives.
#[derive(Default)]
pub(super) struct Outcome {
    figures: Vec<Measured>,
    ratios: Vec<Ratio>,
    /// Ratios without their other system: it is not here, or nothing asks for it.
    missing: Vec<&'static str>,
    /// Ratios whose other system is here, but could not be measured; with what it said.
    failed: Vec<(&'static str, Failure)>,
}

/// Measures.
pub(crate) fn bench(args: &BenchArgs, registry: &Registry, json: bool) -> Result<ExitCode, Failure> {
    let outcome = match args.name.as_str() {
        "list" => {
            list(json);
            return Ok(ExitCode::SUCCESS);
        }
        "hop" => hop::measure()?,
        "wake" => wake::measure()?,
        "sim" => simulation::measure(registry)?,
        other => {
            return Err(Failure::unknown(
                "bench",
                other,
                BENCHES.iter().map(|(name, _)| *name).chain(["list"]),
            ));
        }
    };
    if json {
        terminal::say_json(&outcome.to_json(&args.name));
    } else {
        terminal::say(&outcome.to_text(&args.name));
    }
    for name in &outcome.missing {
        terminal::tell(&format!("{name} is missing: the other system was not measured beside ours"));
    }
    if !outcome.missing.is_empty() && peers::Peers::find().is_none() {
        terminal::tell("`cargo xtask peers` builds the program that measures other systems");
    }
    for (name, failure) in &outcome.failed {
        let what: Vec<&str> = failure.problems.iter().map(|problem| problem.what.as_str()).collect();
        terminal::tell(&format!("{name} is missing: {}", what.join("\n")));
    }
    Ok(if outcome.missing.is_empty() && outcome.failed.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

fn list(json: bool) {
    if json {
        let rows = BENCHES.map(|(name, what)| json!({"name": name, "what": what}));
        terminal::say_json(&json!({"benches": rows}));
    } else {
        terminal::say(&BENCHES.map(|(name, what)| format!("{name:<6} {what}")).join("\n"));
    }
}

impl Measured {
    pub(super) fn new(name: impl Into<String>, unit: &'static str, mut values: Vec<f64>) -> Measured {
        values.sort_by(f64::total_cmp);
        Measured { name: name.into(), unit, values }
    }

    /// The value that a share of all does not exceed.
    pub(super) fn at(&self, share: f64) -> f64 {
        let wanted = (share * self.values.len() as f64).ceil().max(1.0) as usize;
        self.values.get(wanted - 1).or(self.values.last()).copied().unwrap_or(f64::NAN)
    }

    fn to_json(&self) -> Json {
        json!({
            "name": self.name,
            "unit": self.unit,
            "n": self.values.len(),
            "min": self.values.first(),
            "p50": self.at(0.5),
            "p99": self.at(0.99),
            "p999": self.at(0.999),
            "max": self.values.last(),
        })
    }
}

/// The value in the middle.
pub(super) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

impl Outcome {
    /// Adds ours and theirs from rounds in which they took turns: the round whose ratio is in the middle.
    pub(super) fn compare(&mut self, name: &'static str, mut rounds: Vec<(f64, f64)>) {
        rounds.sort_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
        if let Some(&(ours, theirs)) = rounds.get(rounds.len() / 2) {
            self.ratios.push(Ratio { name, ours, theirs, value: ours / theirs });
        }
    }

    fn to_json(&self, name: &str) -> Json {
        let ratios = self.ratios.iter().map(|ratio| {
            json!({"name": ratio.name, "ours": ratio.ours, "theirs": ratio.theirs, "value": ratio.value})
        });
        json!({
            "bench": name,
            "machine": machine::describe(),
            "figures": self.figures.iter().map(Measured::to_json).collect::<Vec<_>>(),
            "ratios": ratios.collect::<Vec<_>>(),
        })
    }

    fn to_text(&self, name: &str) -> String {
        let mut out = format!("{name} on {}\n", machine::line());
        let mut rows = vec![["figure", "unit", "n", "min", "p50", "p99", "p999", "max"].map(str::to_owned)];
        let number = |x: f64| if x.abs() >= 100.0 { format!("{x:.0}") } else { format!("{x:.2}") };
        for figure in &self.figures {
            let (min, max) = (figure.values.first().copied(), figure.values.last().copied());
            rows.push([
                figure.name.clone(),
                figure.unit.to_owned(),
                figure.values.len().to_string(),
                number(min.unwrap_or(f64::NAN)),
                number(figure.at(0.5)),
                number(figure.at(0.99)),
                number(figure.at(0.999)),
                number(max.unwrap_or(f64::NAN)),
            ]);
        }
        out += &crate::run::table(&rows, 2);
        for ratio in &self.ratios {
            out += &format!(
                "  {}: {:.2} (ours {}, theirs {})\n",
                ratio.name,
                ratio.value,
                number(ratio.ours),
                number(ratio.theirs)
            );
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_values_that_were_measured() {
        let measured = Measured::new("x", "ns", (1..=1000).rev().map(f64::from).collect());
        assert_eq!(
            [0.0, 0.5, 0.99, 0.999, 1.0].map(|share| measured.at(share)),
            [1.0, 500.0, 990.0, 999.0, 1000.0]
        );
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }
}
