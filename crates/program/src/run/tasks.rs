//! What became of the tasks of the reactive layer, for the summary.

use serde_json::{Value as Json, json};
use types::messages::{Progress, Report};

use crate::figures::TaskOutcome;

/// One row for each, in the order in which they ended.
pub(super) fn document(tasks: &[TaskOutcome]) -> Json {
    let row = |task: &TaskOutcome| {
        json!({
            "task": task.task, "ended": task.last.progress.word(), "at_s": task.at,
            "took_s": task.last.seconds, "left_m": task.last.distance, "left_rad": task.last.angle,
            "off_m": task.off, "off_rad": task.turned, "why": task.last.why.as_str(),
        })
    };
    tasks.iter().map(row).collect()
}

/// More tasks than this are counted by how they ended.
const SHOWN: usize = 24;

/// The same for people.
pub(super) fn text(tasks: &[TaskOutcome]) -> Vec<String> {
    let named = |i: usize, what: String| format!("  {:<12} {what}", if i == 0 { "tasks" } else { "" });
    if tasks.len() > SHOWN {
        let mut words: Vec<&str> = tasks.iter().map(|task| task.last.progress.word()).collect();
        words.sort_unstable();
        words.dedup();
        let count = |word: &str| tasks.iter().filter(|task| task.last.progress.word() == word).count();
        let told: Vec<String> = words.iter().map(|word| format!("{} {word}", count(word))).collect();
        return [told.join(", ")]
            .into_iter()
            .chain(reasons(tasks))
            .chain(errors(tasks))
            .enumerate()
            .map(|(i, what)| named(i, what))
            .collect();
    }
    let line = |task: &TaskOutcome| {
        let last = &task.last;
        let why = if last.why.is_empty() { String::new() } else { format!(": {}", last.why) };
        let head = format!("{:>2} {:<12} at {:.2} s", task.task, last.progress.word(), task.at);
        if last.progress == Progress::Refused {
            return format!("{head}{why}");
        }
        let left = format!("{:.3} m and {:.1}° left", last.distance, last.angle.to_degrees());
        let left = match task.off {
            Some(off) => format!("{left}, in truth {off:.3} m"),
            None => left,
        };
        let left = match task.turned {
            Some(turned) => format!("{left} and {:.1}°", turned.to_degrees()),
            None => left,
        };
        format!("{head} after {:.2} s, {left}{why}", last.seconds)
    };
    tasks.iter().enumerate().map(|(i, task)| named(i, line(task))).collect()
}

/// Why those that did not arrive ended, each reason once.
fn reasons(tasks: &[TaskOutcome]) -> Vec<String> {
    let mut rows: Vec<(&str, &str, usize)> = Vec::new();
    for Report { progress, why, .. } in tasks.iter().map(|task| &task.last) {
        match rows.iter_mut().find(|(word, known, _)| (*word, *known) == (progress.word(), why.as_str())) {
            Some((_, _, count)) => *count += 1,
            None if why.is_empty() => {}
            None => rows.push((progress.word(), why.as_str(), 1)),
        }
    }
    rows.into_iter().map(|(word, why, count)| format!("{count} {word}: {why}")).collect()
}

/// How far those that arrived truly were from their places and headings.
fn errors(tasks: &[TaskOutcome]) -> impl Iterator<Item = String> {
    let arrived = tasks.iter().filter(|task| task.last.progress == Progress::Arrived);
    let sorted = |of: fn(&TaskOutcome) -> Option<f64>| {
        let mut off: Vec<f64> = arrived.clone().filter_map(of).collect();
        off.sort_by(f64::total_cmp);
        off
    };
    let told = |off: &[f64], factor: f64, unit: &str| {
        let at = |share: f64| off[((off.len() - 1) as f64 * share).round() as usize] * factor;
        format!("{:.1}{unit} (median), {:.1}{unit} (99 %), {:.1}{unit} (most)", at(0.5), at(0.99), at(1.0))
    };
    let (off, turned) = (sorted(|task| task.off), sorted(|task| task.turned.map(f64::to_degrees)));
    let ways = (!off.is_empty()).then(|| format!("off in truth by {}", told(&off, 1e3, " mm")));
    let turns = (!turned.is_empty()).then(|| format!("turned off by {}", told(&turned, 1.0, "°")));
    ways.into_iter().chain(turns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(task: u32, progress: Progress) -> TaskOutcome {
        let why = if progress == Progress::Arrived { "" } else { "it is so" }.into();
        let last = Report { task, progress, distance: 0.0071, angle: 0.01, seconds: 9.5, why };
        TaskOutcome { task, at: 12.5, last, off: Some(0.004), turned: Some(0.5f64.to_radians()) }
    }

    #[test]
    fn each_task_is_told_and_many_are_counted() {
        let few = [ended(1, Progress::Arrived), ended(2, Progress::TimedOut)];
        let told = text(&few);
        assert_eq!(told.len(), 2);
        assert!(
            told[0].starts_with("  tasks ") && told[0].ends_with("in truth 0.004 m and 0.5°"),
            "{told:?}"
        );
        assert!(told[1].contains("timed out") && told[1].contains("0.007 m and 0.6° left"), "{told:?}");
        assert!(told[1].ends_with("in truth 0.004 m and 0.5°: it is so"), "{told:?}");
        assert_eq!(
            text(&[ended(3, Progress::Refused)]),
            ["  tasks         3 refused      at 12.50 s: it is so"],
            "nothing of it was done"
        );
        assert_eq!(document(&few)[1]["ended"], "timed out");
        assert_eq!(document(&few)[1]["why"], "it is so");
        let many: Vec<_> = (0..30).map(|i| ended(i, Progress::Arrived)).chain(few).collect();
        let expected = [
            "  tasks        31 arrived, 1 timed out",
            "               1 timed out: it is so",
            "               off in truth by 4.0 mm (median), 4.0 mm (99 %), 4.0 mm (most)",
            "               turned off by 0.5° (median), 0.5° (99 %), 0.5° (most)",
        ];
        assert_eq!(text(&many), expected);
    }
}
