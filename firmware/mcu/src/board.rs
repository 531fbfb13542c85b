//! What a program needs of a board.

use proto::ImuSample;

/// The hardware of a craft.
pub trait Board {
    /// The wire to the ground. Writing takes all bytes or none, and does not wait.
    type Link: embedded_io::Read + embedded_io::ReadReady + embedded_io::Write;

    /// The wire to the ground.
    fn link(&mut self) -> &mut Self::Link;
    /// Monotonic time in us, modulo 2^32.
    fn now_us(&mut self) -> u32;
    /// Sleeps until something happens: a byte, or the next period.
    fn wait(&mut self);
    /// The newest IMU sample, if there is one.
    fn imu(&mut self) -> Option<ImuSample>;
    /// Battery voltage, V; NaN if it cannot be measured.
    fn battery_v(&mut self) -> f32;
    /// Battery current, A, if it is measured.
    fn current_a(&mut self) -> Option<f32>;
    /// Motor commands to the outputs, in command units: did all of them work?
    fn drive(&mut self, commands: &[f32; 4]) -> bool;
    /// Random bytes, new at each start; none if there is no source of them.
    fn random(&mut self) -> Option<[u8; 32]>;
    /// Tells the watchdog that the loop runs.
    fn feed_watchdog(&mut self);
}
