//! The whole program: real processes, a pseudo terminal, UDP, and files as the kernel's PWM
//! interface has them.

mod allocations;
mod common;
mod flood;
mod outputs;
mod process;
mod programs;
