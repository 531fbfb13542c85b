//! Effects of users: a name, a formula for each row it acts on, coefficients and constants with units, in a TOML file.
//!
//! ```toml
//! [[effect]]
//! id = "my-cable"
//! sentence = "A rubber cable pulls the craft towards a hook."
//! excitation = "hover at the corners of the flying space"
//! acceleration.north = "-stiffness * north / mass"
//! acceleration.east = "-stiffness * east / mass"
//! acceleration.down = "stiffness * (hook - down) / mass"
//! coefficient = [{ name = "stiffness", unit = "N/m", possible = [0.0, 100.0], typical = 1.0 }]
//! constant = [{ name = "hook", unit = "m", value = -1.0 }]
//! ```
//!
//! Rows: `u v w` (m/s^2, body) and `p q r` (rad/s^2, body) as in the equations of motion, and `north east down` (m/s^2),
//! which are turned into the body. Names in formulas are [`crate::QUANTITIES`], the effect's coefficients, its constants, and
//! further columns of flight files (`column = [{ name = "load_force", unit = "N" }]`, or one of [`USUAL_COLUMNS`]). Every formula must have its row's unit.
//!
//! A user's effect is then an effect like the others. Where its formulas are linear in the coefficients, it is regressed
//! directly; else it is fitted by Gauss and Newton's method from several starts: coefficients that enter linearly when the
//! others are given are solved for, the others (its *shape*) start about their typical values.
//!
//! Definitions are kept to the end of the program, [`MAX_DEFINITIONS`] at most: an effect can then be copied and compared as
//! those of the catalogue are. [`MAX_EFFECTS`] of them are known by their identifiers. This is the one thing that the library
//! keeps for itself.

mod arithmetic;
mod check;
mod columns;
mod definition;
mod dimension;
mod effect;
mod formula;
mod input;
mod names;
mod row;
mod scanner;
mod tape;
mod trace;
mod user;

pub use columns::{TIME_COLUMN, USUAL_COLUMNS, can_be_column, columns, place_of_column, usual_unit};
pub use definition::{
    CoefficientDefinition, ColumnDefinition, ConstantDefinition, Definition, MAX_COEFFICIENTS,
    MAX_DEFINITIONS, MAX_EFFECTS, MAX_FILE_BYTES, UserEffectError, file_of,
};
pub use effect::UserEffect;
pub use scanner::functions;
pub use user::{Undefined, User};
pub(crate) use user::{all, define, draft, draft_one, parse, read};
