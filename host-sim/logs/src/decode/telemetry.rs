//! Telemetry in quadlab's own recordings: JSON of the type that the craft sends.
//!
//! JSON has no NaN: a field that is not there is NaN again here where a number is due, and so is `null`, which recordings of before had.
//! Lists with such numbers stand as text in [`LEFT_OUT`].

use proto::Telemetry;
use serde::de::value::{MapDeserializer, SeqDeserializer, StrDeserializer};
use serde::de::{Deserialize as _, Deserializer, IntoDeserializer, Visitor};
use serde_json::{Error, Value};

/// Field of a message that holds, as the text of a JSON object, the lists in which a number was none.
pub const LEFT_OUT: &str = "left_out";

/// A message of the topic `/telemetry`; nothing where it is none.
pub fn telemetry_from_json(message: &[u8]) -> Option<Telemetry> {
    let mut value: Value = serde_json::from_slice(message).ok()?;
    let left_out =
        value.get(LEFT_OUT).and_then(Value::as_str).and_then(|text| serde_json::from_str(text).ok());
    if let Some(left_out) = left_out {
        put_back(&mut value, left_out);
    }
    Telemetry::deserialize(NullIsNan(&value)).ok()
}

fn put_back(value: &mut Value, left_out: Value) {
    match (value, left_out) {
        (Value::Object(fields), Value::Object(left_out)) => {
            for (name, inner) in left_out {
                put_back(fields.entry(name).or_insert(Value::Null), inner);
            }
        }
        (value, left_out) => *value = left_out,
    }
}

/// JSON in which a number may be `null` or missing.
#[derive(Clone, Copy)]
struct NullIsNan<'a>(&'a Value);

impl<'de> IntoDeserializer<'de, Error> for NullIsNan<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for NullIsNan<'de> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.0 {
            Value::Array(items) => visitor.visit_seq(SeqDeserializer::new(items.iter().map(NullIsNan))),
            Value::Object(fields) => {
                let fields = fields.iter().map(|(name, value)| (name.as_str(), NullIsNan(value)));
                visitor.visit_map(MapDeserializer::new(fields))
            }
            plain => plain.deserialize_any(visitor),
        }
    }

    fn deserialize_f32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        if self.0.is_null() { visitor.visit_f32(f32::NAN) } else { self.deserialize_any(visitor) }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        if self.0.is_null() { visitor.visit_none() } else { visitor.visit_some(self) }
    }

    /// All fields that it should have; `null` for those that it has not.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        names: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let Value::Object(fields) = self.0 else { return self.deserialize_any(visitor) };
        let field = |name: &&'static str| (*name, NullIsNan(fields.get(*name).unwrap_or(&Value::Null)));
        visitor.visit_map(MapDeserializer::new(names.iter().map(field)))
    }

    /// A list of fixed length that is missing has as many numbers that are none.
    fn deserialize_tuple<V: Visitor<'de>>(self, length: usize, visitor: V) -> Result<V::Value, Error> {
        if !self.0.is_null() {
            return self.deserialize_any(visitor);
        }
        visitor.visit_seq(SeqDeserializer::new(std::iter::repeat_n(NullIsNan(&Value::Null), length)))
    }

    /// Variants without content, as their names.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let name: StrDeserializer<'_, Error> = self.0.as_str().unwrap_or_default().into_deserializer();
        visitor.visit_enum(name)
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f64 char str string bytes byte_buf unit unit_struct
        newtype_struct seq tuple_struct map identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_bytes_panic(words in prop::collection::vec(("[a-z_]{1,12}", any::<i64>()), 0..6)) {
            let value: Value = words.into_iter().map(|(k, v)| (k, v.into())).collect::<serde_json::Map<_, _>>().into();
            prop_assert_eq!(telemetry_from_json(value.to_string().as_bytes()), None);
        }
    }
}
