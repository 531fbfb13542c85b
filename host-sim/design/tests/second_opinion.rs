//! Other programs' opinions on the same loops: python-control and GNU Octave's control package build
//! them from polynomials and give poles and margins. python-control is looked for in
//! `QUADLAB_PYTHON`, in `target/peers` (`cargo xtask setup`) and in `python3`; without either
//! program the test says so and passes.

use std::path::{Path, PathBuf};
use std::process::Command;

use control::Config;
use design::Complex;
use design::analysis::LoopMargins;
use design::loops::{ClosedLoop, LoopName, LoopPlant, View};

const ROLL: [f64; 4] = [1.0, -0.9888, 0.2274, 37.03];

/// Prints `pm_deg wc gm wp` of the continuous and of the sampled roll loop (2 samples late), then
/// the poles of the first.
const PYTHON: &str = r#"
import control as c, numpy as np, warnings
warnings.simplefilter("ignore")
s = c.tf("s")
G = c.tf([1, .2149], [1, -.9888, .2274, 37.03]) * 21.5 / (s + 21.5)
V = 5625 * s / (s * s + 150 * s + 5625)
C = (100 + 100 / s) * (s / .6 + 1) / (s / .2149 + 1)
# One fraction instead of a product of many, so that nothing has to cancel.
n, d = G.num[0][0], G.den[0][0]
vn, vd = V.num[0][0], V.den[0][0]
L = C * c.tf(np.polymul(n, vd), np.polyadd(np.polymul(d, vd), 10 * np.polymul(n, vn)))
gm, pm, wp, wc = c.margin(L)
print(pm, wc, gm, wp)
T = .01
P = c.c2d(c.ss(G), T, "zoh") if hasattr(c, "c2d") else c.sample_system(c.ss(G), T, "zoh")
k = 29.64339514471
v = c.ss(c.tf([k, -k], [1, -.94473310548203, .22313016014843], T))
lag = c.ss(c.tf([.35885651173821, -.35670981918552], [1, -.9978533074473], T))
pi = c.ss(c.tf([101., -100.], [1, -1], T))
late = c.ss(c.tf([1], [1, 0, 0], T))
PL = late * P
L = c.feedback(PL, 10 * v) * lag * pi
gm, pm, wp, wc = c.margin(L)
print(pm, wc, gm, wp)
den = np.polyadd(np.polymul(np.polymul([1, 0], np.polymul([1 / .2149, 1], vd)), d), np.polymul(np.polymul(np.polymul([100, 100], [1 / .6, 1]), vd), n))
den = np.polyadd(den, 10 * np.polymul(np.polymul(np.polymul([1, 0], [1 / .2149, 1]), vn), n))
print(*[x for p in np.roots(den) for x in (p.real, p.imag)])
"#;

