//! Conditions: read once when the table is, and judged in every step without taking memory.
//!
//! ```text
//!  "battery < 0.2 && !blind" ──syn──▶ tree with places ──check──▶ [battery 0.2 < blind ! &&] ──values──▶ yes or no
//! ```
//!
//! The grammar is that of Rust's expressions, of which numbers, signals, `+ - * /`, comparisons, `&& || !`, brackets, `min(a, b)`,
//! `max(a, b)`, `abs(a)` and `known(signal)` have a meaning here. What is unknown is NaN: arithmetic hands it on, and a comparison with
//! it is false.

mod compile;
mod look;
mod words;

use types::value::{Mistake, Span};

pub(super) use compile::compile;
pub(super) use words::Words;

use super::signal::{Values, is_true, of_truth};

/// How many values wait at most while a condition is judged, and how many brackets stand in each other.
const DEEPEST: usize = 16;
const EXAMPLE: &str = "it reads as in battery < 0.2 && !blind";

fn too_deep(at: Span) -> Mistake {
    Mistake::new(at, "the condition is too deep").help(format!("{DEEPEST} brackets in each other have room"))
}

/// A condition, as steps on a pile of numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Condition(Box<[Op]>);

/// A step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Op {
    Number(f64),
    Signal(usize),
    Known(usize),
    One(One),
    Two(Two),
}

/// With what lies on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum One {
    Minus,
    Abs,
    Not,
}

/// With the two that lie on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Two {
    Add,
    Subtract,
    Multiply,
    Divide,
    Min,
    Max,
    Less,
    LessOrEqual,
    Greater,
    GreaterOrEqual,
    Equal,
    Unequal,
    And,
    Or,
}

impl Condition {
    /// Whether it is met.
    pub(super) fn holds(&self, values: &Values) -> bool {
        let mut pile = [0.0; DEEPEST];
        let mut height = 0;
        for op in &self.0 {
            let value = match *op {
                Op::Number(number) => number,
                Op::Signal(place) => values.at(place),
                Op::Known(place) => of_truth(!values.at(place).is_nan()),
                Op::One(one) => {
                    height -= 1;
                    one.of(pile[height])
                }
                Op::Two(two) => {
                    height -= 2;
                    two.of(pile[height], pile[height + 1])
                }
            };
            pile[height] = value;
            height += 1;
        }
        is_true(pile[0])
    }
}

impl One {
    fn of(self, a: f64) -> f64 {
        match self {
            One::Minus => -a,
            One::Abs => a.abs(),
            One::Not => of_truth(!is_true(a)),
        }
    }
}

