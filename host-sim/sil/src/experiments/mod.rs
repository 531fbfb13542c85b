//! Which flight to fly next: the library of manoeuvres, what a flight would tell, and a ranking by
//! that.

pub mod manoeuvre;
pub mod next_flight;
pub mod predict;
