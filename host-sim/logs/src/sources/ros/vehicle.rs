//! Which of several poses is the craft's.

use super::bag::{Bag, Topic};

/// Poses of a bag.
pub(super) struct Poses<'a, 'b> {
    pub(super) craft: Option<&'b Topic<'a>>,
    pub(super) load: Option<&'b Topic<'a>>,
    pub(super) others: Vec<&'b Topic<'a>>,
}

impl<'a, 'b> Poses<'a, 'b> {
    /// The craft's is the one beside an inertial sensor or motors, then the one with most messages; a
    /// load has it in its name.
    pub(super) fn of(bag: &'b Bag<'a>) -> Self {
        let is_pose = |topic: &&Topic<'_>| {
            ["pose.position.x", "pose.pose.position.x"].iter().any(|name| topic.table.column(name).is_some())
        };
        let (loads, mut poses): (Vec<_>, Vec<_>) =
            bag.topics.iter().filter(is_pose).partition(|topic| is_load(&topic.table.name));
        let has_sensors = |topic: &Topic<'_>| {
            bag.topics.iter().any(|other| {
                other.namespace() == topic.namespace()
                    && (other.is_a("Imu") || super::motors::is_named_so(other))
            })
        };
        // Stable: of equals, the first in the bag.
        poses.sort_by_key(|topic| std::cmp::Reverse((has_sensors(topic), topic.table.rows)));
        let mut poses = poses.into_iter();
        let craft = poses.next();
        let mut loads = loads.into_iter();
        let load = loads.next();
        Self { craft, load, others: poses.chain(loads).collect() }
    }
}

/// Whether a part of a topic's name says that it is a load.
fn is_load(name: &str) -> bool {
    let name = name.to_lowercase();
    name.split(['/', '_']).any(|part| part.starts_with("load") || part.starts_with("payload"))
}
