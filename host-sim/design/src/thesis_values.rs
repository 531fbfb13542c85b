//! What the thesis prints of its linear model and loops, beside what is found here for a model and
//! its gains.
//!
//! Only numbers in its text and tables: its figures are not part of it any more. For the thesis'
//! vehicle and gains each number has to come back within [`Compared::tolerance`]; for another craft
//! the printed ones are there to compare with.

use model::Model;
use schemars::JsonSchema;
use serde::Serialize;

use crate::analysis::{Study, closed_bode};
use crate::check::CheckReport;
use crate::error::Result;
use crate::loops::LoopName;
use crate::plant::{CANCEL_TOLERANCE, CHANNELS, Linear, TrimTarget, with_perturbation};

/// A printed number and the one found.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Compared {
    /// Where it is printed: equation, figure or table.
    pub place: &'static str,
    /// What it is.
    pub what: String,
    /// Its unit.
    pub unit: &'static str,
    /// As printed.
    pub printed: f64,
    /// Found here; absent where this craft has no such number.
    pub found: Option<f64>,
    /// How far apart they may be for the thesis' own vehicle.
    pub tolerance: f64,
    /// Why they are not equal, where it is more than rounding.
    pub why: &'static str,
}

impl Compared {
    /// Whether the number came back.
    pub fn holds(&self) -> bool {
        self.found.is_some_and(|found| (found - self.printed).abs() <= self.tolerance)
    }
}

/// Table A.1: the plant's zero, phase margin, crossover.
pub const TABLE_A1: [[f64; 3]; 16] = [
    [0.2149, 47.6555, 5.3531],
    [0.0, 47.6618, 5.2146],
    [0.05, 47.6598, 5.2463],
    [0.1, 47.6582, 5.2783],
    [0.15, 47.6570, 5.3106],
    [0.2, 47.6558, 5.3433],
    [0.25, 47.6546, 5.3764],
    [0.3, 47.6531, 5.4098],
    [0.35, 47.6510, 5.4436],
    [0.4, 47.6483, 5.4777],
    [0.5, 47.6400, 5.5472],
    [0.6, 47.6262, 5.6182],
    [0.7, 47.5912, 5.6936],
    [0.8, 47.5626, 5.7674],
    [0.9, 47.5305, 5.8416],
    [1.0, 47.4733, 5.9198],
];

