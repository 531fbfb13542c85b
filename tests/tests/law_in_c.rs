//! The flight law in a program in C: gains that `quadlab export --to c` wrote, the static library, a real compiler.
#![forbid(unsafe_code)]

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command as Process, Stdio};

use control::controller::Controller;
use control::readings::{Command, Measurement, Mode};
use gains_file::Gains;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use tempfile::TempDir;

/// What the tests need to see of the library: that it is linked at all makes cargo build it.
use quadlab_law as _;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

/// The newest static library that cargo built for this test.
fn library() -> PathBuf {
    let built = std::env::current_exe().unwrap().parent().unwrap().to_owned();
    let folders = [built.join(".."), built.clone(), built.join("deps")];
    let files = folders.iter().filter_map(|folder| std::fs::read_dir(folder).ok()).flatten();
    let paths = files.filter_map(|file| Some(file.ok()?.path()));
    let is_library = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        name.starts_with("libquadlab_law") && name.ends_with(".a")
    };
    let newest = paths.filter(is_library).max_by_key(|path| path.metadata().and_then(|m| m.modified()).ok());
    newest.expect("cargo builds libquadlab_law.a with this test")
}

/// Compiles a program of these sources with gains as the user's command writes them; nothing (and a line that says so) without a compiler.
fn compiled(folder: &Path, sources: &[&Path]) -> Option<PathBuf> {
    if Process::new("cc").arg("--version").output().is_err() {
        println!("SKIPPED: there is no C compiler (cc)");
        return None;
    }
    let vehicles = root().join("host-sim/model/vehicles");
    let output = Process::new(stories::program("quadlab"))
        .args(["export", "--to", "c", "--model"])
        .args([&vehicles.join("f330-model.toml"), Path::new("--gains"), &vehicles.join("f330-gains.toml")])
        .args([Path::new("--out"), &folder.join("quadlab_gains.h")])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let program = folder.join("program");
    let strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O2"];
    let output = Process::new("cc")
        .args(strict)
        .arg("-I")
        .arg(root().join("firmware/law-c/include"))
        .arg("-I")
        .arg(folder)
        .args(sources)
        .arg(library())
        .args(["-lm", "-lpthread", "-ldl", "-o"])
        .arg(&program)
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    Some(program)
}

/// What a program answers to bytes.
fn answered(program: &Path, asked: Vec<u8>) -> Vec<u8> {
    let mut child = Process::new(program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::inherit())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(&asked));
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap().unwrap();
    assert!(output.status.success(), "{:?}", output.status);
    output.stdout
}

/// 21 numbers as the block takes them: a flight that wanders, with a gyro that is missing at times, and nonsense at others.
fn inputs(count: usize) -> Vec<[f32; 21]> {
    let seed = 29;
    println!("seed {seed}");
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut state = [0.0f32; 21];
    (0..count)
        .map(|tick| {
            for (k, value) in state.iter_mut().enumerate() {
                let step = if k < 9 { 1e-4 } else { 1e-3 };
                *value = 0.995 * *value + step * (2.0 * rng.random::<f32>() - 1.0);
            }
            let mut now = state;
            now[9] += 11.1;
            now[10] = f32::from(u8::from(tick / 500 % 2 == 1));
            now[2] -= 1.0;
            now[16] -= 1.0;
            if tick % 97 == 0 {
                now[6] = f32::NAN;
            }
            if tick % 1009 == 1008 {
                let place = rng.random_range(0..21);
                now[place] = f32::from_bits(rng.random());
            }
            now
        })
        .collect()
}

/// What the law itself says.
fn expected(inputs: &[[f32; 21]]) -> Vec<[f32; 4]> {
    let gains = Gains::read(&root().join("host-sim/model/vehicles/f330-gains.toml")).unwrap();
    let mut law = Controller::new(&gains.config).unwrap();
    let three = |i: &[f32; 21], from: usize| [i[from], i[from + 1], i[from + 2]];
    let tick = |i: &[f32; 21]| {
        let gyro = three(i, 6);
        let measurement = Measurement {
            position_m: three(i, 0),
            attitude_rad: three(i, 3),
            gyro_rad_s: gyro.iter().all(|rate| rate.is_finite()).then_some(gyro),
            battery_v: i[9],
        };
        let command = Command {
            mode: if i[10] == 0.0 { Mode::Attitude } else { Mode::Position },
            attitude_rad: [i[11], i[12]],
            yaw_rad: i[13],
            position_m: [i[14], i[15]],
            z_m: i[16],
            cut_off: false,
            injection: [i[17], i[18], i[19], i[20]],
        };
        law.tick(&measurement, &command).pwm
    };
    inputs.iter().map(tick).collect()
}

