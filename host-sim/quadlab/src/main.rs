//! `quadlab`: from flights to a model, and from a model that fails to the physical effect it lacks. All of it is in the library.
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    quadlab::main()
}
