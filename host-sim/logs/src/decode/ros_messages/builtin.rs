//! Definitions of common messages, for bags that hold only their names (ROS 2 before Iron, in sqlite).
//! As in the packages `common_interfaces` of ROS 2 Humble.

const HEADER: &str = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
const VECTOR3: &str = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n";
const POINT: &str = "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n";
const QUATERNION: &str = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n";
const POSE: &str = "MSG: geometry_msgs/Pose\nPoint position\nQuaternion orientation\n";
const TWIST: &str = "MSG: geometry_msgs/Twist\nVector3 linear\nVector3 angular\n";
const ACCEL: &str = "MSG: geometry_msgs/Accel\nVector3 linear\nVector3 angular\n";
const TRANSFORM: &str = "MSG: geometry_msgs/Transform\nVector3 translation\nQuaternion rotation\n";
const TRANSFORM_STAMPED: &str = "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n\
    Transform transform\n";
const POSE_COVARIANCE: &str = "MSG: geometry_msgs/PoseWithCovariance\nPose pose\nfloat64[36] covariance\n";
const TWIST_COVARIANCE: &str =
    "MSG: geometry_msgs/TwistWithCovariance\nTwist twist\nfloat64[36] covariance\n";
const ARRAY_LAYOUT: &str = "MSG: std_msgs/MultiArrayLayout\nMultiArrayDimension[] dim\nuint32 data_offset\n\
    MSG: std_msgs/MultiArrayDimension\nstring label\nuint32 size\nuint32 stride\n";

/// The definition of a message `package/Type` with all that is in it.
pub(super) fn definition(name: &str) -> Option<String> {
    let Some((fields, parts)) = geometry(name).or_else(|| sensor(name)) else { return of_std(name) };
    Some(std::iter::once(fields).chain(parts.iter().copied()).collect())
}