/// Twenty thousand ticks, the last bit of each command: it is the same code.
#[test]
fn a_program_in_c_has_the_bits_of_the_law_that_flies() {
    let folder = TempDir::new().unwrap();
    let main = folder.path().join("main.c");
    let text = r#"
        #include <stdio.h>
        #include "quadlab_block.h"
        int main(void) {
            float inputs[21] = {0}, commands[4];
            if (quadlab_block(inputs, inputs + 10, commands) != 4) return 2; /* not started yet */
            if (quadlab_block_start() != 0) return 1;
            while (fread(inputs, sizeof inputs, 1, stdin) == 1) {
                if (quadlab_block(inputs, inputs + 10, commands) != 0) return 1;
                fwrite(commands, sizeof commands, 1, stdout);
            }
            return 0;
        }
    "#;
    std::fs::write(&main, text).unwrap();
    let block = root().join("firmware/law-c/include/quadlab_block.c");
    let Some(program) = compiled(folder.path(), &[&main, &block]) else { return };
    let inputs = inputs(20_000);
    let bytes = inputs.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    let found = answered(&program, bytes);
    let expected = expected(&inputs);
    assert_eq!(found.len(), 16 * expected.len());
    let bits: Vec<u32> =
        found.chunks_exact(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect();
    let own: Vec<u32> = expected.iter().flatten().map(|value| value.to_bits()).collect();
    assert_eq!(bits, own);
    let distinct: std::collections::BTreeSet<u32> = bits.iter().copied().collect();
    assert!(distinct.len() > 10_000, "the law moves: {} values", distinct.len());
}

/// What cannot be is refused with a number, in every function.
#[test]
fn a_program_in_c_is_told_what_is_wrong() {
    let folder = TempDir::new().unwrap();
    let main = folder.path().join("main.c");
    let text = r#"
        #include <stdio.h>
        #include <string.h>
        #include "quadlab_gains.h"
        #include "quadlab_law.h"
        static quadlab_law law, copy;
        static quadlab_inputs still;
        int main(void) {
            uint8_t bad[sizeof quadlab_gains];
            float commands[4] = {9, 9, 9, 9}, again[4];
            still.battery_v = 11.1f;
            if (quadlab_law_tick(&law, &still, commands) != QUADLAB_NOT_STARTED || commands[0] != 0) return 1;
            if (quadlab_law_reset(&law) != QUADLAB_NOT_STARTED || quadlab_law_reset(NULL) != QUADLAB_NULL) return 2;
            if (quadlab_law_start(NULL, quadlab_gains, sizeof quadlab_gains) != QUADLAB_NULL) return 3;
            if (quadlab_law_start(&law, NULL, 0) != QUADLAB_NULL) return 4;
            memcpy(bad, quadlab_gains, sizeof bad);
            bad[100] ^= 1;
            if (quadlab_law_start(&law, bad, sizeof bad) != QUADLAB_NO_IMAGE) return 5;
            if (quadlab_law_start(&law, quadlab_gains, 20) != QUADLAB_NO_IMAGE) return 6;
            if (quadlab_law_start(&law, quadlab_gains, sizeof quadlab_gains) != QUADLAB_DONE) return 7;
            if (quadlab_law_tick(&law, NULL, commands) != QUADLAB_NULL) return 8;
            if (quadlab_law_tick(&law, &still, NULL) != QUADLAB_NULL) return 9;
            copy = law;
            if (quadlab_law_tick(&law, &still, commands) != QUADLAB_DONE || commands[0] < 1000) return 10;
            if (quadlab_law_tick(&copy, &still, again) != QUADLAB_DONE || memcmp(commands, again, sizeof again)) return 11;
            if (quadlab_law_tick(&law, &still, again) != QUADLAB_DONE || quadlab_law_reset(&law) != QUADLAB_DONE) return 12;
            if (quadlab_law_tick(&law, &still, again) != QUADLAB_DONE || memcmp(commands, again, sizeof again)) return 13;
            if (quadlab_law_start(&law, bad, sizeof bad) != QUADLAB_NO_IMAGE) return 14;
            if (quadlab_law_tick(&law, &still, commands) != QUADLAB_NOT_STARTED) return 15;
            printf("%g", QUADLAB_SAMPLE_TIME_S);
            return 0;
        }
    "#;
    std::fs::write(&main, text).unwrap();
    let Some(program) = compiled(folder.path(), &[&main]) else { return };
    assert_eq!(answered(&program, Vec::new()), b"0.01");
}
