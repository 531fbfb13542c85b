//! What Linux can do for a thread that must not be late: first-in-first-out scheduling and memory
//! that stays in place.
//!
//! Both need rights (root, or `LimitRTPRIO=` and `LimitMEMLOCK=` of the systemd unit). Without them
//! the loop runs anyway and says so: on a busy machine its ticks are then late, which telemetry
//! shows.

use rustix::mm::{MlockAllFlags, mlockall};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Asks for both, for the calling thread; returns one line on the result of each.
pub fn ask_for(priority: u8) -> [String; 2] {
    [scheduling(priority), memory()]
}

/// Gives the calling thread a real-time priority.
///
/// # Errors
/// Why not, in words.
pub fn schedule(priority: u8) -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let value = ThreadPriorityValue::try_from(priority).map_err(|error| error.to_string())?;
    set_thread_priority_and_policy(thread_native_id(), ThreadPriority::Crossplatform(value), policy)
        .map_err(|error| error.to_string())
}

fn scheduling(priority: u8) -> String {
    match schedule(priority) {
        Ok(()) => format!("the loop's thread has real-time priority {priority} (SCHED_FIFO)"),
        Err(why) => format!(
            "the loop's thread has no real-time priority ({why}): ticks will be late on a busy machine; run as root or give LimitRTPRIO"
        ),
    }
}

fn memory() -> String {
    match mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        Ok(()) => "its memory is locked (mlockall)".to_owned(),
        Err(why) => format!(
            "its memory may be swapped out ({why}): ticks may be late; run as root or give LimitMEMLOCK"
        ),
    }
}
