//! What the command line asks for.

use serde_json::{Value, json};

/// How a measurement is to be done.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Settings {
    /// How often; without it each measurement has its own number.
    pub(crate) iterations: Option<u64>,
    /// The processors of the first and the second thread; a thread without one runs where the system puts it.
    pub(crate) cpus: Vec<usize>,
    /// The time from one iteration to the next (ns).
    pub(crate) period: Option<u64>,
    /// The remainder of the times of iterations by the period (ns, monotonic clock); without it the first is a period away.
    pub(crate) phase: Option<u64>,
    /// The priority under SCHED_FIFO; without it threads are ordinary ones.
    pub(crate) fifo: Option<i32>,
}

impl Settings {
    /// Reads `--name value` pairs.
    pub(crate) fn read(words: &[&str]) -> Result<Settings, String> {
        let mut settings = Settings::default();
        for pair in words.chunks(2) {
            let &[name, value] = pair else { return Err(format!("{} needs a value", pair[0])) };
            match name {
                "--iterations" => settings.iterations = Some(number(name, value, 1..=100_000_000)?),
                "--period" => settings.period = Some(number(name, value, 1_000..=10_000_000_000)?),
                "--phase" => settings.phase = Some(number(name, value, 0..=10_000_000_000)?),
                "--fifo" => settings.fifo = Some(number(name, value, 1..=99)? as i32),
                "--cpu" => {
                    let cpus =
                        value.split(',').map(|cpu| number(name, cpu, 0..=1023).map(|cpu| cpu as usize));
                    settings.cpus = cpus.collect::<Result<_, _>>()?;
                    if settings.cpus.len() > 2 {
                        return Err("--cpu takes one processor or two".to_owned());
                    }
                }
                other => return Err(format!("there is no option {other}")),
            }
        }
        Ok(settings)
    }

    /// The processor of a thread: 0 the first, 1 the second.
    pub(crate) fn cpu(&self, thread: usize) -> Option<usize> {
        self.cpus.get(thread).copied()
    }

    /// How often, with the measurement's own number for those who do not say.
    pub(crate) fn iterations_or(&self, usual: u64) -> u64 {
        self.iterations.unwrap_or(usual)
    }

    /// When the first iteration is due at a period (ns, monotonic clock), a period from now or more.
    pub(crate) fn first(&self, now: u64, period: u64) -> u64 {
        self.phase.map_or(now + period, |phase| (now / period + 2) * period + phase % period)
    }

    pub(crate) fn to_json(&self) -> Value {
        json!({"iterations": self.iterations, "cpus": self.cpus, "period_ns": self.period, "phase_ns": self.phase, "fifo": self.fifo})
    }
}

fn number(name: &str, text: &str, range: std::ops::RangeInclusive<u64>) -> Result<u64, String> {
    let wrong =
        || format!("{name} is a whole number from {} to {}, not \"{text}\"", range.start(), range.end());
    text.parse().ok().filter(|number| range.contains(number)).ok_or_else(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_iteration_keeps_the_phase() {
        let at = |phase| Settings { phase, ..Settings::default() }.first(12_345, 1000);
        assert_eq!((at(None), at(Some(700)), at(Some(10)), at(Some(1200))), (13_345, 14_700, 14_010, 14_200));
    }

    #[test]
    fn options_are_read_and_wrong_ones_are_refused() {
        let read = Settings::read(&["--cpu", "0,1", "--fifo", "80", "--iterations", "5"]).unwrap();
        assert_eq!(
            read,
            Settings { iterations: Some(5), cpus: vec![0, 1], fifo: Some(80), ..Settings::default() }
        );
        for (words, expected) in [
            (&["--fifo", "100"][..], "from 1 to 99"),
            (&["--iterations"], "needs a value"),
            (&["--cpu", "0,1,2"], "one processor or two"),
            (&["--speed", "1"], "no option --speed"),
            (&["--period", "1ms"], "whole number"),
        ] {
            let refused = Settings::read(words).unwrap_err();
            assert!(refused.contains(expected), "{refused}");
        }
    }
}