/// Numerators and denominators of (5.17) to (5.22) in descending powers of s, signs as the errata
/// have them.
type Printed = (&'static str, LoopName, &'static [f64], &'static [f64]);
const TRANSFER: [Printed; 6] = [
    ("(5.17)", LoopName::Y, &[0.134, 9.808], &[1.0, -0.9888, 0.2274, 37.03, 0.0]),
    ("(5.18)", LoopName::X, &[-0.1414, -9.808], &[1.0, -1.769, -0.01226, 27.05, 0.0]),
    ("(5.19)", LoopName::Z, &[-0.8237], &[1.0, 0.2149, 0.0]),
    ("(5.20)", LoopName::Roll, &[1.0, 0.2149], &[1.0, -0.9888, 0.2274, 37.03]),
    ("(5.21)", LoopName::Pitch, &[1.0, 0.2076], &[1.0, -1.769, -0.01226, 27.05]),
    ("(5.22)", LoopName::Yaw, &[1.0], &[1.0, 0.4833, 0.0]),
];

/// The greatest magnitude of a loop from its reference, above its value at rest: frequency, rad/s.
fn resonance_rad_s(study: &Study, name: LoopName) -> Result<Option<f64>> {
    let Some((_, closed)) = study.loops.iter().find(|(_, closed)| closed.name == name) else {
        return Ok(None);
    };
    let [bare, _] = closed_bode(closed)?;
    let peak = bare.iter().max_by(|a, b| a.magnitude_db.total_cmp(&b.magnitude_db));
    Ok(peak.filter(|p| p.magnitude_db > 0.0).map(|p| p.frequency_rad_s))
}

/// Every printed number of the linear model and the continuous loops. `report` and `study` are of
/// the continuous view.
pub fn compare(model: &Model, study: &Study, report: &CheckReport) -> Result<Vec<Compared>> {
    let linear = &study.linear;
    let mut list = transfer_functions(linear)?;
    list.insert(0, hover(linear));
    list.push(steep_gravity(model)?);
    for (place, name) in [("5.3.1, Fig. 5.9", LoopName::Roll), ("5.3.1, Fig. 5.9", LoopName::Pitch)] {
        list.push(Compared {
            place,
            what: format!("{name}: resonance of the closed loop"),
            unit: "rad/s",
            printed: 4.5,
            found: resonance_rad_s(study, name)?,
            tolerance: 0.5,
            why: "\"around 4.5\", read off a plot",
        });
    }
    list.extend(steps(report));
    for (name, printed) in [("x", 1.17), ("y", 1.12)] {
        let found = report.loops.iter().find(|l| l.name == name).and_then(|l| l.crossover_rad_s);
        list.push(Compared {
            place: "5.4, Fig. 5.23",
            what: format!("{name}: gain crossover"),
            unit: "rad/s",
            printed,
            found,
            tolerance: 0.01,
            why: "",
        });
    }
    list.extend(table_a1(report));
    Ok(list)
}

fn hover(linear: &Linear) -> Compared {
    Compared {
        place: "(5.14)",
        what: "thrust at hover".into(),
        unit: "N",
        printed: 11.9093,
        found: Some(linear.equilibrium.inputs[0]),
        tolerance: 1e-4,
        why: "",
    }
}

/// The 9.808 of (5.16) is the sine of two degrees over its angle.
fn steep_gravity(model: &Model) -> Result<Compared> {
    let step = 2_f64.to_radians();
    let linear = with_perturbation(model, &TrimTarget::default(), step)?;
    Ok(Compared {
        place: "(5.16)",
        what: "gravity in A, by a difference over 2 degrees".into(),
        unit: "m/s^2",
        printed: 9.808,
        found: Some(linear.a[(4, 6)]),
        tolerance: 1e-4,
        why: "the exact derivative is 9.81: the thesis' A is a finite difference",
    })
}

fn transfer_functions(linear: &Linear) -> Result<Vec<Compared>> {
    let mut list = Vec::new();
    for (place, name, numerator, denominator) in TRANSFER {
        let channel = linear.channel(CHANNELS[name as usize], CANCEL_TOLERANCE)?;
        for (part, printed, found) in [
            ("numerator", numerator, channel.numerator()),
            ("denominator", denominator, channel.denominator()),
        ] {
            let fits = printed.len() == found.len();
            for (k, printed) in printed.iter().enumerate() {
                // What the form itself gives is no number of the thesis.
                if *printed == 0.0 || (*printed == 1.0 && k == 0) {
                    continue;
                }
                let power = found.len().saturating_sub(1 + k);
                let (share, why) = match (name, *printed) {
                    (LoopName::Roll, 0.2149) => (
                        0.03,
                        "the true zero is the side drag over the mass, 0.2211; a loose cancellation left the heave drag's",
                    ),
                    (_, -0.01226) => (0.011, "a small difference of the coupled block; A is printed rounded"),
                    _ => (3e-4, ""),
                };
                list.push(Compared {
                    place,
                    what: format!("{name}: {part}, s^{power}"),
                    unit: "",
                    printed: *printed,
                    found: fits.then(|| found[k]),
                    tolerance: share * printed.abs(),
                    why,
                });
            }
        }
    }
    Ok(list)
}

/// Overshoots and rise times of 5.3.3 and 5.4.
fn steps(report: &CheckReport) -> Vec<Compared> {
    let of = |name: &str| report.steps.iter().find(|s| s.name == name).map(|s| s.commanded);
    let row = |place, name: &str, rise: bool, printed: f64, tolerance: f64, why| Compared {
        place,
        what: format!("{name}: {} of a commanded step", if rise { "rise" } else { "overshoot" }),
        unit: if rise { "s" } else { "%" },
        printed,
        found: of(name).and_then(|m| if rise { m.rise_s } else { Some(m.overshoot_percent) }),
        tolerance,
        why,
    };
    let round = "printed in whole per cent; 1 m, which is not printed either";
    vec![
        row("5.3.3, Fig. 5.15", "z", false, 2.15, 0.02, ""),
        row("5.3.3, Fig. 5.15", "z", true, 1.24, 0.005, ""),
        row("5.3.3, Fig. 5.15", "yaw", false, 3.54, 0.02, ""),
        row("5.3.3, Fig. 5.15", "yaw", true, 0.665, 0.005, ""),
        row("5.4, Fig. 5.24", "x", false, 15.0, 0.5, round),
        row("5.4, Fig. 5.24", "y", false, 17.0, 0.5, round),
    ]
}

fn table_a1(report: &CheckReport) -> Vec<Compared> {
    let rows = TABLE_A1.iter().flat_map(|&[zero, phase, crossover]| {
        let found =
            report.moved_zero.iter().find(|row| row.name == "roll" && (row.zero_rad_s - zero).abs() < 1e-9);
        let first = Compared {
            place: "Table A.1",
            what: format!("roll: phase margin, plant zero at {zero} rad/s"),
            unit: "deg",
            printed: phase,
            found: found.and_then(|row| row.phase_margin_deg),
            tolerance: 0.02,
            why: "",
        };
        let second = Compared {
            what: format!("roll: crossover, plant zero at {zero} rad/s"),
            unit: "rad/s",
            printed: crossover,
            found: found.and_then(|row| row.crossover_rad_s),
            tolerance: 0.003,
            ..first.clone()
        };
        [first, second]
    });
    rows.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{CheckOptions, check};
    use crate::loops::View;
    use control::Config;

    fn compared(config: &Config) -> Vec<Compared> {
        let model = Model::thesis();
        let options = CheckOptions { view: View::Continuous, samples: 0, seed: 0 };
        let report = check(&model, config, &options).unwrap();
        compare(&model, &Study::new(&model, config, View::Continuous).unwrap(), &report).unwrap()
    }

    /// Tolerances are those that the reference suggests for a recomputation.
    #[test]
    fn every_printed_number_comes_back_on_the_thesis_vehicle() {
        let list = compared(&Config::thesis());
        let missed: Vec<_> = list.iter().filter(|c| !c.holds()).collect();
        assert!(missed.is_empty(), "{missed:#?}");
        // Hover, gravity, 21 coefficients, 2 resonances, 6 of steps, 2 crossovers, 32 of Table A.1.
        assert_eq!(list.len(), 65);
    }

    #[test]
    fn other_gains_do_not_come_back() {
        let mut config = Config::thesis();
        crate::loops::loops_of_mut(&mut config).yaw.kp *= 1.1;
        let missed: Vec<_> = compared(&config).into_iter().filter(|c| !c.holds()).collect();
        assert!(!missed.is_empty() && missed.iter().all(|c| c.what.starts_with("yaw")), "{missed:#?}");
    }
}
