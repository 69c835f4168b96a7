//! What a measurement hands back, and its form in JSON.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::machine::Granted;
use crate::settings::Settings;

/// So many samples are written one by one; more are written as whole values with their counts.
const FEW: usize = 1000;

/// A measured quantity, unfiltered.
pub(crate) struct Figure {
    name: &'static str,
    unit: &'static str,
    values: Vec<f64>,
}

/// What was measured with a peer.
pub(crate) struct Document {
    /// The other system.
    pub(crate) peer: &'static str,
    /// Its version, as built in.
    pub(crate) version: String,
    /// What its threads asked for and got.
    pub(crate) granted: Vec<Granted>,
    /// The figures.
    pub(crate) figures: Vec<Figure>,
}

impl Figure {
    pub(crate) fn new(name: &'static str, unit: &'static str, mut values: Vec<f64>) -> Figure {
        values.sort_by(f64::total_cmp);
        Figure { name, unit, values }
    }

    /// Whole nanoseconds.
    pub(crate) fn times(name: &'static str, values: Vec<u64>) -> Figure {
        Figure::new(name, "ns", values.into_iter().map(|value| value as f64).collect())
    }

    /// The value that a share of all does not exceed.
    fn at(&self, share: f64) -> Option<f64> {
        let wanted = (share * self.values.len() as f64).ceil().max(1.0) as usize;
        self.values.get(wanted - 1).or(self.values.last()).copied()
    }

    fn to_json(&self) -> Value {
        let mut figure = json!({
            "name": self.name,
            "unit": self.unit,
            "n": self.values.len(),
            "min": self.values.first(),
            "p50": self.at(0.5),
            "p99": self.at(0.99),
            "p999": self.at(0.999),
            "max": self.values.last(),
        });
        if self.values.len() <= FEW {
            figure["values"] = json!(self.values);
        } else {
            figure["counts"] = json!(counts(&self.values));
        }
        figure
    }
}

/// Each whole value with how often it occurs, in their order.
fn counts(values: &[f64]) -> Vec<(i64, u64)> {
    let mut counts = BTreeMap::new();
    values.iter().for_each(|value| *counts.entry(value.round() as i64).or_insert(0) += 1);
    counts.into_iter().collect()
}

impl Document {
    pub(crate) fn to_json(&self, name: &str, settings: &Settings) -> Value {
        json!({
            "measurement": name,
            "peer": self.peer,
            "version": self.version,
            "asked": settings.to_json(),
            "granted": self.granted.iter().map(Granted::to_json).collect::<Vec<_>>(),
            "figures": self.figures.iter().map(Figure::to_json).collect::<Vec<_>>(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_are_written_out_and_many_are_counted() {
        let few = Figure::new("x", "ns", vec![2.5, 1.0]).to_json();
        assert_eq!(few["values"], json!([1.0, 2.5]));
        assert_eq!((few["p50"].as_f64(), few["max"].as_f64()), (Some(1.0), Some(2.5)));
        let many = Figure::times("x", (0..2000).map(|i| 7 + i % 2).collect()).to_json();
        assert_eq!(many["counts"], json!([[7, 1000], [8, 1000]]));
        assert!(many.get("values").is_none());
        assert!(Figure::times("x", vec![]).to_json()["p50"].is_null());
    }
}
