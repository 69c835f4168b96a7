//! What the analysis found: for people, and as JSON.

use serde_json::{Value as Json, json};

use schedule::Exact;
use schedule::utilization::Verdict;

use crate::run::{span, table};

/// What was found of a task or an agent. Times in nanoseconds.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub name: String,
    pub cost: Exact,
    /// Nothing for an agent that nothing makes run.
    pub period: Option<Exact>,
    pub deadline: Exact,
    /// For people: `fifo 70`, 100 for one by its deadline, or the rank among the tasks, 1 for the highest.
    pub priority: Option<u32>,
    pub processor: Option<usize>,
    /// Nothing where the deadline is missed, or nothing is promised.
    pub response: Option<Exact>,
    /// Whether it must meet its deadline.
    pub counts: bool,
    /// The longest response when it was played, and when it was measured (s).
    pub played: Option<f64>,
    pub measured: Option<f64>,
    pub least_period: Option<f64>,
    pub cost_factor: Option<f64>,
    /// For people: what makes it run, where that is not a clock.
    pub remark: String,
}

/// One processor, or several that are analysed as one.
#[derive(Clone, Debug)]
pub(super) struct Part {
    /// Which.
    pub name: String,
    pub utilization: f64,
    pub liu_layland: Verdict,
    pub hyperbolic: Verdict,
    pub response_time: bool,
    pub edf: Edf,
}

/// What the demand test says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Edf {
    pub pass: bool,
    /// Why not.
    pub why: String,
}

/// A chain from a sensor to an actuator.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub agents: Vec<String>,
    pub latency: Option<Exact>,
}

/// All that was found.
#[derive(Clone, Debug, Default)]
pub(super) struct Report {
    pub name: String,
    pub parts: Vec<Part>,
    pub rows: Vec<Row>,
    pub chains: Vec<Chain>,
    /// What people should know of the numbers.
    pub notes: Vec<String>,
    pub files: Vec<String>,
}

/// So many chains are shown to people.
pub(super) const SHOWN_CHAINS: usize = 12;

/// In seconds.
pub(super) fn seconds(time: Exact) -> f64 {
    *time.numer() as f64 / (*time.denom() as f64 * 1e9)
}

fn nanos(time: Exact) -> f64 {
    *time.numer() as f64 / *time.denom() as f64
}

/// A time with the digits that people look for in it: 65.1 µs.
pub(super) fn people(nanos: f64) -> String {
    let (unit, scale) = match nanos {
        n if n < 999.95 => ("ns", 1.0),
        n if n < 999.95e3 => ("µs", 1e-3),
        n if n < 999.95e6 => ("ms", 1e-6),
        _ => ("s", 1e-9),
    };
    let text = format!("{:.3}", nanos * scale);
    let text = text.trim_end_matches('0').trim_end_matches('.');
    format!("{text} {unit}")
}

impl Report {
    /// Whether all deadlines are met.
    pub(super) fn pass(&self) -> bool {
        self.parts.iter().all(|part| part.response_time)
    }

    fn utilization(&self) -> f64 {
        self.parts.iter().map(|part| part.utilization).sum()
    }

    pub(super) fn to_json(&self) -> Json {
        // Of several processors the one that is worst off speaks for all.
        let worst = |verdict: fn(&Part) -> Verdict| {
            let all = self.parts.iter().map(verdict);
            all.min_by(|a, b| (a.bound - a.value).total_cmp(&(b.bound - b.value))).unwrap_or(Verdict {
                value: 0.0,
                bound: 1.0,
                pass: true,
            })
        };
        let (ll, product) = (worst(|part| part.liu_layland), worst(|part| part.hyperbolic));
        let part = |part: &Part| {
            json!({
                "name": part.name,
                "utilization": part.utilization,
                "liu_layland": {"bound": part.liu_layland.bound, "pass": part.liu_layland.pass},
                "hyperbolic": {"product": part.hyperbolic.value, "pass": part.hyperbolic.pass},
                "response_time": {"pass": part.response_time},
                "edf": {"pass": part.edf.pass},
            })
        };
        json!({
            "system": self.name,
            "processors": self.parts.len(),
            "utilization": self.utilization(),
            "liu_layland": {"bound": ll.bound, "pass": self.parts.iter().all(|part| part.liu_layland.pass)},
            "hyperbolic": {"product": product.value, "pass": self.parts.iter().all(|part| part.hyperbolic.pass)},
            "response_time": {"pass": self.pass()},
            "edf": {"pass": self.parts.iter().all(|part| part.edf.pass)},
            "by_processor": self.parts.iter().map(part).collect::<Vec<_>>(),
            "tasks": self.rows.iter().map(row_json).collect::<Vec<_>>(),
            "chains": self.chains.iter().map(chain_json).collect::<Vec<_>>(),
            "notes": self.notes,
            "files": self.files,
        })
    }

