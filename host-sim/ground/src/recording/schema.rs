//! JSON schemas of the messages, drawn from a message of each topic.

use logs::LEFT_OUT;
use proto::{
    Answer, Command, Counters, Ending, Gains, Identity, ImuSample, Loop, Mode, Pose, Refusal, Request, State,
    Supervision, Telemetry, TimedPose,
};
use serde_json::{Value, json};

use super::entry::{Entry, Level, LinkRecord};

/// Telemetry with every field in it.
fn sample_telemetry(pose: Pose) -> Telemetry {
    Telemetry {
        tick: 0,
        craft_us: 0,
        ground_us: 0,
        supervision: Supervision { state: State::Disarmed, conditions: 0, preflight: 0 },
        mode: Mode::Position,
        attitude_command_rad: [0.5; 3],
        z_command_m: 0.5,
        tracked: pose,
        tracked_rates_rad_s: [0.5; 3],
        imu: Some(ImuSample {
            gyro_rad_s: [0.5; 3],
            attitude_rad: Some([0.5; 3]),
            acceleration_m_s2: Some([0.5; 3]),
        }),
        thrust: 0.5,
        torque: [0.5; 3],
        pwm: [0.5; 4],
        refused: Refusal::default(),
        battery_v: 0.5,
        current_a: Some(0.5),
        counters: Counters::default(),
    }
}

/// A message of each topic with every field in it, to draw the schemas from.
pub(super) fn samples() -> [Value; 12] {
    let pose = Pose { position_m: [0.5; 3], attitude_rad: [0.5; 3] };
    let telemetry = sample_telemetry(pose);
    let command = Command {
        mode: Mode::Position,
        attitude_rad: [0.5; 2],
        yaw_rad: 0.5,
        z_m: 0.5,
        position_m: [0.5; 2],
        cut_off: true,
        injection: [0.5; 4],
    };
    let identity =
        Identity { versions: [0; 2], program: [0; 3], vehicle_sha256: [0; 32], state: State::Disarmed };
    let link = LinkRecord {
        one_way_s: 0.5,
        least_one_way_s: 0.5,
        skew: 0.5,
        skew_std_error: 0.5,
        tick_hz: 0.5,
        lost_down: 0.5,
        lost_up: 0.5,
        pose_hz: 0.5,
    };
    [
        Entry::Telemetry(&telemetry),
        Entry::Pose(&TimedPose { frame: 0, ground_us: 0, pose }),
        Entry::Command(&command),
        Entry::Request(Request::Arm),
        Entry::Gains(&Gains { of: Loop::Roll, kp: 0.5, ki: 0.5, kd: 0.5 }),
        Entry::Identity(&identity),
        Entry::Answer(&Answer { to: 0, done: true, preflight: 0 }),
        Entry::Link(&link),
        Entry::Log(Level::Info, "words"),
        Entry::Transform(&pose),
        Entry::Track(&[pose]),
        Entry::LastEnd(Ending::Watchdog),
    ]
    .map(|entry| serde_json::from_str(&entry.json(0)).unwrap_or_default())
}

/// The JSON schema of messages like this one, in the words that Foxglove reads: no choice of kinds, and each list of one kind. No field
/// is required, since what is missing is left out (`nulls.rs`).
pub(super) fn schema(title: &str, sample: &Value) -> Value {
    fn kind(value: &Value) -> Value {
        match value {
            Value::Object(fields) => {
                let properties: serde_json::Map<String, Value> =
                    fields.iter().map(|(name, value)| (name.clone(), kind(value))).collect();
                json!({ "type": "object", "properties": properties })
            }
            Value::Array(items) => {
                json!({ "type": "array", "items": items.first().map_or(json!({}), kind) })
            }
            Value::Number(number) if number.is_f64() => json!({ "type": "number" }),
            Value::Number(_) => json!({ "type": "integer" }),
            Value::Bool(_) => json!({ "type": "boolean" }),
            Value::String(_) => json!({ "type": "string" }),
            Value::Null => json!({}),
        }
    }
    let mut schema = kind(sample);
    if title.starts_with("quadlab.") {
        schema["properties"][LEFT_OUT] = json!({ "type": "string" });
    }
    if let Value::Object(fields) = &mut schema {
        fields.insert("title".into(), title.into());
        fields.insert("$schema".into(), "https://json-schema.org/draft/2020-12/schema".into());
    }
    schema
}