/// Fields, and the messages in them.
type Definition = (&'static str, &'static [&'static str]);

fn geometry(name: &str) -> Option<Definition> {
    Some(match name {
        "std_msgs/Header" => (HEADER, &[]),
        "geometry_msgs/Point" | "geometry_msgs/Vector3" => ("float64 x\nfloat64 y\nfloat64 z\n", &[]),
        "geometry_msgs/Quaternion" => ("float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", &[]),
        "geometry_msgs/PointStamped" => ("std_msgs/Header header\nPoint point\n", &[HEADER, POINT]),
        "geometry_msgs/Vector3Stamped" => ("std_msgs/Header header\nVector3 vector\n", &[HEADER, VECTOR3]),
        "geometry_msgs/QuaternionStamped" => {
            ("std_msgs/Header header\nQuaternion quaternion\n", &[HEADER, QUATERNION])
        }
        "geometry_msgs/Pose" => ("Point position\nQuaternion orientation\n", &[POINT, QUATERNION]),
        "geometry_msgs/PoseStamped" => {
            ("std_msgs/Header header\nPose pose\n", &[HEADER, POSE, POINT, QUATERNION])
        }
        "geometry_msgs/PoseWithCovarianceStamped" => (
            "std_msgs/Header header\nPoseWithCovariance pose\n",
            &[HEADER, POSE_COVARIANCE, POSE, POINT, QUATERNION],
        ),
        "geometry_msgs/Twist" => ("Vector3 linear\nVector3 angular\n", &[VECTOR3]),
        "geometry_msgs/TwistStamped" => (
            "std_msgs/Header header\nTwist twist\n\
             ",
            &[HEADER, TWIST, VECTOR3],
        ),
        "geometry_msgs/TwistWithCovarianceStamped" => (
            "std_msgs/Header header\nTwistWithCovariance twist\n",
            &[HEADER, TWIST_COVARIANCE, TWIST, VECTOR3],
        ),
        "geometry_msgs/AccelStamped" => (
            "std_msgs/Header header\nAccel accel\n\
             ",
            &[HEADER, ACCEL, VECTOR3],
        ),
        "geometry_msgs/TransformStamped" => (
            "std_msgs/Header header\nstring child_frame_id\nTransform transform\n",
            &[HEADER, TRANSFORM, VECTOR3, QUATERNION],
        ),
        "tf2_msgs/TFMessage" => (
            "geometry_msgs/TransformStamped[] transforms\n",
            &[TRANSFORM_STAMPED, HEADER, TRANSFORM, VECTOR3, QUATERNION],
        ),
        "nav_msgs/Odometry" => (
            "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
             geometry_msgs/TwistWithCovariance twist\n",
            &[HEADER, POSE_COVARIANCE, POSE, POINT, QUATERNION, TWIST_COVARIANCE, TWIST, VECTOR3],
        ),
        "std_msgs/Bool" => ("bool data\n", &[]),
        _ => return None,
    })
}

fn sensor(name: &str) -> Option<Definition> {
    Some(match name {
        "sensor_msgs/Imu" => (
            "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\n\
             float64[9] orientation_covariance\n\
             geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
             geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
            &[HEADER, QUATERNION, VECTOR3],
        ),
        "sensor_msgs/BatteryState" => (
            "std_msgs/Header header\nfloat32 voltage\nfloat32 temperature\nfloat32 current\n\
             float32 charge\nfloat32 capacity\n\
             float32 design_capacity\nfloat32 percentage\nuint8 power_supply_status\n\
             uint8 power_supply_health\n\
             uint8 power_supply_technology\nbool present\nfloat32[] cell_voltage\n\
             float32[] cell_temperature\nstring location\n\
             string serial_number\n",
            &[HEADER],
        ),
        "sensor_msgs/MagneticField" => (
            "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\n\
             float64[9] magnetic_field_covariance\n",
            &[HEADER, VECTOR3],
        ),
        "sensor_msgs/FluidPressure" => {
            ("std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n", &[HEADER])
        }
        "sensor_msgs/Temperature" => {
            ("std_msgs/Header header\nfloat64 temperature\nfloat64 variance\n", &[HEADER])
        }
        "sensor_msgs/Range" => (
            "std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\n\
             float32 max_range\n\
             float32 range\nfloat32 variance\n",
            &[HEADER],
        ),
        _ => return None,
    })
}

/// `std_msgs/Float32` and the like, and `std_msgs/Float32MultiArray`.
fn of_std(name: &str) -> Option<String> {
    let name = name.strip_prefix("std_msgs/")?;
    let (element, array) = match name.strip_suffix("MultiArray") {
        Some(element) => (element, true),
        None => (name, false),
    };
    let known =
        ["Float32", "Float64", "Int8", "Int16", "Int32", "Int64", "UInt8", "UInt16", "UInt32", "UInt64"];
    let element = known.contains(&element).then(|| element.to_lowercase())?;
    Some(if array {
        format!("MultiArrayLayout layout\n{element}[] data\n{ARRAY_LAYOUT}")
    } else {
        format!("{element} data\n")
    })
}

#[cfg(test)]
mod tests {
    use super::super::definition::{Definitions, Dialect, Kind};
    use super::*;

    /// All messages that a definition names are in it.
    #[test]
    fn definitions_are_complete() {
        for name in [
            "geometry_msgs/PoseStamped",
            "geometry_msgs/PoseWithCovarianceStamped",
            "geometry_msgs/TwistStamped",
            "geometry_msgs/AccelStamped",
            "geometry_msgs/TransformStamped",
            "tf2_msgs/TFMessage",
            "nav_msgs/Odometry",
            "sensor_msgs/Imu",
            "sensor_msgs/BatteryState",
            "std_msgs/Float32MultiArray",
            "std_msgs/Float64MultiArray",
        ] {
            let text = definition(name).unwrap();
            let definitions = Definitions::parse(name, &text, Dialect::Ros2).unwrap();
            let mut open = vec![name.to_owned()];
            while let Some(message) = open.pop() {
                let fields = definitions.fields(&message).unwrap_or_else(|| panic!("{name} lacks {message}"));
                open.extend(fields.iter().filter_map(|field| match &field.kind {
                    Kind::Message(inner) => Some(inner.clone()),
                    _ => None,
                }));
            }
        }
        assert_eq!(definition("std_msgs/UInt16").as_deref(), Some("uint16 data\n"));
        assert_eq!(definition("std_msgs/String"), None);
    }
}
