//! The form of a message as its definition gives it: read from the text of a `.msg` file or taken from a [`Definition`].

use std::cell::Cell;
use std::collections::{BTreeMap, BTreeSet};

use types::definition::{self, Definition};

/// More fields than any message has, so that a text from elsewhere cannot fill the memory by using types twice over and over.
const MOST_FIELDS: usize = 20_000;

/// The form of a message: its name and its fields in order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Schema {
    /// Its full name, as in `geometry_msgs/msg/Twist`.
    pub name: String,
    /// Its fields in order.
    pub fields: Vec<Field>,
    /// Its constants in order; they are no part of the bytes.
    pub constants: Vec<Constant>,
}

/// A named field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: Kind,
    /// Whether it is no number (NaN) where nothing is said of it, and not zero. Texts do not tell that, only our own definitions.
    pub or_nan: bool,
}

/// A named number or text that a definition gives to its readers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Constant {
    /// Its name.
    pub name: String,
    /// Its type.
    pub kind: Kind,
    /// Its value as written.
    pub value: String,
}

/// The type of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `bool`
    Bool,
    /// A whole number of so many bytes (1, 2, 4, 8), with a sign or without. `byte` and `char` are `uint8`.
    Integer {
        /// Its size.
        bytes: u8,
        /// Whether it may be negative.
        signed: bool,
    },
    /// `float32`
    F32,
    /// `float64`
    F64,
    /// `string`, of at most so many bytes where it is bounded.
    String(Option<usize>),
    /// Another message.
    Struct(Schema),
    /// A fixed number of values.
    Array(Box<Kind>, usize),
    /// A counted row of values, of at most so many where it is bounded.
    Sequence(Box<Kind>, Option<usize>),
}

/// Why a text is no definition of a message.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ParseError {
    /// A line is neither a field nor a constant.
    #[error("line {line} (\"{text}\") is no field of a message: it needs a type and a name")]
    NoField {
        /// Number of the line, from 1.
        line: usize,
        /// The line.
        text: String,
    },
    /// A field has a type that is not defined in the text.
    #[error(
        "the type \"{0}\" is not defined: a schema gives every message that it uses, behind a line of \"=\" and \"MSG: name\""
    )]
    NoSuchType(String),
    /// A type uses itself, so it has no size.
    #[error("the type \"{0}\" contains itself")]
    Endless(String),
    /// The definition is larger than any that people write.
    #[error(
        "the definition has more than {MOST_FIELDS} fields, those of all its parts counted each time they are used"
    )]
    TooLarge,
    /// Two fields of a message have one name, so one of them could not be told.
    #[error("two fields of a message are called \"{0}\"")]
    Twice(String),
    /// The encoding of wide strings is not supported, because programs do not agree about it.
    #[error("the field \"{0}\" is a wstring, which is not supported")]
    WideString(String),
}

impl Schema {
    /// Reads a `ros2msg` schema: the lines of the message `name`, then of each message that it uses, as
    /// [`Definition::text`] writes it and as ROS 2 records it. Comments, constants and default values may stand in it.
    pub fn parse(name: &str, text: &str) -> Result<Schema, ParseError> {
        let name = full_name(name, "");
        let mut parts: BTreeMap<String, Vec<(usize, &str)>> = BTreeMap::new();
        let mut part = name.clone();
        for (index, line) in text.lines().enumerate() {
            let line = without_comment(line).trim();
            if line.len() >= 3 && line.bytes().all(|byte| byte == b'=') {
                continue;
            }
            if let Some(other) = line.strip_prefix("MSG:") {
                part = full_name(other.trim(), "");
                parts.entry(part.clone()).or_default();
            } else if !line.is_empty() {
                parts.entry(part.clone()).or_default().push((index + 1, line));
            }
        }
        // A message without fields leaves no line behind.
        parts.entry(name.clone()).or_default();
        Parts { parts, fields: Cell::new(0) }.schema(&name, &mut Vec::new())
    }
}

/// The lines of each message of a text.
struct Parts<'a> {
    parts: BTreeMap<String, Vec<(usize, &'a str)>>,
    /// How many fields were read so far.
    fields: Cell<usize>,
}

