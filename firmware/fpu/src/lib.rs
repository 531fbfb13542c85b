//! What a floating-point unit can do and Rust without its standard library cannot ask for: a square root in one instruction.
//!
//! It is a crate of its own because assembler is `unsafe`, and the flight law forbids that. [libm] will have the same
//! ([pull request 1300]) once it is released; then this crate can go.
//!
//! [libm]: https://crates.io/crates/libm
//! [pull request 1300]: https://github.com/rust-lang/compiler-builtins/pull/1300
#![no_std]
#![allow(unsafe_code, reason = "the instruction is reached by assembler alone")]

/// The square root, rounded as IEEE 754 wants it, where this is a build for an ARM with a floating-point unit; `None` elsewhere. Of a
/// number below 0 it is no number.
#[cfg(all(target_arch = "arm", target_abi = "eabihf", not(miri)))]
#[inline(always)]
pub fn square_root(x: f32) -> Option<f32> {
    let mut bits = x.to_bits();
    // Through an integer register: for a chip with single precision alone rustc has no class of float registers yet.
    // SAFETY: `vsqrt.f32` is in every ARM floating-point unit since version 2. It reads and writes s0, which is declared, and flags.
    unsafe {
        core::arch::asm!(
            "vmov s0, {x}",
            "vsqrt.f32 s0, s0",
            "vmov {x}, s0",
            x = inout(reg) bits,
            out("s0") _,
            options(pure, nomem, nostack)
        );
    }
    Some(f32::from_bits(bits))
}

/// There is none that this crate knows of.
#[cfg(not(all(target_arch = "arm", target_abi = "eabihf", not(miri))))]
#[inline(always)]
pub fn square_root(_x: f32) -> Option<f32> {
    None
}
