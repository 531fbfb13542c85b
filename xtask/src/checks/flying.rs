//! What is linked into the programs that fly: no package that is not in this list, with what it is there for.
//!
//! A dependency is code of others that a craft stays in the air by. One that is new fails here until somebody has looked at it and written
//! down why it flies; one that has gone leaves the list. Which packages are reached, `cargo tree` says, for each program with the features and
//! the target it is built with: normal dependencies and those of their own, and macros that write code while others are compiled.

use std::collections::{BTreeMap, BTreeSet};

/// A program that flies.
pub(crate) struct Program {
    pub(crate) package: &'static str,
    pub(crate) target: &'static str,
    pub(crate) features: &'static str,
}

/// The programs that fly.
pub(crate) const PROGRAMS: [Program; 2] = [
    Program { package: "com", target: "armv7-unknown-linux-gnueabihf", features: "" },
    Program { package: "mcu", target: "thumbv7em-none-eabihf", features: "stm32f405" },
];

/// This list.
const LIST: &str = "xtask/src/checks/flying.rs";

/// Packages by what they are there for.
const ALLOWED: &[(&str, &[&str])] = &[
    (
        "our own",
        &["com", "control", "craft", "fpu", "gains-file", "mcu", "plain-line", "proto", "proto-files"],
    ),
    ("transcendental functions, the same bits everywhere", &["libm"]),
    (
        "nalgebra: matrices of the estimator and the mixer, of fixed size",
        &[
            "approx",
            "nalgebra",
            "num-complex",
            "num-integer",
            "num-rational",
            "num-traits",
            "simba",
            "typenum",
        ],
    ),
    ("serde: configurations and messages as values", &["serde", "serde_core"]),
    ("postcard: messages and the microcontroller's configuration as bytes", &["cobs", "postcard"]),
    ("thiserror: sentences of errors", &["thiserror"]),
    ("lists of fixed size, without allocation", &["byteorder", "hash32", "heapless", "stable_deref_trait"]),
    ("sums over packets", &["crc", "crc-catalog"]),
    (
        "HMAC-SHA-256: tags of packets; hashes of the craft's files",
        &[
            "block-buffer",
            "cfg-if",
            "cmov",
            "crypto-common",
            "ctutils",
            "digest",
            "hmac",
            "hybrid-array",
            "sha2",
        ],
    ),
    (
        "traits of drivers, so that they are tested without a chip",
        &["embedded-hal", "embedded-io", "nb", "void"],
    ),
    (
        "Linux' calls: clock, serial line, sockets, real-time scheduling",
        &["bitflags", "errno", "libc", "linux-raw-sys", "log", "nix", "rustix", "socket2", "thread-priority"],
    ),
    ("random bytes of a link's session", &["getrandom"]),
    ("a guardian in a process of its own", &["fork"]),
    ("systemd hears that the loop lives", &["sd-notify"]),
    ("an orderly end when asked to stop", &["signal-hook", "signal-hook-registry"]),
    (
        "gains, vehicle and configuration are TOML files, read before flight",
        &["serde_spanned", "toml", "toml_datetime", "toml_parser", "toml_writer", "winnow"],
    ),
    (
        "a simulator hands over its configuration as JSON; not while flying",
        &["itoa", "memchr", "serde_json", "zmij"],
    ),
    (
        "arguments of the command, before flight",
        &[
            "anstream",
            "anstyle",
            "anstyle-parse",
            "anstyle-query",
            "clap",
            "clap_builder",
            "clap_lex",
            "colorchoice",
            "is_terminal_polyfill",
            "strsim",
            "terminal_size",
            "utf8parse",
        ],
    ),
    (
        "start and registers of the Cortex-M4",
        &[
            "bare-metal",
            "bitfield",
            "cortex-m",
            "cortex-m-rt",
            "cortex-m-semihosting",
            "critical-section",
            "portable-atomic",
            "vcell",
            "volatile-register",
        ],
    ),
    (
        "peripherals of the STM32F405",
        &[
            "deranged",
            "embedded-dma",
            "embedded-hal-bus",
            "embedded-hal-nb",
            "embedded-storage",
            "enumflags2",
            "fugit",
            "fugit-timer",
            "gcd",
            "num-conv",
            "powerfmt",
            "rand_core",
            "stm32f4",
            "stm32f4xx-hal",
            "time",
            "time-core",
        ],
    ),
    (
        "macros that write code of the above while it is compiled, and what they are made of",
        &[
            "clap_derive",
            "cortex-m-macros",
            "cortex-m-rt-macros",
            "document-features",
            "enumflags2_derive",
            "heck",
            "litrs",
            "proc-macro2",
            "quote",
            "rustversion",
            "serde_derive",
            "syn",
            "thiserror-impl",
            "unicode-ident",
        ],
    ),
];

/// What flies and is not listed, and what is listed and does not fly; `reached` are the packages of each program.
pub(crate) fn check(reached: &BTreeMap<&str, BTreeSet<String>>) -> Vec<String> {
    problems(reached, ALLOWED)
}

fn problems(reached: &BTreeMap<&str, BTreeSet<String>>, allowed: &[(&str, &[&str])]) -> Vec<String> {
    let listed: BTreeSet<&str> = allowed.iter().flat_map(|(_, packages)| *packages).copied().collect();
    let mut problems = Vec::new();
    for (program, packages) in reached {
        for package in packages.iter().filter(|package| !listed.contains(package.as_str())) {
            problems.push(format!(
                "{package} flies in {program} and is not in {LIST}: look at it and add it with what it is there for, or do without \
                 (`cargo tree -p {program} -e normal --target all -i {package}` shows who wants it)"
            ));
        }
    }
    for package in listed {
        if !reached.values().any(|packages| packages.contains(package)) {
            problems.push(format!("{LIST}: {package} does not fly any more: delete it there"));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_new_and_what_is_gone_is_named_with_the_program() {
        let set = |names: &[&str]| names.iter().map(ToString::to_string).collect::<BTreeSet<_>>();
        let reached = BTreeMap::from([("com", set(&["libm", "new"])), ("mcu", set(&["libm"]))]);
        let found = problems(&reached, &[("functions", &["libm"]), ("of yore", &["gone"])]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(
            found[0].starts_with("new flies in com") && found[1].contains("gone does not fly"),
            "{found:?}"
        );
        assert_eq!(problems(&reached, &[("all", &["libm", "new"])]), [""; 0]);
    }

    #[test]
    fn nothing_is_listed_twice() {
        let all: Vec<&str> = ALLOWED.iter().flat_map(|(_, packages)| *packages).copied().collect();
        assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len());
    }
}