const OCTAVE: &str = r#"
pkg load control; warning("off", "all");
G = tf([1 .2149], [1 -.9888 .2274 37.03]) * tf(21.5, [1 21.5]);
V = tf([5625 0], [1 150 5625]);
C = tf([100 100], [1 0]) * tf([1/.6 1], [1/.2149 1]);
L = C * feedback(G, 10 * V);
[gm, pm, wp, wc] = margin(L); printf("%.9g %.9g %.9g %.9g\n", pm, wc, gm, wp);
T = .01; k = 29.64339514471;
P = c2d(ss(G), T, "zoh");
v = ss(tf([k -k], [1 -.94473310548203 .22313016014843], T));
lag = ss(tf([.35885651173821 -.35670981918552], [1 -.9978533074473], T));
pi_ = ss(tf([101 -100], [1 -1], T));
late = ss(tf(1, [1 0 0], T));
L = feedback(late * P, 10 * v) * lag * pi_;
% Octave's own margin goes by way of a transfer function, of which too few digits are left here.
at = @(w) squeeze(freqresp(L, w));
w = logspace(-1, log10(pi / T), 2000);
crossed = find(diff(sign(abs(at(w)(:)) - 1)) < 0, 1, "last");
wc = fzero(@(w) abs(at(w)) - 1, w(crossed + [0 1]));
beyond = w(w > wc); im = imag(at(beyond)(:));
turned = find(im(1:end-1) < 0 & im(2:end) >= 0, 1);
wp = fzero(@(w) imag(at(w)), beyond(turned + [0 1]));
printf("%.9g %.9g %.9g %.9g\n", 180 + arg(at(wc)) * 180 / pi, wc, 1 / abs(at(wp)), wp);
p = pole(feedback(C * feedback(G, 10 * V), 1)); printf("%.9g ", [real(p) imag(p)]'); printf("\n");
"#;

/// Lines of numbers from each program that is there, with its name.
fn opinions() -> Vec<(&'static str, Vec<Vec<f64>>)> {
    let peers = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/peers/bin/python");
    let pythons =
        [std::env::var_os("QUADLAB_PYTHON").map(PathBuf::from), Some(peers), Some("python3".into())];
    let has = |program: &PathBuf, arguments: &[&str]| {
        Command::new(program).args(arguments).output().is_ok_and(|output| output.status.success())
    };
    let python =
        pythons.into_iter().flatten().find(|python| has(python, &["-c", "import control; control.margin"]));
    let octave =
        Some(PathBuf::from("octave-cli")).filter(|octave| has(octave, &["--eval", "pkg load control"]));
    let asked = [
        python.map(|python| ("python-control", python, ["-c", PYTHON])),
        octave.map(|octave| ("GNU Octave", octave, ["--eval", OCTAVE])),
    ];
    asked
        .into_iter()
        .flatten()
        .map(|(name, program, arguments)| (name, told(name, &program, arguments)))
        .collect()
}

fn told(name: &str, program: &Path, arguments: [&str; 2]) -> Vec<Vec<f64>> {
    let output =
        Command::new(program).args(arguments).output().expect("the program that was just asked runs");
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let numbers = |line: &str| line.split_whitespace().map(|x| x.parse().expect("a number")).collect();
    text.lines().map(numbers).collect()
}

#[test]
fn other_programs_find_the_same_margins_and_poles() {
    let opinions = opinions();
    if opinions.is_empty() {
        // Asked where it is installed; the published numbers in `thesis.rs` are checked everywhere.
        println!(
            "SKIPPED: neither python-control nor GNU Octave with its control package is installed: cargo xtask setup"
        );
    }
    for (name, lines) in opinions {
        compare(name, &lines);
    }
}

fn compare(name: &str, lines: &[Vec<f64>]) {
    let plant = LoopPlant::of_transfer(&[1.0, 0.2149], &ROLL, None, Some(21.5)).unwrap();
    let views = [View::Continuous, View::Sampled { delay_samples: 2 }];
    for (view, line) in views.into_iter().zip(lines) {
        let closed = ClosedLoop::new(&Config::thesis(), &plant, LoopName::Roll, view).unwrap();
        let margins = LoopMargins::of(&closed).unwrap().at_error;
        let ours = [
            margins.phase_margin_deg.unwrap(),
            margins.crossover_rad_s.unwrap(),
            margins.gain_margin.unwrap(),
            margins.phase_crossover_rad_s.unwrap(),
        ];
        for (got, want) in ours.iter().zip(line) {
            // Theirs comes from the roots of a polynomial of degree 16 and more: six digits are
            // left of it, and the sampled filters were given to 14.
            assert!((got / want - 1.0).abs() < 2e-5, "{name} {view:?}: {ours:?} against {line:?}");
        }
    }
    let closed = ClosedLoop::new(&Config::thesis(), &plant, LoopName::Roll, View::Continuous).unwrap();
    let poles = closed.closed.poles().unwrap();
    let theirs: Vec<Complex<f64>> = lines[2].chunks(2).map(|p| Complex::new(p[0], p[1])).collect();
    assert_eq!(poles.len(), theirs.len());
    for pole in &poles {
        let nearest = theirs.iter().map(|p| (p - pole).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 1e-6 * pole.norm().max(1.0), "{name}: {pole} is not among {theirs:?}");
    }
    println!("{name} agrees");
}
