//! Schedules: what is to be done, and when.

use std::path::Path;

use rusqlite::{Connection, Transaction};
use types::value::{Table, Value};
use types::{Duration, Time};

use crate::error::{Result, check_word};
use crate::{Cron, KnowledgeError, Listed, seal, text};

/// Something that is to be done at certain times.
#[derive(Clone, Debug, PartialEq)]
pub struct Schedule {
    /// What it is called.
    pub name: String,
    /// When.
    pub when: When,
    /// What is to be asked of the system, in the words of its requests, as in `set wall keep=0.6`.
    pub words: Vec<String>,
}

/// When something is to be done.
#[derive(Clone, Debug, PartialEq)]
pub enum When {
    /// Once, at a time of the caller's clock.
    Once(Time),
    /// At `first`, a time of the caller's clock, and after each `period` of one second at least.
    Every {
        /// The first time.
        first: Time,
        /// From one to the next.
        period: Duration,
    },
    /// By the calendar.
    Cron(Cron),
}

/// The shortest period: what is more urgent is an agent's.
const SHORTEST: Duration = Duration::secs(1);

/// Which schedules are due, and when: from `from` (included) to `to` (not included), the earliest first, at one time in the order
/// in which they are given. Who calls it for one span after the other finds each time once.
///
/// It reads no clock, so that it says the same in simulated time. `epoch` is what the calendar showed at the zero of the caller's
/// clock, counted from 1970-01-01 00:00: zero for a wall clock and a calendar in UTC, 1 h for a calendar one hour ahead of it, and
/// the date on which a simulated run is thought to begin. It shifts no other times. Daylight saving is not known to it.
pub fn due(schedules: &[Schedule], epoch: Duration, from: Time, to: Time) -> Vec<(Time, String)> {
    let mut all: Vec<(Time, usize)> = Vec::new();
    for (number, schedule) in schedules.iter().enumerate() {
        all.extend(schedule.when.between(epoch, from, to).into_iter().map(|time| (time, number)));
    }
    all.sort();
    all.into_iter().map(|(time, number)| (time, schedules[number].name.clone())).collect()
}

impl When {
    fn between(&self, epoch: Duration, from: Time, to: Time) -> Vec<Time> {
        match self {
            When::Once(time) if (from..to).contains(time) => vec![*time],
            When::Once(_) => Vec::new(),
            When::Every { first, period } => {
                let (first, period) = (i128::from(first.0), i128::from(period.0.max(SHORTEST.0)));
                let ahead = (i128::from(from.0) - first).max(0);
                let start = first + (ahead + period - 1).div_euclid(period) * period;
                let times = (0..).map(|n| start + n * period).take_while(|time| *time < i128::from(to.0));
                times.map(|time| Time(time as i64)).collect()
            }
            When::Cron(cron) => cron.between(epoch, from, to),
        }
    }

    /// For people, as in `every 600s from 0s`.
    fn words(&self) -> String {
        match self {
            When::Once(time) => format!("once at {}", time.since_start()),
            When::Every { first, period } => format!("every {period} from {}", first.since_start()),
            When::Cron(cron) => format!("cron {cron}"),
        }
    }
}

impl Schedule {
    pub(crate) fn check(&self) -> Result<()> {
        check_word("the name of a schedule", &self.name)?;
        if let When::Every { period, .. } = self.when
            && period < SHORTEST
        {
            let what = format!("schedule \"{}\" comes every {period}", self.name);
            return Err(KnowledgeError::wrong(
                what,
                format!("{SHORTEST} is the shortest; let an agent do what is more urgent"),
            ));
        }
        if self.words.is_empty() || self.words.iter().any(|word| word.chars().any(char::is_control)) {
            let what = format!("schedule \"{}\" does not say what to do", self.name);
            return Err(KnowledgeError::wrong(what, "give it words, as in set wall keep=0.6"));
        }
        Ok(())
    }

    pub(crate) fn put(&self, file: &Path, transaction: &Transaction<'_>) -> Result<()> {
        let (kind, first, period, cron) = match &self.when {
            When::Once(time) => ("once", Some(time.0), None, None),
            When::Every { first, period } => ("every", Some(first.0), Some(period.0), None),
            When::Cron(cron) => ("cron", None, None, Some(cron.to_string())),
        };
        let words = self.words.iter().map(|word| Value::from(word.as_str()).into()).collect();
        let mut table = Table::new();
        table.set("do", Value::List(words));
        let words = text::write(&table).map_err(|why| KnowledgeError::wrong(why, ""))?;
        let put = seal::put(transaction, "schedule", &[&self.name, &kind, &first, &period, &cron, &words]);
        put.map_err(|error| KnowledgeError::of(file, &error))
    }