    pub(super) fn to_text(&self) -> String {
        let mut out = format!("{}\n\n", self.name);
        out += &self.tasks();
        out.push('\n');
        for part in &self.parts {
            let several = self.parts.len() > 1;
            if several {
                out += &format!("{}\n", part.name);
            }
            out += &part.to_text();
        }
        if !self.chains.is_empty() {
            out += "\nfrom a sensor to an actuator, at worst\n";
            for chain in self.chains.iter().take(SHOWN_CHAINS) {
                let latency = chain.latency.map_or("no bound".to_owned(), |time| people(nanos(time)));
                out += &format!("  {latency:>10}  {}\n", chain.agents.join(" → "));
            }
        }
        for note in &self.notes {
            out += &format!("\n{note}\n");
        }
        for file in &self.files {
            out += &format!("\n{file}");
        }
        if !self.files.is_empty() {
            out.push('\n');
        }
        out
    }

    fn tasks(&self) -> String {
        let title = |title: &str, column: fn(&Row) -> Option<f64>| {
            let is_used = self.rows.iter().any(|row| column(row).is_some());
            if is_used { title.to_owned() } else { String::new() }
        };
        let (played, measured) = (title("played", |row| row.played), title("measured", |row| row.measured));
        let [a, b, c, d, e, f, g, h, i] =
            ["", "priority", "", "C", "T", "D", "response", "least T", "C may grow"].map(str::to_owned);
        let head = [a, b, c, d, e, f, g, played, measured, h, i];
        let several = self.rows.iter().any(|row| row.processor.is_some());
        let mut rows = vec![head];
        for row in &self.rows {
            let priority = row.priority.map_or("-".to_owned(), |priority| priority.to_string());
            let processor =
                row.processor.filter(|_| several).map(|it| format!(" on {it}")).unwrap_or_default();
            let response = match (row.response, row.counts) {
                (Some(time), _) => people(nanos(time)),
                (None, true) => "MISSES".to_owned(),
                (None, false) => "-".to_owned(),
            };
            rows.push([
                row.name.clone(),
                priority + &processor,
                row.remark.clone(),
                people(nanos(row.cost)),
                row.period.map_or("-".to_owned(), |time| people(nanos(time))),
                people(nanos(row.deadline)),
                response,
                row.played.map_or(String::new(), |time| people(time * 1e9)),
                row.measured.map_or(String::new(), |time| people(time * 1e9)),
                row.least_period.map_or("-".to_owned(), people),
                row.cost_factor.map_or("-".to_owned(), |factor| format!("× {factor:.3}")),
            ]);
        }
        table(&rows, 3)
    }
}

impl Part {
    fn to_text(&self) -> String {
        let verdict = |pass: bool| if pass { "yes" } else { "no" };
        let mut out = String::new();
        let mut line = |what: &str, numbers: String, pass: bool| {
            out += &format!("  {what:<28} {numbers:<34} {}\n", verdict(pass));
        };
        let (ll, product) = (self.liu_layland, self.hyperbolic);
        line("utilisation", format!("{:.6} ≤ 1", self.utilization), self.utilization <= 1.0);
        line("Liu and Layland", format!("{:.6} ≤ {:.6}", ll.value, ll.bound), ll.pass);
        line("hyperbolic", format!("{:.6} ≤ 2", product.value), product.pass);
        line("response times", "each within its deadline".to_owned(), self.response_time);
        line("earliest deadline first", self.edf.why.clone(), self.edf.pass);
        out
    }
}

fn row_json(row: &Row) -> Json {
    json!({
        "name": row.name,
        "c": seconds(row.cost),
        "t": row.period.map(seconds),
        "d": seconds(row.deadline),
        "priority": row.priority,
        "processor": row.processor,
        "response": row.response.map(seconds),
        "played": row.played,
        "measured": row.measured,
        "t_min": row.least_period.map(|nanos| nanos / 1e9),
        "c_factor": row.cost_factor,
    })
}

fn chain_json(chain: &Chain) -> Json {
    json!({"agents": chain.agents, "latency": chain.latency.map(seconds)})
}

/// A span for a sentence.
pub(super) fn in_words(time: Exact) -> String {
    span(nanos(time))
}
