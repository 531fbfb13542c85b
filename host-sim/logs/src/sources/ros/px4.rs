//! PX4's own messages over ROS 2 (package px4_msgs): the topics of its logs under other names, in its
//! own frames and units.

use crate::format::Format;
use crate::log::{Log, Table, TimeUnit};

/// The bag as a log of PX4, if it has its messages.
pub(in crate::sources) fn as_px4_log(log: &Log) -> Option<Log> {
    let tables: Vec<Table> = log.tables.iter().filter_map(topic).collect();
    if tables.is_empty() {
        return None;
    }
    Some(Log {
        tables,
        parameters: log.parameters.clone(),
        information: log.information.clone(),
        losses: log.losses.clone(),
        ..Log::new(Format::Ulog)
    })
}

/// `/fmu/out/vehicle_attitude`, `..._v1`, or `/fmu/vehicle_attitude/out` of PX4 1.13 and before, as
/// `vehicle_attitude[0]`, with the craft's own times, us. Names as in `docs/en/middleware/dds_topics.md` of
/// PX4/PX4-Autopilot.
fn topic(table: &Table) -> Option<Table> {
    if !table.message_type.as_deref()?.starts_with("px4_msgs/") {
        return None;
    }
    let last = table.name.strip_suffix("/out").unwrap_or(&table.name).rsplit('/').next()?;
    let name = match last.rsplit_once("_v") {
        Some((name, version)) if !version.is_empty() && version.bytes().all(|c| c.is_ascii_digit()) => name,
        _ => last,
    };
    let times = match table.column("timestamp")? {
        crate::log::Values::U64(times) => {
            times.iter().map(|&time| i64::try_from(time).unwrap_or(i64::MAX)).collect()
        }
        _ => return None,
    };
    Some(Table {
        name: format!("{name}[0]"),
        message_type: table.message_type.clone(),
        time_unit: TimeUnit::Microseconds,
        times,
        rows: table.rows,
        columns: table.columns.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Column, Values};

    #[test]
    fn topics_get_the_names_of_the_log() {
        let mut log = Log::new(Format::Mcap);
        log.tables.push(Table {
            name: "/fmu/out/vehicle_attitude_v1".into(),
            message_type: Some("px4_msgs/msg/VehicleAttitude".into()),
            time_unit: TimeUnit::Nanoseconds,
            times: vec![5, 6],
            rows: 2,
            columns: vec![Column { name: "timestamp".into(), values: Values::U64(vec![7, 8]) }],
        });
        let px4 = as_px4_log(&log).unwrap();
        assert_eq!(px4.table("vehicle_attitude[0]").unwrap().times, [7, 8]);
        log.tables[0].name = "/iris_1/fmu/vehicle_attitude/out".into();
        assert!(as_px4_log(&log).unwrap().table("vehicle_attitude[0]").is_some());
        log.tables[0].message_type = Some("geometry_msgs/msg/PoseStamped".into());
        assert!(as_px4_log(&log).is_none());
    }
}
