//! Control allocation: from thrust and angular accelerations to motor commands.

pub mod desaturation;
pub mod mixer;
pub mod motor_map;