#[cfg(test)]
mod tests {
    use super::super::entry::TOPICS;
    use super::*;

    #[test]
    fn a_schema_gives_each_field_its_kind() {
        let schema = schema(
            "title",
            &json!({
                "tick": 1, "thrust": 0.5, "on": true, "state": "Flying", "nothing": null,
                "imu": { "gyro": [0.5, 0.5] }, "empty": [],
            }),
        );
        assert_eq!(schema["title"], "title");
        let kind = |field: &str| schema["properties"][field]["type"].clone();
        assert_eq!(
            [kind("tick"), kind("thrust"), kind("on"), kind("state")],
            ["integer", "number", "boolean", "string"]
        );
        assert_eq!(schema["properties"]["imu"]["properties"]["gyro"]["items"]["type"], "number");
        assert_eq!((kind("nothing"), kind("empty")), (Value::Null, json!("array")));
    }

    /// Foxglove's reader of schemas (packages/mcap-support/src/parseJsonSchema.ts of foxglove/studio) knows these kinds only, and
    /// does not show a topic of any other.
    #[test]
    fn foxglove_can_read_every_schema() {
        fn is_read(schema: &Value) -> bool {
            match schema["type"].as_str() {
                Some("boolean" | "string" | "number" | "integer") => true,
                Some("object") => schema["properties"].as_object().unwrap().values().all(is_read),
                Some("array") => schema["items"]["type"] != "array" && is_read(&schema["items"]),
                _ => false,
            }
        }
        for ((_, name), sample) in TOPICS.iter().zip(samples()) {
            let schema = schema(name, &sample);
            assert!(schema["type"] == "object" && is_read(&schema), "{schema}");
        }
    }

    /// Fields of Foxglove's own definitions (github.com/foxglove/schemas, schemas/jsonschema).
    #[test]
    fn foxgloves_messages_have_foxgloves_fields() {
        let xyz = ["x", "y", "z"];
        let fields = |value: &Value| value.as_object().unwrap().keys().cloned().collect::<Vec<_>>();
        for ((_, name), sample) in TOPICS.iter().zip(samples()) {
            let expected: &[&str] = match *name {
                "foxglove.Log" => &["file", "level", "line", "message", "name", "timestamp"],
                "foxglove.FrameTransform" => {
                    assert_eq!(fields(&sample["translation"]), xyz);
                    assert_eq!(fields(&sample["rotation"]), ["w", "x", "y", "z"]);
                    &["child_frame_id", "parent_frame_id", "rotation", "timestamp", "translation"]
                }
                "foxglove.PosesInFrame" => {
                    let pose = &sample["poses"][0];
                    assert_eq!(fields(pose), ["orientation", "position"]);
                    assert_eq!(fields(&pose["position"]), xyz);
                    assert_eq!(fields(&pose["orientation"]), ["w", "x", "y", "z"]);
                    &["frame_id", "poses", "timestamp"]
                }
                _ => continue,
            };
            assert_eq!(fields(&sample), expected, "{name}");
            assert_eq!(fields(&sample["timestamp"]), ["nsec", "sec"]);
        }
    }

    #[test]
    fn samples_have_a_value_in_every_field() {
        fn none_missing(value: &Value) -> bool {
            match value {
                Value::Null => false,
                Value::Object(fields) => !fields.is_empty() && fields.values().all(none_missing),
                Value::Array(items) => !items.is_empty() && items.iter().all(none_missing),
                _ => true,
            }
        }
        for sample in samples() {
            assert!(none_missing(&sample), "{sample}");
        }
    }
}
