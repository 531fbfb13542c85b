//! The law on the craft's processors, in QEMU: the same bits as here.
//!
//! `cargo xtask test` builds the programs and names them in variables; without them, these tests
//! say what they leave out.

use std::path::{Path, PathBuf};

use control::Config;
use control::gains::Law;
use sil::same_bits::{Flown, fly_all};
use sil::{Emulation, Processor, Scenario, Settings, Suite, Transport};

/// The program in this variable.
fn program(variable: &str) -> Option<PathBuf> {
    let path = std::env::var_os(variable).map(PathBuf::from);
    if path.is_none() {
        println!(
            "SKIPPED: {variable} is not set: `cargo xtask test` builds the ARM programs where `cargo xtask setup` was run"
        );
    }
    path
}

/// Every motor command and every internal term of three flights of a minute each.
fn same_bits(processor: Processor, program: &Path) {
    for flown in fly_all(1).unwrap() {
        let difference = flown.replay(processor, program, &flown.config).unwrap();
        assert_eq!(difference, None, "{} on {}", flown.name, processor.name());
        println!(
            "{}, {}: {} ticks, sha256 {}",
            processor.name(),
            flown.name,
            flown.ticks.len(),
            flown.sha256()
        );
    }
}

/// The comparison would see a difference: the least change of one gain, one unit in the last place
/// of f32.
fn a_gain_that_differs_in_its_last_place_is_seen(processor: Processor, program: &Path) {
    let flown: Flown = fly_all(1).unwrap().swap_remove(1);
    let mut config: Config = flown.config;
    let Law::ModelBased(law) = &mut config.law else { panic!("the thesis' law") };
    law.loops.yaw.kd = f64::from((law.loops.yaw.kd as f32).next_up());
    let difference = flown.replay(processor, program, &config).unwrap().expect("other gains fly otherwise");
    assert!(difference.tick < 100, "{difference:?}");
}

#[test]
fn armv7_computes_the_same_bits() {
    let Some(program) = program("QUADLAB_ARMV7_LOCKSTEP") else { return };
    same_bits(Processor::Armv7, &program);
    a_gain_that_differs_in_its_last_place_is_seen(Processor::Armv7, &program);
}

#[test]
fn the_cortex_m4_computes_the_same_bits() {
    let Some(program) = program("QUADLAB_CORTEX_M4_LOCKSTEP") else { return };
    same_bits(Processor::CortexM4, &program);
    a_gain_that_differs_in_its_last_place_is_seen(Processor::CortexM4, &program);
}

/// Short scenarios in lockstep: a step with noise, and a reference without.
fn flies_the_same(processor: Processor, program: PathBuf) {
    let transport = Transport::Emulated(Emulation { processor, program });
    for (scenario, seed) in [(Scenario::Pitch10, 3), (Scenario::Yaw30, 4)] {
        let settings = Settings { noise: Some(sil::NoiseModel::default()), seed, ..Settings::default() };
        let fly = |transport| Suite::fly(&[scenario], &settings, transport, |_| {}).unwrap();
        assert_eq!(fly(&transport).to_json(), fly(&Transport::InProcess).to_json(), "{}", processor.name());
    }
}

#[test]
fn the_craft_computers_program_flies_like_the_law_in_process() {
    let Some(program) = program("QUADLAB_ARMV7_COM") else { return };
    flies_the_same(Processor::Armv7, program);
}

#[test]
fn the_microcontroller_flies_like_the_law_in_process() {
    let Some(program) = program("QUADLAB_CORTEX_M4_LOCKSTEP") else { return };
    flies_the_same(Processor::CortexM4, program);
}