impl Two {
    fn of(self, a: f64, b: f64) -> f64 {
        match self {
            Two::Add => a + b,
            Two::Subtract => a - b,
            Two::Multiply => a * b,
            Two::Divide => a / b,
            // Other than `f64::min` and `!=` have it, nothing is known of these where one is not.
            Two::Min | Two::Max | Two::Unequal if a.is_nan() || b.is_nan() => f64::NAN,
            Two::Min => a.min(b),
            Two::Max => a.max(b),
            Two::Less => of_truth(a < b),
            Two::LessOrEqual => of_truth(a <= b),
            Two::Greater => of_truth(a > b),
            Two::GreaterOrEqual => of_truth(a >= b),
            Two::Equal => of_truth(a == b),
            Two::Unequal => of_truth(a != b),
            Two::And => of_truth(is_true(a) && is_true(b)),
            Two::Or => of_truth(is_true(a) || is_true(b)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::signal::Known;
    use super::*;

    /// What is said of a condition: each mistake with the part of the text that it points at.
    fn said(text: &str) -> Vec<String> {
        let declared = ["faces".to_owned()];
        let place = |at: types::value::Span| &text[at.start as usize..at.end as usize];
        let mistakes = compile(text, &mut Words::new(Some(&declared))).err().unwrap_or_default();
        mistakes.iter().map(|mistake| format!("{} ← {mistake}", place(mistake.at))).collect()
    }

    fn holds(text: &str, values: &[(Known, f64)]) -> bool {
        let mut known = Values::UNKNOWN;
        values.iter().for_each(|(signal, value)| known.put(*signal as usize, *value));
        compile(text, &mut Words::new(None)).unwrap_or_else(|wrong| panic!("{text}: {wrong:?}")).holds(&known)
    }

    #[test]
    fn a_condition_is_worked_out_as_it_is_on_paper() {
        let known = [(Known::Battery, 0.15), (Known::Speed, -0.5), (Known::Load, 0.75), (Known::Blind, 0.0)];
        for (text, wanted) in [
            ("battery < 0.2", true),
            ("battery > 0.2 || speed == -0.5", true),
            ("1 + 2 * 3 - 4 / 2 == 5", true),
            ("(1 + 2) * 3 == 9 && 7 - 2 - 1 == 4 && 8 / 4 / 2 == 1", true),
            ("false && false || true", true),
            ("!(true || false) || !!false", false),
            ("min(load, 0.5) == 0.5 && max(load, 0.5) == 0.75 && abs(speed) == 0.5", true),
            ("!blind && -speed >= 0.5", true),
            ("load != 0.75", false),
            ("load <= 0.75 && 1e-3 < battery", true),
        ] {
            assert_eq!(holds(text, &known), wanted, "{text}");
        }
    }

    #[test]
    fn what_is_unknown_meets_no_comparison() {
        for text in [
            "battery < 0.2",
            "battery >= 0.2",
            "battery == battery",
            "battery != 0.5",
            "min(battery, 0.1) < 0.2",
            "max(1, battery) > 0.5",
            "battery * 0 == 0",
            "0 / 0 == 0 / 0",
            "blind",
            "known(battery)",
        ] {
            assert!(!holds(text, &[]), "{text}");
        }
        assert!(holds("!known(battery) && !(battery < 0.2) && !blind", &[]));
        assert!(holds("known(battery)", &[(Known::Battery, 0.0)]));
    }

    #[test]
    fn a_name_that_agents_tell_has_a_place_of_its_own() {
        let mut words = Words::new(None);
        let condition = compile("faces > 1 && doors > faces", &mut words).unwrap();
        let mut values = Values::UNKNOWN;
        values.put(Values::place_of_told(0), 2.0);
        assert!(!condition.holds(&values));
        values.put(Values::place_of_told(1), 3.0);
        assert!(condition.holds(&values));
    }

    #[test]
    fn what_cannot_be_is_told_with_its_place() {
        for (text, wanted) in [
            ("batery < 0.2", "batery ← there is no signal \"batery\"; did you mean \"battery\"?"),
            ("facs > 1", "facs ← there is no signal \"facs\"; did you mean \"faces\"?"),
            (
                "battery + 1",
                "battery + 1 ← this is a number, not a condition; compare it, as in battery < 0.2",
            ),
            (
                "speed > 1 && load",
                "load ← this is a number, not a condition; compare it, as in battery < 0.2",
            ),
            ("blind + 1 > 0", "blind ← this is a condition, not a number"),
            ("!speed", "speed ← this is a number, not a condition; compare it, as in battery < 0.2"),
            (
                "0.1 < battery < 0.2",
                "0.1 < battery < 0.2 ← comparisons do not follow each other; write a < b && b < c",
            ),
            (
                "battery < ",
                "battery <  ← the condition ends too early; it reads as in battery < 0.2 && !blind",
            ),
            ("battery < 0.2)", ") ← this bracket closes none"),
            ("(battery < 0.2", "( ← this bracket is not closed"),
            ("battery = 0.2", "= ← \"=\" does not compare; write =="),
            ("battery < 0.2 and blind", "and ← \"and\" is no word here; write &&"),
            ("battery < 0.2 & blind", "0.2 & blind ← there is no such operator; did you mean \"&&\"?"),
            ("danger.near", "danger.near ← this means nothing in a condition; names of signals have no dots"),
            (
                "tangent(speed) > 0",
                "tangent ← there is no function \"tangent\"; it can be: min, max, abs, known",
            ),
            ("mn(speed, 1) > 0", "mn ← there is no function \"mn\"; did you mean \"min\"?"),
            ("min(speed) > 0", "min(speed) ← min takes 2 values, not 1"),
            ("known(1 + 1)", "1 + 1 ← known takes the name of a signal"),
            ("battery < 20%", "% ← \"%\" means nothing in a condition"),
            ("battery < 0.2f32", "0.2f32 ← a number has no letters behind it"),
            ("", " ← the condition is empty; it reads as in battery < 0.2 && !blind"),
        ] {
            assert_eq!(said(text), [wanted], "{text}");
        }
        let both = said("batery < 0.2 || spead > 1");
        assert_eq!(both.len(), 2, "{both:?}");
    }

    #[test]
    fn what_is_too_deep_or_too_long_is_refused() {
        let deep = |n: usize| format!("{}blind{}", "(".repeat(n), ")".repeat(n));
        assert_eq!(said(&deep(DEEPEST)), [""; 0]);
        assert!(said(&deep(DEEPEST + 1))[0].contains("too deep"), "{:?}", said(&deep(DEEPEST + 1)));
        let leaning = |n: usize| (1..n).fold("1".to_owned(), |inner, _| format!("1-{inner}"));
        assert_eq!(said(&format!("{} > 0", leaning(40))), [""; 0], "one after the other is not deep");
        // Each of these waits for the one behind it.
        let nested = |n: usize| (1..n).fold("1".to_owned(), |inner, _| format!("1-({inner})")) + " > 0";
        assert_eq!(said(&nested(DEEPEST)), [""; 0]);
        assert!(said(&nested(DEEPEST + 2))[0].contains("too deep"));
        assert!(said(&"!".repeat(1000))[0].contains("too long"));
        assert_eq!(said(&format!("{}blind", "!".repeat(200))), [""; 0]);
    }
}
