//! The columns of a flight file.

/// Columns of a flight file, in the order they are written.
pub const COLUMNS: [&str; 29] = [
    "t", "x", "y", "z", "phi", "theta", "psi", "p", "q", "r", "cmd1", "cmd2", "cmd3", "cmd4", "vbat",
    "omega1", "omega2", "omega3", "omega4", "ax", "ay", "az", "vx", "vy", "vz", "qw", "qx", "qy", "qz",
];

/// A column of a flight file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(usize)]
#[expect(missing_docs, reason = "the columns are documented in the README")]
pub enum Column {
    T,
    X,
    Y,
    Z,
    Phi,
    Theta,
    Psi,
    P,
    Q,
    R,
    Cmd1,
    Cmd2,
    Cmd3,
    Cmd4,
    Vbat,
    Omega1,
    Omega2,
    Omega3,
    Omega4,
    Ax,
    Ay,
    Az,
    Vx,
    Vy,
    Vz,
    Qw,
    Qx,
    Qy,
    Qz,
}
