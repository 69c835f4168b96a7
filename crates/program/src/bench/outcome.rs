//! What a measurement gives, for programs and for people.

use serde_json::{Value as Json, json};

use super::machine;
use crate::error::Failure;
use crate::terminal;

/// A measured quantity, unfiltered.
pub(super) struct Measured {
    name: String,
    unit: &'static str,
    values: Vec<f64>,
}

/// Ours and theirs, from the same run.
pub(super) struct Ratio {
    pub(super) name: &'static str,
    ours: f64,
    theirs: f64,
    value: f64,
    /// The least and the greatest of all rounds, where there were several.
    range: Option<[f64; 2]>,
}

/// What a measurement gives.
#[derive(Default)]
pub(super) struct Outcome {
    pub(super) figures: Vec<Measured>,
    pub(super) ratios: Vec<Ratio>,
    /// Which threads got which policy.
    granted: Vec<(String, String)>,
    /// What a reader of the figures must know besides.
    notes: Vec<String>,
    /// Ratios without their other system: it is not here.
    pub(super) missing: Vec<&'static str>,
    /// For people, before the figures.
    pub(super) table: Option<String>,
    /// For programs, under a name of its own.
    pub(super) document: Option<(&'static str, Json)>,
    /// Ratios whose other system is here, but could not be measured; with what it said.
    failed: Vec<(&'static str, Failure)>,
}

impl Measured {
    pub(super) fn new(name: impl Into<String>, unit: &'static str, mut values: Vec<f64>) -> Measured {
        values.sort_by(f64::total_cmp);
        Measured { name: name.into(), unit, values }
    }

    /// Whether nothing was measured.
    pub(super) fn is_empty(&self) -> bool {
        self.values.is_empty()
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
    /// Adds a figure.
    pub(super) fn figure(&mut self, name: impl Into<String>, unit: &'static str, values: Vec<f64>) {
        if !values.is_empty() {
            self.figures.push(Measured::new(name, unit, values));
        }
    }

    /// Adds ours and theirs from rounds in which they took turns: the round whose ratio is in the middle.
    pub(super) fn compare(&mut self, name: &'static str, mut rounds: Vec<(f64, f64)>) {
        // A difference of two measurements can be lost in their noise: then it says nothing of either side.
        let is_lost = |round: &(f64, f64)| round.0 <= 0.0 || round.1 <= 0.0;
        if rounds.iter().any(is_lost) {
            let what = "what was measured is smaller than the noise of the measurement";
            self.without(name, Some(Failure::new(what).help("try again when the machine is quiet")));
            return;
        }
        rounds.sort_by(|a, b| (a.0 / a.1).total_cmp(&(b.0 / b.1)));
        if let Some(&(ours, theirs)) = rounds.get(rounds.len() / 2) {
            let ends = [rounds.first(), rounds.last()].map(|round| round.map_or(0.0, |(a, b)| a / b));
            let range = (rounds.len() > 1).then_some(ends);
            self.ratios.push(Ratio { name, ours, theirs, value: ours / theirs, range });
        }
    }

    /// Adds the larger of the ratios at the median and at 99 of 100.
    pub(super) fn compare_tails(&mut self, name: &'static str, ours: &Measured, theirs: &Measured) {
        let ratios = [0.5, 0.99].map(|share| (ours.at(share), theirs.at(share)));
        let [middle, tail] = ratios;
        let (ours, theirs) = if middle.0 / middle.1 >= tail.0 / tail.1 { middle } else { tail };
        self.ratios.push(Ratio { name, ours, theirs, value: ours / theirs, range: None });
    }

    /// A ratio cannot be had; because of a failure of the other system, or because it is not there.
    pub(super) fn without(&mut self, name: &'static str, failure: Option<Failure>) {
        match failure {
            Some(failure) => self.failed.push((name, failure)),
            None => self.missing.push(name),
        }
    }

    /// Which policy a thread got; each thread once.
    pub(super) fn grant(&mut self, thread: &str, policy: &str) {
        if !self.granted.iter().any(|(known, got)| known == thread && got == policy) {
            self.granted.push((thread.to_owned(), policy.to_owned()));
        }
    }

    /// What a reader must know besides.
    pub(super) fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// Whether every ratio was measured.
    pub(super) fn is_whole(&self) -> bool {
        self.missing.is_empty() && self.failed.is_empty()
    }

    /// Says aloud which ratios are missing.
    pub(super) fn tell_missing(&self) {
        for name in &self.missing {
            terminal::tell(&format!("{name} is missing: the other system was not measured beside ours"));
        }
        for (name, failure) in &self.failed {
            let what: Vec<&str> = failure.problems.iter().map(|problem| problem.what.as_str()).collect();
            terminal::tell(&format!("{name} is missing: {}", what.join("\n")));
        }
    }

    pub(super) fn to_json(&self, name: &str) -> Json {
        let ratios = self.ratios.iter().map(|ratio| {
            let mut row =
                json!({"name": ratio.name, "ours": ratio.ours, "theirs": ratio.theirs, "value": ratio.value});
            if let Some(range) = ratio.range {
                row["range"] = json!(range);
            }
            row
        });
        let granted = self.granted.iter().map(|(thread, policy)| json!({"thread": thread, "policy": policy}));
        let mut document = json!({
            "bench": name,
            "machine": machine::describe(),
            "granted": granted.collect::<Vec<_>>(),
            "figures": self.figures.iter().map(Measured::to_json).collect::<Vec<_>>(),
            "ratios": ratios.collect::<Vec<_>>(),
            "notes": self.notes,
        });
        if let Some((name, more)) = &self.document {
            document[*name] = more.clone();
        }
        document
    }

    pub(super) fn to_text(&self, name: &str) -> String {
        let mut out = format!("{name} on {}\n", machine::line());
        if let Some(table) = &self.table {
            out += &format!("{table}\n");
        }
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
            let range = ratio.range.map(|[least, most]| format!("; rounds from {least:.2} to {most:.2}"));
            out += &format!(
                "  {}: {:.2} (ours {}, theirs {}{})\n",
                ratio.name,
                ratio.value,
                number(ratio.ours),
                number(ratio.theirs),
                range.unwrap_or_default()
            );
        }
        for (thread, policy) in &self.granted {
            out += &format!("  {thread}: {policy}\n");
        }
        for note in &self.notes {
            out += &format!("  {note}\n");
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

    #[test]
    fn the_round_in_the_middle_is_told_and_of_two_percentiles_the_worse() {
        let mut outcome = Outcome::default();
        outcome.compare("a/b", vec![(9.0, 1.0), (2.0, 1.0), (3.0, 3.0)]);
        assert_eq!((outcome.ratios[0].ours, outcome.ratios[0].value), (2.0, 2.0));
        assert_eq!(outcome.ratios[0].range, Some([1.0, 9.0]));
        let ours = Measured::new("ours", "ns", [vec![2.0; 98], vec![30.0; 2]].concat());
        let theirs = Measured::new("theirs", "ns", [vec![1.0; 98], vec![20.0; 2]].concat());
        outcome.compare_tails("c/d", &ours, &theirs);
        assert_eq!((outcome.ratios[1].ours, outcome.ratios[1].value), (2.0, 2.0));
    }

    #[test]
    fn what_is_lost_in_noise_gives_no_ratio() {
        let mut outcome = Outcome::default();
        outcome.compare("a/b", vec![(3.0, 2.0), (-1.0, 2.0), (4.0, 2.0)]);
        assert!(outcome.ratios.is_empty());
        assert_eq!(outcome.failed[0].0, "a/b");
    }
}
