//! A pattern as the colours that an agent looks for.

use types::value::{Row, Table, Value};

use crate::{Pattern, PatternKind};

/// Why a pattern is no range of colours.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoColour {
    /// It is a picture.
    #[error("it is a picture, not a range of colours")]
    Picture,
    /// One of its parameters is not what it must be.
    #[error("its \"{key}\" is {value}, not {wanted}")]
    Parameter {
        /// Which.
        key: String,
        /// What it is.
        value: String,
        /// What it must be.
        wanted: &'static str,
    },
}

/// The numbers of a range of colours, by the names that agents know them by. What the pattern does not say is not said.
///
/// | of the pattern | given as | meaning |
/// |---|---|---|
/// | `hue = [from, to]` (rad) | `hue_from`, `hue_to` (degrees, from 0 to 360) | the hues from the one up to the other, through 0 where `to` is the smaller |
/// | `hue_from`, `hue_to` (degrees) | the same | the same |
/// | `saturation` (0 to 1), or `[least, most]` | `saturation` | the least |
/// | `value` (0 to 1), or `[least, most]` | `value` | the least |
/// | any other number | the same | for who reads it |
///
/// ```
/// use knowledge::{Pattern, PatternKind, colours};
/// use types::value::{Table, Value};
///
/// let mut parameters = Table::new();
/// parameters.set("hue_from", Value::Float(350.0));
/// parameters.set("saturation", Value::Float(0.4));
/// let (kind, media_type, bytes) = (PatternKind::ColourRange, String::new(), Vec::new());
/// let ball = Pattern { name: "ball".into(), kind, media_type, bytes, parameters };
/// assert_eq!(Value::Table(colours(&ball).unwrap()).to_string(), "{ hue_from = 350.0, saturation = 0.4 }");
/// ```
///
/// # Errors
/// For a picture, and for a parameter that is none of these.
pub fn colours(pattern: &Pattern) -> Result<Table, NoColour> {
    if pattern.kind != PatternKind::ColourRange {
        return Err(NoColour::Picture);
    }
    let mut out = Table::new();
    for row in pattern.parameters.rows() {
        let wrong = |wanted| {
            let (key, value) = (row.key.clone(), row.entry.value.to_string());
            NoColour::Parameter { key, value, wanted }
        };
        match row.key.as_str() {
            "hue" => {
                let [from, to] = pair(row).ok_or_else(|| wrong("two angles, as in [5.9, 0.3] (rad)"))?;
                out.set("hue_from", Value::Float(degrees(from)));
                out.set("hue_to", Value::Float(degrees(to)));
            }
            key @ ("hue_from" | "hue_to") => {
                let angle = number(&row.entry.value).filter(|angle| (0.0..=360.0).contains(angle));
                out.set(key, Value::Float(angle.ok_or_else(|| wrong("a number from 0 to 360 (degrees)"))?));
            }
            key @ ("saturation" | "value") => {
                let least = number(&row.entry.value).or_else(|| pair(row).map(|[least, _]| least));
                let least = least.filter(|least| (0.0..=1.0).contains(least));
                let wanted = "a number from 0 to 1, or two, the least and the most";
                out.set(key, Value::Float(least.ok_or_else(|| wrong(wanted))?));
            }
            key => out.set(key, Value::Float(number(&row.entry.value).ok_or_else(|| wrong("a number"))?)),
        }
    }
    Ok(out)
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().filter(|number| number.is_finite())
}

fn pair(row: &Row) -> Option<[f64; 2]> {
    let [first, second] = row.entry.value.as_list()? else { return None };
    Some([number(&first.value)?, number(&second.value)?])
}

/// An angle (rad) as a hue (degrees, from 0 to 360).
fn degrees(angle: f64) -> f64 {
    // Where an angle is a whisker below zero, a whole turn more is 360 itself, which is a hue too.
    angle.to_degrees().rem_euclid(360.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(rows: &[(&str, Value)]) -> Result<Table, NoColour> {
        let mut parameters = Table::new();
        rows.iter().for_each(|(key, value)| parameters.set(key, value.clone()));
        let (kind, name) = (PatternKind::ColourRange, "ball".to_owned());
        colours(&Pattern { name, kind, media_type: String::new(), bytes: Vec::new(), parameters })
    }

    fn two(first: f64, second: f64) -> Value {
        Value::List(vec![Value::Float(first).into(), Value::Float(second).into()])
    }

    #[test]
    fn the_numbers_of_a_range_get_the_names_that_agents_know() {
        use core::f64::consts::PI;
        for (rows, said) in [
            (vec![("hue", two(PI, 1.5 * PI))], "{ hue_from = 180.0, hue_to = 270.0 }"),
            (vec![("hue", two(-0.5 * PI, 2.25 * PI))], "{ hue_from = 270.0, hue_to = 45.0 }"),
            (
                vec![("hue_from", Value::Int(350)), ("hue_to", Value::Float(10.5))],
                "{ hue_from = 350.0, hue_to = 10.5 }",
            ),
            (
                vec![
                    ("saturation", Value::Float(0.4)),
                    ("value", two(0.1, 0.9)),
                    ("share", Value::Float(0.02)),
                ],
                "{ saturation = 0.4, value = 0.1, share = 0.02 }",
            ),
        ] {
            assert_eq!(Value::Table(of(&rows).unwrap()).to_string(), said);
        }
    }

    #[test]
    fn what_is_no_range_is_refused_with_the_right_form() {
        for (key, value, said) in [
            ("hue", Value::Float(1.0), "its \"hue\" is 1.0, not two angles, as in [5.9, 0.3] (rad)"),
            ("hue", two(f64::NAN, 1.0), "its \"hue\" is [nan, 1.0], not two angles, as in [5.9, 0.3] (rad)"),
            ("hue_to", Value::Int(361), "its \"hue_to\" is 361, not a number from 0 to 360 (degrees)"),
            (
                "value",
                Value::from("dark"),
                "its \"value\" is \"dark\", not a number from 0 to 1, or two, the least and the most",
            ),
            ("side", Value::from("left"), "its \"side\" is \"left\", not a number"),
        ] {
            assert_eq!(of(&[(key, value)]).unwrap_err().to_string(), said);
        }
        let picture = Pattern {
            name: "door".into(),
            kind: PatternKind::Image,
            media_type: String::new(),
            bytes: vec![1],
            parameters: Table::new(),
        };
        assert_eq!(colours(&picture), Err(NoColour::Picture));
    }
}