    pub(crate) fn listed(&self) -> Listed {
        Listed { name: self.name.clone(), what: format!("{}: {}", self.when.words(), self.words.join(" ")) }
    }
}

/// All schedules, by their names.
pub(crate) fn all(file: &Path, connection: &Connection) -> Result<Vec<Schedule>> {
    let failed = |error: rusqlite::Error| KnowledgeError::of(file, &error);
    let mut statement = connection
        .prepare("SELECT name, kind, first, period, cron, words, crc FROM schedule ORDER BY name")
        .map_err(failed)?;
    let mut rows = statement.query([]).map_err(failed)?;
    let mut all = Vec::new();
    while let Some(row) = rows.next().map_err(failed)? {
        seal::verify(row, 6).map_err(failed)?;
        let name: String = row.get(0).map_err(failed)?;
        let kind: String = row.get(1).map_err(failed)?;
        let first = row.get::<_, Option<i64>>(2).map_err(failed)?.map(Time);
        let period = row.get::<_, Option<i64>>(3).map_err(failed)?.map(Duration);
        let cron = row.get::<_, Option<String>>(4).map_err(failed)?.and_then(|cron| cron.parse().ok());
        let when = match (kind.as_str(), first, period, cron) {
            ("once", Some(time), None, None) => Some(When::Once(time)),
            ("every", Some(first), Some(period), None) => Some(When::Every { first, period }),
            ("cron", None, None, Some(cron)) => Some(When::Cron(cron)),
            _ => None,
        };
        let words: String = row.get(5).map_err(failed)?;
        let schedule =
            when.zip(read_words(&words)).map(|(when, words)| Schedule { name: name.clone(), when, words });
        let damaged = || KnowledgeError::damaged(file, format!("the schedule \"{name}\" cannot be read"));
        all.push(schedule.filter(|schedule| schedule.check().is_ok()).ok_or_else(damaged)?);
    }
    Ok(all)
}

fn read_words(line: &str) -> Option<Vec<String>> {
    let table = text::read(line)?;
    let list = table.get("do")?.value.as_list()?;
    list.iter().map(|entry| entry.value.as_text().map(str::to_owned)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn schedule(name: &str, when: When) -> Schedule {
        Schedule { name: name.into(), when, words: vec!["reset".into()] }
    }

    fn seconds(schedules: &[Schedule], from: i64, to: i64) -> Vec<(i64, String)> {
        let at = |s: i64| Time::ZERO + Duration::secs(s);
        due(schedules, Duration::ZERO, at(from), at(to))
            .into_iter()
            .map(|(time, name)| (time.0 / 1_000_000_000, name))
            .collect()
    }

    #[test]
    fn what_is_due_comes_in_its_order_and_each_time_once() {
        let at = |s: i64| Time::ZERO + Duration::secs(s);
        let all = [
            schedule("bell", When::Every { first: at(10), period: Duration::secs(30) }),
            schedule("start", When::Once(at(40))),
            schedule("minute", When::Cron("* * * * *".parse().unwrap())),
        ];
        let pair = |time: i64, name: &str| (time, name.to_owned());
        let whole = seconds(&all, 0, 101);
        assert_eq!(
            whole,
            [
                pair(0, "minute"),
                pair(10, "bell"),
                pair(40, "bell"),
                pair(40, "start"),
                pair(60, "minute"),
                pair(70, "bell"),
                pair(100, "bell")
            ]
        );
        let parts: Vec<_> = (0..101).flat_map(|second| seconds(&all, second, second + 1)).collect();
        assert_eq!(parts, whole);
        assert_eq!(seconds(&all, 101, 101), []);
        assert_eq!(seconds(&all, 101, 0), []);
    }

    #[test]
    fn the_ends_of_time_are_times_too() {
        let hour = Duration::secs(3600);
        for first in [Time(i64::MIN), Time::ZERO, Time::NEVER] {
            let every = [schedule("every", When::Every { first, period: hour })];
            for (from, to) in [(Time::NEVER - hour, Time::NEVER), (Time(i64::MIN), Time(i64::MIN) + hour)] {
                assert!(due(&every, hour, from, to).len() <= 2);
            }
        }
        let daily = [schedule("daily", When::Cron("0 0 * * *".parse().unwrap()))];
        let day = Duration::secs(86_400);
        for epoch in [Duration(i64::MIN), Duration(i64::MAX)] {
            for (from, to) in [(Time::NEVER - day, Time::NEVER), (Time(i64::MIN), Time(i64::MIN) + day)] {
                assert_eq!(due(&daily, epoch, from, to).len(), 1);
            }
        }
    }
}
