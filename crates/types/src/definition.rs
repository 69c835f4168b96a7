//! What a message looks like to other programs: its name and fields as ROS 2 defines them.

use alloc::boxed::Box;
use alloc::format;
use alloc::string::String;
use alloc::vec::Vec;

/// The type of a field.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `bool`
    Bool,
    /// `int8`
    I8,
    /// `uint8`
    U8,
    /// `int16`
    I16,
    /// `uint16`
    U16,
    /// `int32`
    I32,
    /// `uint32`
    U32,
    /// `int64`
    I64,
    /// `uint64`
    U64,
    /// `float32`
    F32,
    /// `float64`
    F64,
    /// `string`
    String,
    /// Another message.
    Struct(Definition),
    /// A fixed number of values, written one after another.
    Array(Box<Kind>, usize),
    /// A counted row of values.
    Sequence(Box<Kind>),
}

/// A named field of a message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// Its type.
    pub kind: Kind,
    /// Whether it is no number (NaN) where somebody describes the message without it, and not zero: so it can be told that it is missing.
    pub or_nan: bool,
}

/// A message as other programs know it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Definition {
    /// Its full name, as in `geometry_msgs/msg/Twist`.
    pub name: &'static str,
    /// Its fields in order.
    pub fields: Vec<Field>,
    /// What the numbers of its fields mean, as constants: `PROGRESS_ARRIVED` is a value of the field `progress`.
    pub constants: Vec<(&'static str, u8)>,
}

impl Kind {
    fn ros(&self) -> String {
        match self {
            Kind::Bool => "bool".into(),
            Kind::I8 => "int8".into(),
            Kind::U8 => "uint8".into(),
            Kind::I16 => "int16".into(),
            Kind::U16 => "uint16".into(),
            Kind::I32 => "int32".into(),
            Kind::U32 => "uint32".into(),
            Kind::I64 => "int64".into(),
            Kind::U64 => "uint64".into(),
            Kind::F32 => "float32".into(),
            Kind::F64 => "float64".into(),
            Kind::String => "string".into(),
            Kind::Struct(definition) => definition.short_name(),
            Kind::Array(of, n) => format!("{}[{n}]", of.ros()),
            Kind::Sequence(of) => format!("{}[]", of.ros()),
        }
    }

    fn parts<'a>(&'a self, found: &mut Vec<&'a Definition>) {
        match self {
            Kind::Struct(definition) if !found.iter().any(|known| known.name == definition.name) => {
                found.push(definition);
                definition.parts(found);
            }
            Kind::Array(of, _) | Kind::Sequence(of) => of.parts(found),
            _ => {}
        }
    }
}

impl Definition {
    /// A definition of `name` with `fields` in order.
    pub fn new(name: &'static str, fields: impl IntoIterator<Item = (&'static str, Kind)>) -> Definition {
        let fields = fields.into_iter().map(|(name, kind)| Field { name, kind, or_nan: false });
        Definition { name, fields: fields.collect(), constants: Vec::new() }
    }

    /// The same, with no number in these fields where nothing is said of them.
    pub fn or_nan(mut self, names: &[&str]) -> Definition {
        for field in self.fields.iter_mut().filter(|field| names.contains(&field.name)) {
            field.or_nan = true;
        }
        self
    }

    /// The same, with names for the numbers of its fields.
    pub fn with_constants(self, constants: impl IntoIterator<Item = (&'static str, u8)>) -> Definition {
        Definition { constants: constants.into_iter().collect(), ..self }
    }

    /// The name without its middle part: `geometry_msgs/Twist`.
    pub fn short_name(&self) -> String {
        self.name.replace("/msg/", "/")
    }

    /// The constants and the fields as a `.msg` file gives them, a line each.
    pub fn lines(&self) -> String {
        let constants = self.constants.iter().map(|(name, value)| format!("uint8 {name}={value}\n"));
        let fields = self.fields.iter().map(|field| format!("{} {}\n", field.kind.ros(), field.name));
        constants.chain(fields).collect()
    }

    /// The whole `ros2msg` schema: the fields, then each message that they use behind its name.
    pub fn text(&self) -> String {
        let mut found = Vec::new();
        self.parts(&mut found);
        let mut text = self.lines();
        for part in found {
            text += &format!("{}\nMSG: {}\n{}", "=".repeat(80), part.short_name(), part.lines());
        }
        text
    }

    fn parts<'a>(&'a self, found: &mut Vec<&'a Definition>) {
        for field in &self.fields {
            field.kind.parts(found);
        }
    }
}
