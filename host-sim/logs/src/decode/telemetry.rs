//! Telemetry in quadlab's own recordings: JSON of the type that the craft sends.
//!
//! JSON has no NaN: the recorder writes `null`, and `null` where a number is due is NaN again here.

use proto::Telemetry;
use serde::de::value::{MapDeserializer, SeqDeserializer, StrDeserializer};
use serde::de::{Deserialize as _, Deserializer, IntoDeserializer, Visitor};
use serde_json::{Error, Value};

/// A message of the topic `/telemetry`; nothing where it is none.
pub fn telemetry_from_json(message: &[u8]) -> Option<Telemetry> {
    let value: Value = serde_json::from_slice(message).ok()?;
    Telemetry::deserialize(NullIsNan(&value)).ok()
}

/// JSON in which a number may be `null`.
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
        newtype_struct seq tuple tuple_struct map struct identifier ignored_any
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
