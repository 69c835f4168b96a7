//! What became of the tasks of the reactive layer, for the summary.

use serde_json::{Value as Json, json};

use crate::figures::TaskOutcome;

/// One row for each, in the order in which they ended.
pub(super) fn document(tasks: &[TaskOutcome]) -> Json {
    let row = |task: &TaskOutcome| {
        json!({
            "task": task.task, "ended": task.last.progress.word(), "at_s": task.at,
            "took_s": task.last.seconds, "left_m": task.last.distance, "left_rad": task.last.angle,
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
        return vec![named(0, told.join(", "))];
    }
    let line = |task: &TaskOutcome| {
        let last = &task.last;
        let left = format!("{:.3} m and {:.1}° left", last.distance, last.angle.to_degrees());
        format!(
            "{:>2} {:<12} at {:.2} s after {:.2} s, {left}",
            task.task,
            last.progress.word(),
            task.at,
            last.seconds
        )
    };
    tasks.iter().enumerate().map(|(i, task)| named(i, line(task))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::messages::{Progress, Report};

    fn ended(task: u32, progress: Progress) -> TaskOutcome {
        let last = Report { task, progress, distance: 0.0071, angle: 0.01, seconds: 9.5 };
        TaskOutcome { task, at: 12.5, last }
    }

    #[test]
    fn each_task_is_told_and_many_are_counted() {
        let few = [ended(1, Progress::Arrived), ended(2, Progress::TimedOut)];
        let told = text(&few);
        assert_eq!(told.len(), 2);
        assert!(told[0].starts_with("  tasks ") && told[0].contains("arrived"), "{told:?}");
        assert!(told[1].contains("timed out") && told[1].contains("0.007 m and 0.6° left"), "{told:?}");
        assert_eq!(document(&few)[1]["ended"], "timed out");
        let many: Vec<_> = (0..30).map(|i| ended(i, Progress::Arrived)).chain(few).collect();
        assert_eq!(text(&many), ["  tasks        31 arrived, 1 timed out"]);
    }
}
