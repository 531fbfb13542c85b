//! Message definitions: the text of `.msg` files, one after another with `MSG: name` between them.
//!
//! ROS 1: <http://wiki.ros.org/msg>; ROS 2:
//! <https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html>.

use std::collections::HashMap;

/// Which ROS: they differ in names and in how messages are serialised.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::decode) enum Dialect {
    Ros1,
    Ros2,
}

/// A type without parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Primitive {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// What one element of a field is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Kind {
    Primitive(Primitive),
    Text,
    /// Seconds and nanoseconds; whether the seconds have a sign.
    Time {
        signed: bool,
    },
    /// A message by its name, `package/Type`.
    Message(String),
}

/// How many elements a field has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Count {
    One,
    Fixed(usize),
    Any,
}

/// A field of a message.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) count: Count,
}

/// The fields of a message and of all messages in it, by name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Definitions {
    messages: HashMap<String, Vec<Field>>,
}

/// `package/Type` as `package/msg/Type`.
pub(in crate::decode) fn full_type_name(name: &str) -> String {
    match name.split_once('/') {
        Some((package, message)) if !message.contains('/') => format!("{package}/msg/{message}"),
        _ => name.into(),
    }
}

/// `package/msg/Type` as `package/Type`.
pub(super) fn short_type_name(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

impl Definitions {
    /// Reads the text that defines `root` and, behind lines of `=`, the messages in it.
    pub(super) fn parse(root: &str, text: &str, dialect: Dialect) -> Result<Self, String> {
        let mut definitions = Self::default();
        let mut name = short_type_name(root);
        let mut fields = Vec::new();
        for line in text.lines() {
            let line = line.trim();
            if line.len() >= 8 && line.bytes().all(|c| c == b'=') {
                continue;
            }
            if let Some(next) = line.strip_prefix("MSG:") {
                let before = std::mem::replace(&mut name, short_type_name(next.trim()));
                definitions.messages.insert(before, std::mem::take(&mut fields));
            } else if let Some(field) = field(line, &name, dialect)? {
                fields.push(field);
            }
        }
        definitions.messages.insert(name, fields);
        Ok(definitions)
    }

    /// The fields of a message.
    pub(super) fn fields(&self, name: &str) -> Option<&[Field]> {
        self.messages.get(name).map(Vec::as_slice)
    }
}

/// A line of a definition, if it is a field: no comment, no constant.
fn field(line: &str, message: &str, dialect: Dialect) -> Result<Option<Field>, String> {
    let code = line.split('#').next().unwrap_or("").trim();
    let Some((type_name, rest)) = code.split_once(char::is_whitespace) else {
        return if code.is_empty() { Ok(None) } else { Err(format!("{message} has a line without a name")) };
    };
    let rest = rest.trim();
    let name: String = rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
    // `int8 LEFT=1` and `string HOME = house # comment` are constants, `int8 side 1` a field with a
    // default.
    if rest[name.len()..].trim_start().starts_with('=') {
        return Ok(None);
    }
    if name.is_empty() {
        return Err(format!("{message} has a field without a name"));
    }
    let (element, count) =
        count(type_name).ok_or_else(|| format!("{message}.{name} is of a strange length"))?;
    let kind = kind(element, message, dialect)
        .ok_or_else(|| format!("{message}.{name} is of a type that is not read"))?;
    Ok(Some(Field { name, kind, count }))
}

/// `type`, `type[3]`, `type[]`, `type[<=3]`.
fn count(type_name: &str) -> Option<(&str, Count)> {
    let Some(inside) = type_name.strip_suffix(']') else { return Some((type_name, Count::One)) };
    let (element, length) = inside.rsplit_once('[')?;
    if length.is_empty() || length.starts_with("<=") {
        return Some((element, Count::Any));
    }
    Some((element, Count::Fixed(length.parse().ok()?)))
}

fn kind(name: &str, message: &str, dialect: Dialect) -> Option<Kind> {
    use Primitive::{F32, F64, I8, I16, I32, I64, U8, U16, U32, U64};
    // Text of limited length, `string<=5`, is text.
    let name = name.split("<=").next().unwrap_or(name);
    Some(match name {
        "bool" | "uint8" | "char" => Kind::Primitive(U8),
        "byte" if dialect == Dialect::Ros2 => Kind::Primitive(U8),
        "int8" | "byte" => Kind::Primitive(I8),
        "int16" => Kind::Primitive(I16),
        "uint16" => Kind::Primitive(U16),
        "int32" => Kind::Primitive(I32),
        "uint32" => Kind::Primitive(U32),
        "int64" => Kind::Primitive(I64),
        "uint64" => Kind::Primitive(U64),
        "float32" => Kind::Primitive(F32),
        "float64" => Kind::Primitive(F64),
        "string" => Kind::Text,
        "wstring" => return None,
        "time" if dialect == Dialect::Ros1 => Kind::Time { signed: false },
        "duration" if dialect == Dialect::Ros1 => Kind::Time { signed: true },
        "Header" => Kind::Message("std_msgs/Header".into()),
        "builtin_interfaces/Time" | "builtin_interfaces/msg/Time" => Kind::Time { signed: true },
        "builtin_interfaces/Duration" | "builtin_interfaces/msg/Duration" => Kind::Time { signed: true },
        _ if name.contains('/') => Kind::Message(short_type_name(name)),
        _ => Kind::Message(format!("{}/{name}", message.split('/').next().unwrap_or(""))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of sensor_msgs/BatteryState, geometry_msgs/PoseStamped (ROS 1), and the kinds of lines of
    /// the ROS 2 documentation.
    #[test]
    fn lines_of_definitions() {
        let text = "# comment\nuint8 POWER_SUPPLY_STATUS_UNKNOWN = 0\nstring HOME=\"a # b\"\nHeader header\nfloat32[] cell_voltage # V\n\
            string<=5[<=3] names\nuint8 x 42\nPose pose\nfloat64[36] covariance\n================================================\n\
            MSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n";
        let definitions = Definitions::parse("geometry_msgs/msg/Made", text, Dialect::Ros1).unwrap();
        let fields = definitions.fields("geometry_msgs/Made").unwrap();
        let names: Vec<&str> = fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names, ["header", "cell_voltage", "names", "x", "pose", "covariance"]);
        assert_eq!(fields[0].kind, Kind::Message("std_msgs/Header".into()));
        assert_eq!((&fields[1].kind, fields[1].count), (&Kind::Primitive(Primitive::F32), Count::Any));
        assert_eq!((&fields[2].kind, fields[2].count), (&Kind::Text, Count::Any));
        assert_eq!(fields[4].kind, Kind::Message("geometry_msgs/Pose".into()));
        assert_eq!(fields[5].count, Count::Fixed(36));
        assert_eq!(definitions.fields("std_msgs/Header").unwrap()[1].kind, Kind::Time { signed: false });
    }

    #[test]
    fn what_is_not_read_is_named() {
        let refused = Definitions::parse("a/B", "wstring name", Dialect::Ros2).unwrap_err();
        assert!(refused.contains("a/B.name"), "{refused}");
        assert!(Definitions::parse("a/B", "int8[x] name", Dialect::Ros2).is_err());
        assert!(Definitions::parse("a/B", "int8", Dialect::Ros2).is_err());
    }
}