impl Parts<'_> {
    /// The message `name`; `inside` are the messages that are being read around it.
    fn schema(&self, name: &str, inside: &mut Vec<String>) -> Result<Schema, ParseError> {
        if inside.iter().any(|outer| outer == name) {
            return Err(ParseError::Endless(name.to_owned()));
        }
        let lines = self.parts.get(name).ok_or_else(|| ParseError::NoSuchType(name.to_owned()))?;
        inside.push(name.to_owned());
        let mut schema = Schema { name: name.to_owned(), fields: Vec::new(), constants: Vec::new() };
        let mut taken = BTreeSet::new();
        for (line, text) in lines {
            self.fields.set(self.fields.get() + 1);
            if self.fields.get() > MOST_FIELDS || inside.len() > 64 {
                return Err(ParseError::TooLarge);
            }
            let wrong = || ParseError::NoField { line: *line, text: (*text).to_owned() };
            let (of, rest) = text.split_once(char::is_whitespace).ok_or_else(wrong)?;
            let rest = rest.trim();
            // `int32 X=1` is a constant; an "=" behind a blank belongs to a default value or to a bound before it.
            if let Some((constant, value)) = rest.split_once('=')
                && is_identifier(constant.trim())
            {
                let kind = self.kind(of, name, constant, inside)?;
                let value = value.trim().to_owned();
                schema.constants.push(Constant { name: constant.trim().to_owned(), kind, value });
                continue;
            }
            let field = rest
                .split(char::is_whitespace)
                .next()
                .filter(|field| is_identifier(field))
                .ok_or_else(wrong)?;
            if !taken.insert(field) {
                return Err(ParseError::Twice(field.to_owned()));
            }
            let kind = self.kind(of, name, field, inside)?;
            schema.fields.push(Field { name: field.to_owned(), kind, or_nan: false });
        }
        inside.pop();
        Ok(schema)
    }

    /// The type that `text` names in a field of the message `of`.
    fn kind(&self, text: &str, of: &str, field: &str, inside: &mut Vec<String>) -> Result<Kind, ParseError> {
        let bad = || ParseError::NoSuchType(text.to_owned());
        if let Some(open) = text.rfind('[') {
            let length = text[open + 1..].strip_suffix(']').ok_or_else(bad)?;
            let element = &text[..open];
            // ROS has no rows of rows.
            let element =
                if element.ends_with(']') { Err(bad()) } else { self.kind(element, of, field, inside) };
            let element = Box::new(element?);
            return match (length, length.strip_prefix("<=")) {
                ("", _) => Ok(Kind::Sequence(element, None)),
                (_, Some(most)) => Ok(Kind::Sequence(element, Some(most.parse().map_err(|_| bad())?))),
                // A row of none has no bytes, so a row of such rows could be of any length and nothing would end it.
                (exactly, None) => match exactly.parse().map_err(|_| bad())? {
                    0 => Err(bad()),
                    n => Ok(Kind::Array(element, n)),
                },
            };
        }
        let (base, bound) = match text.split_once("<=") {
            Some((base, bound)) => (base, Some(bound.parse().map_err(|_| bad())?)),
            None => (text, None),
        };
        let integer = |bytes, signed| Ok(Kind::Integer { bytes, signed });
        match base {
            "bool" => Ok(Kind::Bool),
            "int8" => integer(1, true),
            "uint8" | "byte" | "char" => integer(1, false),
            "int16" => integer(2, true),
            "uint16" => integer(2, false),
            "int32" => integer(4, true),
            "uint32" => integer(4, false),
            "int64" => integer(8, true),
            "uint64" => integer(8, false),
            "float32" => Ok(Kind::F32),
            "float64" => Ok(Kind::F64),
            "string" => Ok(Kind::String(bound)),
            "wstring" => Err(ParseError::WideString(field.to_owned())),
            other => Ok(Kind::Struct(self.schema(&full_name(other, of), inside)?)),
        }
    }
}

/// The line up to a `#` that does not stand in quotes.
fn without_comment(line: &str) -> &str {
    let mut quote = None;
    for (at, c) in line.char_indices() {
        match (c, quote) {
            ('#', None) => return &line[..at],
            ('"' | '\'', None) => quote = Some(c),
            (c, Some(open)) if c == open => quote = None,
            _ => {}
        }
    }
    line
}

