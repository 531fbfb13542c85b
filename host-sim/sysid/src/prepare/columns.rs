//! Where each channel has its column while a flight is prepared.

pub(crate) const POSITION: usize = 0;
pub(crate) const EULER: usize = 3;
pub(crate) const RATE: usize = 6;
pub(crate) const COMMAND: usize = 9;
pub(crate) const BATTERY: usize = 13;
pub(crate) const OPTIONAL: usize = 14;
