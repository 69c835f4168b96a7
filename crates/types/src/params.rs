//! Parameters: named, documented settings that a file gives and a running system can change.

use alloc::format;
use alloc::string::{String, ToString};
use alloc::vec::Vec;
use core::fmt;

use crate::text::Text;
use crate::time::Duration;
use crate::value::{Entry, Mistake, Table, Value, nearest};

pub use macros::Params;

/// What is known of a parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamField {
    /// Its key in a file.
    pub name: &'static str,
    /// What it is, with its unit.
    pub doc: &'static str,
    /// The kind of its values.
    pub kind: &'static str,
    /// What it is when nobody says.
    pub default: Value,
    /// The least that it may be.
    pub min: Option<f64>,
    /// The most that it may be.
    pub max: Option<f64>,
    /// The words of which it is one; none where any text will do, and for all that is no text.
    pub words: &'static [&'static str],
}

/// What is known of all parameters of an agent.
pub type Fields = Vec<ParamField>;

/// What is wrong with parameters as a whole.
pub type Mistakes = Vec<Mistake>;

/// Why a value was not taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refused(pub String);

impl fmt::Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for Refused {}

/// A documented set of parameters; `#[derive(Params)]` writes it for a struct.
///
/// ```
/// use types::{params::Params, value::Value};
///
/// /// How a wall is followed.
/// #[derive(Clone, Debug, Params)]
/// pub struct Following {
///     /// Distance to keep to the wall (m): a robot of half a metre passes a door of 0.9 m with it.
///     #[param(default = 0.45, min = 0.1, max = 2.0)]
///     pub keep: f64,
/// }
/// let mut following = Following::default();
/// assert_eq!(following.set("keep", &Value::Float(0.6)), Some(Ok(())));
/// let refused = following.set("keep", &Value::Float(6.0)).unwrap().unwrap_err();
/// assert_eq!(refused.to_string(), "must lie from 0.1 to 2, not 6");
/// assert_eq!(following.set("kep", &Value::Float(0.6)), None);
/// ```
///
/// A text that takes one of a few words names them:
///
/// ```
/// use types::{Text, params::Params, value::Value};
///
/// /// On which side.
/// #[derive(Clone, Debug, Params)]
/// pub struct Along {
///     /// The side of the wall.
///     #[param(default = "left", words = ["left", "right"])]
///     pub side: Text<8>,
/// }
/// let refused = Along::default().set("side", &Value::from("top")).unwrap().unwrap_err();
/// assert_eq!(refused.to_string(), "must be \"left\" or \"right\", not \"top\"");
/// ```
pub trait Params: Default + Clone + Send + 'static {
    /// What is known of each.
    fn fields() -> Fields;

    /// Sets the parameter named `key`; nothing when there is none of that name.
    fn set(&mut self, key: &str, value: &Value) -> Option<Result<(), Refused>>;

    /// The value of the parameter named `key`.
    fn get(&self, key: &str) -> Option<Value>;

    /// What is wrong with the whole that was read from `table`: what no value can tell by itself, each with its place.
    /// `#[params(check = path)]` on a struct names the function that says it.
    fn check(&self, table: &Table) -> Mistakes {
        let _ = table;
        Mistakes::new()
    }

    /// The defaults, changed by the rows of `table`; all mistakes at once, unknown keys with the nearest right one.
    fn read(table: &Table, owner: &str) -> Result<Self, Vec<Mistake>> {
        let mut params = Self::default();
        let mut mistakes = Vec::new();
        for row in table.rows() {
            match params.set(&row.key, &row.entry.value) {
                Some(Ok(())) => {}
                Some(Err(refused)) => {
                    let mistake = Mistake::new(row.entry.at, format!("\"{}\" {refused}", row.key));
                    mistakes.push(match meant::<Self>(&row.key, &row.entry.value) {
                        Some(word) => mistake.help(format!("did you mean \"{word}\"?")),
                        None => mistake,
                    });
                }
                None => {
                    let fields = Self::fields();
                    let known = fields.iter().map(|field| field.name);
                    mistakes.push(Mistake::unknown(
                        row.key_at,
                        &format!("parameter of {owner}"),
                        &row.key,
                        known,
                    ));
                }
            }
        }
        mistakes.extend(params.check(table));
        if mistakes.is_empty() { Ok(params) } else { Err(mistakes) }
    }

    /// All values, as a file would give them.
    fn to_table(&self) -> Table {
        let mut table = Table::new();
        for field in Self::fields() {
            if let Some(value) = self.get(field.name) {
                table.set(field.name, value);
            }
        }
        table
    }
}

/// The word that was meant, of a parameter that takes one of a few.
fn meant<P: Params>(key: &str, value: &Value) -> Option<&'static str> {
    let field = P::fields().into_iter().find(|field| field.name == key)?;
    nearest(value.as_text()?, field.words.iter().copied())
}