fn is_identifier(text: &str) -> bool {
    text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
        && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// `package/msg/Type` for any of the ways to write it; a bare `Type` is of the package of `beside`.
fn full_name(name: &str, beside: &str) -> String {
    let parts: Vec<&str> = name.split('/').collect();
    match parts[..] {
        ["Header"] => "std_msgs/msg/Header".to_owned(),
        [bare] => match beside.split_once('/') {
            Some((package, _)) => format!("{package}/msg/{bare}"),
            None => bare.to_owned(),
        },
        [package, bare] => format!("{package}/msg/{bare}"),
        _ => name.to_owned(),
    }
}

impl From<&Definition> for Schema {
    fn from(definition: &Definition) -> Schema {
        let field = |field: &definition::Field| Field {
            name: field.name.to_owned(),
            kind: Kind::from(&field.kind),
            or_nan: field.or_nan,
        };
        let constant = |(name, value): &(&str, u8)| Constant {
            name: (*name).to_owned(),
            kind: Kind::Integer { bytes: 1, signed: false },
            value: value.to_string(),
        };
        let fields = definition.fields.iter().map(field).collect();
        let constants = definition.constants.iter().map(constant).collect();
        Schema { name: definition.name.to_owned(), fields, constants }
    }
}

impl From<&definition::Kind> for Kind {
    fn from(kind: &definition::Kind) -> Kind {
        use definition::Kind as Of;
        let integer = |bytes, signed| Kind::Integer { bytes, signed };
        match kind {
            Of::Bool => Kind::Bool,
            Of::I8 => integer(1, true),
            Of::U8 => integer(1, false),
            Of::I16 => integer(2, true),
            Of::U16 => integer(2, false),
            Of::I32 => integer(4, true),
            Of::U32 => integer(4, false),
            Of::I64 => integer(8, true),
            Of::U64 => integer(8, false),
            Of::F32 => Kind::F32,
            Of::F64 => Kind::F64,
            Of::String => Kind::String(None),
            Of::Struct(definition) => Kind::Struct(Schema::from(definition)),
            Of::Array(of, n) => Kind::Array(Box::new(Kind::from(&**of)), *n),
            Of::Sequence(of) => Kind::Sequence(Box::new(Kind::from(&**of)), None),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use types::message::describe;
    use types::messages;

    #[test]
    fn a_definition_and_its_own_text_are_the_same_form() {
        let definitions = [
            describe::<messages::Twist>(),
            describe::<messages::LaserScan>(),
            describe::<messages::Image>(),
            describe::<messages::Odometry>(),
            describe::<messages::Transforms>(),
            describe::<messages::Gyro>(),
            describe::<messages::Battery>(),
            describe::<messages::Echoes>(),
            describe::<messages::Decision>(),
            describe::<messages::Offer>(),
            describe::<messages::WheelTicks>(),
            describe::<messages::Landmarks>(),
            describe::<messages::Report>(),
        ];
        for definition in definitions {
            let read = Schema::parse(definition.name, &definition.text());
            assert_eq!(read, Ok(Schema::from(&definition)), "{}", definition.name);
        }
    }

    #[test]
    fn a_text_as_people_write_it_is_read() {
        // Pieces of sensor_msgs/BatteryState, diagnostic_msgs and the interface definition page of ROS 2.
        let text = "# The state\nuint8 UNKNOWN = 0 # a constant\nstring GREETING=\"a # is no comment here\"\n\
                    Header header\nfloat32   voltage  # (V)\n\nint32[<=5] few\nstring<=10[3] names\nint16 level -3\nPart part\n\
                    ================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id \"map\"\n\
                    ================\nMSG: builtin_interfaces/msg/Time\nint32 sec\nuint32 nanosec\n\
                    ================\nMSG: my_msgs/Part\nbyte x\n";
        let schema = Schema::parse("my_msgs/msg/State", text).unwrap();
        let names: Vec<&str> = schema.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["header", "voltage", "few", "names", "level", "part"]);
        assert_eq!(
            schema.fields[2].kind,
            Kind::Sequence(Box::new(Kind::Integer { bytes: 4, signed: true }), Some(5))
        );
        assert_eq!(schema.fields[3].kind, Kind::Array(Box::new(Kind::String(Some(10))), 3));
        assert!(matches!(&schema.fields[5].kind, Kind::Struct(part) if part.name == "my_msgs/msg/Part"));
        assert_eq!(schema.constants[0].value, "0");
        assert_eq!(schema.constants[1].value, "\"a # is no comment here\"");
    }

    #[test]
    fn what_is_no_definition_is_refused_with_the_reason() {
        let parse = |text: &str| Schema::parse("a/msg/A", text).unwrap_err();
        assert_eq!(parse("int32\n"), ParseError::NoField { line: 1, text: "int32".into() });
        assert_eq!(parse("Nowhere x\n"), ParseError::NoSuchType("a/msg/Nowhere".into()));
        assert_eq!(parse("bool on\nint8 on\n"), ParseError::Twice("on".into()));
        assert_eq!(parse("A again\n"), ParseError::Endless("a/msg/A".into()));
        assert_eq!(parse("wstring x\n"), ParseError::WideString("x".into()));
        assert_eq!(parse("int32[2][2] x\n"), ParseError::NoSuchType("int32[2][2]".into()));
        let doubled: String =
            (0..40).map(|i| format!("===\nMSG: a/T{i}\nT{} x\nT{} y\n", i + 1, i + 1)).collect();
        assert_eq!(parse(&format!("T0 x\n{doubled}===\nMSG: a/T40\nbool x\n")), ParseError::TooLarge);
        assert_eq!(parse("int32[x] x\n"), ParseError::NoSuchType("int32[x]".into()));
        let many_times_nothing = "None[4000000000] rows\n===\nMSG: a/None\nint8[0] nothing\n";
        assert_eq!(parse(many_times_nothing), ParseError::NoSuchType("int8[0]".into()));
    }
}
