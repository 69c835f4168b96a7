//! A bare task set: rows of `[[task]]` with times as texts with a unit, or exact fractions of one.

use schedule::{Exact, Task, TaskSet, What};
use types::value::{Mistake, Span, Table, TableReader, nearest};

use crate::error::Failure;
use crate::file::{Mistakes, Sources, tree};

/// A task and what it is called.
#[derive(Clone, Debug)]
pub(super) struct Named {
    pub name: String,
    pub task: Task,
}

/// A set that was read.
#[derive(Clone, Debug)]
pub(super) struct Set {
    pub name: String,
    pub tasks: Vec<Named>,
}

/// Whether a file is a bare task set, and no system.
pub(super) fn is_set(text: &str) -> bool {
    text.lines()
        .any(|line| line.trim_start().starts_with("[[task]]") || line.trim_start().starts_with("task ="))
}

/// Reads a set; all mistakes at once.
pub(super) fn read(text: &str, file: &str) -> Result<Set, Failure> {
    let mut sources = Sources::default();
    let base = sources.add(file, text);
    let mut mistakes = Vec::new();
    let set = tree::read(&sources, base, &mut mistakes).map(|tree| rows(&tree, file, &mut mistakes));
    mistakes.sort_by_key(|mistake| mistake.at.start);
    match set {
        Some(set) if mistakes.is_empty() => Ok(set),
        _ => Err(Mistakes { sources, list: mistakes }.into()),
    }
}

fn rows(tree: &Table, file: &str, mistakes: &mut Vec<Mistake>) -> Set {
    let stem = std::path::Path::new(file).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    let mut r = TableReader::new(tree, Span::default(), "a task set");
    let name = r.text("name").map(str::to_owned).or(stem).unwrap_or_default();
    let tables = r.tables("task");
    r.finish(mistakes);
    let mut tasks: Vec<Named> = Vec::new();
    let mut places = Vec::new();
    for (place, (table, at)) in tables.into_iter().enumerate() {
        let mut r = TableReader::new(table, at, format!("task {}", place + 1));
        let name = r.text("name").map_or_else(|| format!("task{}", place + 1), str::to_owned);
        if tasks.iter().any(|other| other.name == name) {
            r.report(Mistake::new(r.place("name"), format!("there are two tasks \"{name}\"")));
        }
        let cost = required(&mut r, "wcet", "its execution time at worst, as in wcet = \"16.3us\"");
        let period = required(&mut r, "period", "the time between two jobs, as in period = \"5ms\"");
        let deadline = time(&mut r, "deadline");
        let jitter = time(&mut r, "jitter").unwrap_or_default();
        let blocking = time(&mut r, "blocking").unwrap_or_default();
        let processor = r.int("processor").and_then(|n| match usize::try_from(n).ok().filter(|n| *n < 64) {
            None => {
                r.report(Mistake::new(
                    r.place("processor"),
                    format!("\"processor\" is {n}, it must lie from 0 to 63"),
                ));
                None
            }
            known => known,
        });
        let spoils = ["wcet", "period", "deadline", "jitter", "blocking"].map(|key| (key, r.place(key)));
        r.finish(mistakes);
        let (Some(cost), Some(period)) = (cost, period) else { continue };
        places.push((at, spoils));
        tasks.push(Named { name, task: Task { cost, period, deadline, jitter, blocking, processor } });
    }
    if let Err(wrong) = TaskSet::new(tasks.iter().map(|named| named.task.clone()).collect()) {
        let stands_still =
            |task: usize| wrong.iter().any(|other| other.task == task && other.what == What::Period);
        for wrong in &wrong {
            // That a deadline is later than no time follows from the period.
            if wrong.what == What::LateDeadline && stands_still(wrong.task) {
                continue;
            }
            let (at, entries) = &places[wrong.task];
            let text = wrong.what.to_string();
            let key = match wrong.what {
                What::Period => "period",
                What::Cost => "wcet",
                What::Deadline | What::LateDeadline => "deadline",
                What::Jitter => "jitter",
                What::Blocking => "blocking",
                _ => "",
            };
            let entry = entries.iter().find(|(known, _)| *known == key);
            let what = format!("task \"{}\": {text}", tasks[wrong.task].name);
            let mistake = Mistake::new(entry.map_or(*at, |(_, at)| *at), what);
            mistakes.push(match wrong.what {
                What::LateDeadline => mistake.help("a job must be done before the next one arrives"),
                What::Period => mistake.help("as in period = \"5ms\""),
                _ => mistake,
            });
        }
    }
    Set { name, tasks }
}

fn required(r: &mut TableReader<'_>, key: &str, wanted: &str) -> Option<Exact> {
    r.required_text(key, wanted)?;
    time(r, key)
}

