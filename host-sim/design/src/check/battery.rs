//! Margins over the battery's voltage: the law's motor map against the model's.

use control::Config;
use model::{Model, Plant};

use super::report::{BatteryLoop, BatteryReport};
use crate::analysis::{LoopMargins, Study};
use crate::error::Result;
use crate::loops::{LoopName, View};
use crate::plant::{Linear, TrimTarget};

/// Voltages of a lithium-polymer cell over its nominal 3.7 V: empty to full.
const VOLTAGES: [f64; 5] = [0.89, 0.95, 1.0, 1.07, 1.135];

pub(super) fn battery_reports(model: &Model, config: &Config, view: View) -> Result<Vec<BatteryReport>> {
    let nominal_v = model.reference.battery_v;
    if !(nominal_v > 0.0) {
        return Ok(Vec::new());
    }
    let at = |share: &f64| {
        let battery_v = share * nominal_v;
        let target = TrimTarget { battery_v: Some(battery_v), ..TrimTarget::default() };
        let linear = Linear::new(model, &target)?;
        let greatest = model.vehicle.motors.command_range[1];
        let speed = Plant::new(model).commanded_rad_s(&[greatest; 4], battery_v);
        let thrust: f64 = (0..4).map(|j| linear.effectiveness[(0, j)] * speed[j] * speed[j]).sum();
        let thrust_to_weight = thrust / linear.equilibrium.inputs[0];
        let study = Study::around(model, linear, config, view)?;
        let row = |(name, margins): (LoopName, LoopMargins)| BatteryLoop {
            name: name.name(),
            stable: margins.stable,
            phase_margin_deg: margins.at_error.phase_margin_deg,
            gain_margin: margins.at_error.gain_margin,
            delay_margin_s: margins.delay_margin_s,
        };
        Ok(BatteryReport {
            battery_v,
            thrust_to_weight,
            loops: study.margins()?.into_iter().map(row).collect(),
        })
    };
    VOLTAGES.iter().map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The thesis' motor map takes the voltage out, so margins are those of 11.1 V at any; thrust
    /// over weight is not. Speed is affine in the voltage, (3.1), and thrust its square.
    #[test]
    fn a_compensated_battery_changes_the_thrust_and_no_margin() {
        let (model, view) = (Model::thesis(), View::Sampled { delay_samples: 0 });
        let rows = battery_reports(&model, &Config::thesis(), view).unwrap();
        assert_eq!(rows.len(), VOLTAGES.len());
        let speed = |row: &BatteryReport| Plant::new(&model).commanded_rad_s(&[2000.0; 4], row.battery_v)[0];
        for row in &rows {
            let (margin, nominal) =
                (row.loops[0].gain_margin.unwrap(), rows[2].loops[0].gain_margin.unwrap());
            assert!((margin / nominal - 1.0).abs() < 1e-3, "{row:?}");
            let ratio = row.thrust_to_weight / rows[2].thrust_to_weight;
            assert!((ratio / (speed(row) / speed(&rows[2])).powi(2) - 1.0).abs() < 1e-6, "{row:?}");
        }
        let mut silent = Model::thesis();
        silent.reference.battery_v = 0.0;
        assert!(battery_reports(&silent, &Config::thesis(), view).unwrap().is_empty());
    }
}
