//! Logs of other programs against what their own decoders find in them, and damaged ones.

mod ardupilot;
mod betaflight;
mod common;
mod crazyflie;
mod fuzz;
mod made_bags;
mod parquet;
mod px4;
mod ros;
mod tables;