fn time(r: &mut TableReader<'_>, key: &str) -> Option<Exact> {
    let text = r.text(key)?;
    let found = exact_time(text);
    if let Err(help) = &found {
        let what = format!("\"{key}\" is \"{text}\", which is no time");
        r.report(Mistake::new(r.place(key), what).help(help.clone()));
    }
    found.ok()
}

const UNITS: [(&str, i128); 6] = [
    ("ns", 1),
    ("us", 1_000),
    ("ms", 1_000_000),
    ("s", 1_000_000_000),
    ("min", 60_000_000_000),
    ("h", 3_600_000_000_000),
];

/// A time in nanoseconds, exactly: `16.3us`, `8/15ms`, `1e-3s`.
fn exact_time(text: &str) -> Result<Exact, String> {
    let form = "a time is a number or a fraction and a unit, as in \"16.3us\" or \"8/15ms\"";
    let text = text.trim();
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic() || c == 'µ');
    let unit = text[digits.len()..].replace('µ', "u");
    let Some((_, scale)) = UNITS.iter().find(|(name, _)| *name == unit) else {
        let right =
            nearest(&unit, UNITS.map(|(name, _)| name)).map(|right| format!("did you mean \"{right}\"? "));
        return Err(format!("{}the units are ns, us, ms, s, min, h", right.unwrap_or_default()));
    };
    let (above, below) = digits.split_once('/').unwrap_or((digits, "1"));
    let (above, below) = (decimal(above).ok_or(form)?, decimal(below).ok_or(form)?);
    if below == Exact::from_integer(0) {
        return Err("it divides by zero".to_owned());
    }
    Ok(above / below * Exact::from_integer(*scale))
}

/// A decimal number, exactly; with an exponent where there is one.
fn decimal(text: &str) -> Option<Exact> {
    const MOST_DIGITS: usize = 15;
    let text = text.trim();
    let (number, power) = match text.split_once(['e', 'E']) {
        Some((number, power)) => (number, power.parse::<i32>().ok()?),
        None => (text, 0),
    };
    let (sign, number) = number.strip_prefix('-').map_or((1, number), |number| (-1, number));
    let (whole, part) = number.split_once('.').unwrap_or((number, ""));
    let digits = format!("{whole}{part}");
    let is_number =
        !digits.is_empty() && digits.len() <= MOST_DIGITS && digits.bytes().all(|c| c.is_ascii_digit());
    let power = power - part.len() as i32;
    if !is_number || !(-18..=18).contains(&power) {
        return None;
    }
    let ten = 10i128.pow(power.unsigned_abs());
    let digits = digits.parse::<i128>().ok()? * sign;
    Some(if power < 0 { Exact::new(digits, ten) } else { Exact::from_integer(digits * ten) })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_read_without_rounding() {
        let read = |text| exact_time(text).unwrap();
        assert_eq!(read("16.3us"), Exact::from_integer(16_300));
        assert_eq!(read("8/15ms"), Exact::new(8_000_000, 15));
        assert_eq!(read("0.1 ns"), Exact::new(1, 10));
        assert_eq!(read("1e-3s"), Exact::from_integer(1_000_000));
        assert_eq!(read("89.28µs"), Exact::from_integer(89_280));
        assert_eq!(read("-5ms"), Exact::from_integer(-5_000_000));
        for wrong in [
            "",
            "5",
            "ms",
            "1/0ms",
            "5 parsecs",
            "1.2.3s",
            "0x5s",
            "1e99s",
            "nans",
            "/3s",
            "12345678901234567s",
        ] {
            assert!(exact_time(wrong).is_err(), "{wrong}");
        }
        assert!(exact_time("5 mS").unwrap_err().contains("\"ms\""));
    }

    #[test]
    fn all_mistakes_are_told_at_once_with_their_places() {
        let text = "[[task]]\nname = \"a\"\nwcet = \"1ms\"\nperiod = \"0s\"\n\n[[task]]\nname = \"b\"\nwcet = \"2 parsecs\"\nperiodd = \"3ms\"\n\n\
            [[task]]\nname = \"a\"\nwcet = \"1ms\"\nperiod = \"4ms\"\ndeadline = \"5ms\"\nprocessor = 64\n";
        let failure = read(text, "set.toml").unwrap_err();
        let told: Vec<(usize, String)> =
            failure.problems.iter().map(|it| (it.place.as_ref().unwrap().line, it.what.clone())).collect();
        let lines: Vec<usize> = told.iter().map(|(line, _)| *line).collect();
        assert_eq!(lines, [4, 6, 8, 9, 12, 15, 16], "{told:#?}");
        let late = failure.problems.iter().find(|it| it.what.contains("deadline")).unwrap();
        assert!(late.place.as_ref().unwrap().text.starts_with("deadline") && late.help.is_some(), "{late:?}");
    }

    #[test]
    fn a_set_is_told_from_a_system() {
        assert!(is_set("# x\n[[task]]\nwcet = \"1ms\""));
        assert!(!is_set("name = \"a\"\n[agent.task]\nis = \"sonar\""));
    }
}