/// A type that a parameter can have.
pub trait ParamValue: Sized {
    /// What it is called in messages, with its article.
    const KIND: &'static str;
    /// Takes a value of a file.
    fn from_value(value: &Value) -> Option<Self>;
    /// Gives the value for a file.
    fn to_value(&self) -> Value;
    /// The number that a range is checked against.
    fn magnitude(&self) -> Option<f64> {
        None
    }
}

/// Sets `place` to `value` where kind and range allow it. Written into each set of parameters by its derive.
pub fn assign<T: ParamValue>(
    place: &mut T,
    value: &Value,
    min: Option<f64>,
    max: Option<f64>,
) -> Result<(), Refused> {
    let new = T::from_value(value)
        .ok_or_else(|| Refused(format!("must be {}, not {} ({value})", T::KIND, value.kind())))?;
    if let Some(x) = new.magnitude() {
        let (low, high) = (min.is_some_and(|min| x < min), max.is_some_and(|max| x > max));
        if low || high || x.is_nan() {
            let range = match (min, max) {
                (Some(min), Some(max)) => format!("lie from {min} to {max}"),
                (Some(min), None) => format!("be at least {min}"),
                (None, Some(max)) => format!("be at most {max}"),
                (None, None) => "be a number".to_string(),
            };
            return Err(Refused(format!("must {range}, not {x}")));
        }
    }
    *place = new;
    Ok(())
}

/// Sets `place` to `value` where that is one of the words. Written into each set of parameters by its derive.
pub fn assign_word<T: ParamValue>(place: &mut T, value: &Value, words: &[&str]) -> Result<(), Refused> {
    let unknown = value.as_text().filter(|word| !words.contains(word));
    if let Some(word) = unknown {
        let words: Vec<String> = words.iter().map(|word| format!("\"{word}\"")).collect();
        let known = match words.split_last() {
            Some((last, [])) => last.clone(),
            Some((last, before)) => format!("{} or {last}", before.join(", ")),
            None => String::new(),
        };
        return Err(Refused(format!("must be {known}, not \"{word}\"")));
    }
    assign(place, value, None, None)
}

impl ParamValue for f64 {
    const KIND: &'static str = "a number";
    fn from_value(value: &Value) -> Option<f64> {
        value.as_float()
    }
    fn to_value(&self) -> Value {
        Value::Float(*self)
    }
    fn magnitude(&self) -> Option<f64> {
        Some(*self)
    }
}

macro_rules! whole {
    ($($t:ty),*) => { $(
        impl ParamValue for $t {
            const KIND: &'static str = "a whole number";
            fn from_value(value: &Value) -> Option<$t> {
                if let Value::Int(n) = value { <$t>::try_from(*n).ok() } else { None }
            }
            fn to_value(&self) -> Value {
                Value::Int(i64::try_from(*self).unwrap_or(i64::MAX))
            }
            fn magnitude(&self) -> Option<f64> {
                Some(*self as f64)
            }
        }
    )* };
}

whole! { u8, u16, u32, u64, usize, i32, i64 }

impl ParamValue for bool {
    const KIND: &'static str = "true or false";
    fn from_value(value: &Value) -> Option<bool> {
        if let Value::Bool(b) = value { Some(*b) } else { None }
    }
    fn to_value(&self) -> Value {
        Value::Bool(*self)
    }
}

impl ParamValue for Duration {
    const KIND: &'static str = "a time such as \"250ms\"";
    fn from_value(value: &Value) -> Option<Duration> {
        value.as_text()?.parse().ok()
    }
    fn to_value(&self) -> Value {
        Value::Text(self.to_string())
    }
    fn magnitude(&self) -> Option<f64> {
        Some(self.seconds())
    }
}

impl ParamValue for String {
    const KIND: &'static str = "a text";
    fn from_value(value: &Value) -> Option<String> {
        value.as_text().map(String::from)
    }
    fn to_value(&self) -> Value {
        Value::Text(self.clone())
    }
}

impl<const N: usize> ParamValue for Text<N> {
    const KIND: &'static str = "a short text";
    fn from_value(value: &Value) -> Option<Text<N>> {
        value.as_text().filter(|text| text.len() <= N).map(Text::new)
    }
    fn to_value(&self) -> Value {
        Value::Text(self.as_str().into())
    }
}

impl<T: ParamValue> ParamValue for Vec<T> {
    const KIND: &'static str = "a list";
    fn from_value(value: &Value) -> Option<Vec<T>> {
        value.as_list()?.iter().map(|entry| T::from_value(&entry.value)).collect()
    }
    fn to_value(&self) -> Value {
        Value::List(self.iter().map(|item| Entry::from(item.to_value())).collect())
    }
}

/// A free-form table, for an agent that reads it by itself.
impl ParamValue for Table {
    const KIND: &'static str = "a table";
    fn from_value(value: &Value) -> Option<Table> {
        value.as_table().cloned()
    }
    fn to_value(&self) -> Value {
        Value::Table(self.clone())
    }
}
