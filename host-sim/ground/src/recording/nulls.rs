//! JSON without `null`: what is missing is left out.
//!
//! JSON has no number that is none, and programs that read a recording by its schemas (Foxglove) take no `null` where a number is due.
//! So an optional value that is not there, and a number that is none, is a field that is not there. A list keeps its length: one
//! with a number that is none goes as text into the field [`LEFT_OUT`], with the names of where it stood, and nothing is lost.

use logs::LEFT_OUT;
use serde::Serialize;
use serde_json::{Map, Value};

/// The JSON of a message. Serialising plain data does not fail.
pub(super) fn without_nulls(message: &impl Serialize) -> String {
    let text = serde_json::to_string(message).unwrap_or_else(|_| "{}".into());
    // Most messages lack nothing. Those that do are read again: as text a number keeps its few digits.
    if !text.contains("null") {
        return text;
    }
    let Ok(Value::Object(mut fields)) = serde_json::from_str(&text) else { return text };
    let left_out = take_nulls(&mut fields);
    if !left_out.is_empty() {
        fields.insert(LEFT_OUT.into(), Value::Object(left_out).to_string().into());
    }
    Value::Object(fields).to_string()
}

/// Takes out of an object what is `null`, and gives the lists that had some.
fn take_nulls(fields: &mut Map<String, Value>) -> Map<String, Value> {
    let mut left_out = Map::new();
    fields.retain(|name, value| match value {
        Value::Null => false,
        Value::Array(items) if items.iter().any(Value::is_null) => {
            left_out.insert(name.clone(), value.take());
            false
        }
        Value::Object(inner) => {
            let of_inner = take_nulls(inner);
            if !of_inner.is_empty() {
                left_out.insert(name.clone(), of_inner.into());
            }
            true
        }
        _ => true,
    });
    left_out
}

#[cfg(test)]
mod tests {
    use logs::telemetry_from_json;
    use proptest::prelude::*;
    use proto::Telemetry;
    use serde_json::json;

    use super::super::schema::samples;
    use super::*;

    #[test]
    fn what_is_missing_is_no_field_and_a_list_with_gaps_is_text() {
        let message = json!({
            "tick": 7,
            "current_a": null,
            "imu": { "gyro": [0.1, null], "attitude": null, "board": "a null device" },
            "pwm": [1.5, 2.5],
        });
        let text = without_nulls(&message);
        let read: Value = serde_json::from_str(&text).unwrap();
        let left_out = "{\"imu\":{\"gyro\":[0.1,null]}}";
        let expected =
            json!({ "tick": 7, "imu": { "board": "a null device" }, "pwm": [1.5, 2.5], LEFT_OUT: left_out });
        assert_eq!(read, expected);
        assert_eq!(
            without_nulls(&json!({ "words": "null", "x": 0.1_f32 })),
            "{\"words\":\"null\",\"x\":0.10000000149011612}"
        );
    }

    proptest! {
        /// Whatever is missing, the importer reads what was said.
        #[test]
        fn telemetry_with_gaps_comes_back(gaps in any::<[bool; 10]>(), value in any::<f32>()) {
            let mut told: Telemetry = serde_json::from_value(samples()[0].clone()).unwrap();
            let number = |gap: bool| if gap { f32::NAN } else { value };
            told.thrust = number(gaps[0]);
            told.battery_v = number(gaps[1]);
            told.tracked.position_m = [gaps[2], gaps[3], gaps[4]].map(number);
            told.torque[1] = number(gaps[5]);
            told.current_a = (!gaps[6]).then_some(value);
            if let Some(imu) = &mut told.imu {
                imu.gyro_rad_s[2] = number(gaps[7]);
                imu.attitude_rad = (!gaps[8]).then_some([value; 3]);
            }
            if gaps[9] {
                told.imu = None;
            }
            let text = without_nulls(&told);
            let read = telemetry_from_json(text.as_bytes()).unwrap();
            // No number is its own equal; what is printed of it is.
            prop_assert_eq!(format!("{read:?}"), format!("{told:?}"), "{}", text);
        }
    }

    /// 32-bit numbers keep the few digits that give them back.
    #[test]
    fn numbers_do_not_grow() {
        #[derive(Serialize)]
        struct Message {
            thrust: f32,
            missing: Option<f32>,
        }
        assert_eq!(without_nulls(&Message { thrust: 0.1, missing: None }), "{\"thrust\":0.1}");
    }
}
