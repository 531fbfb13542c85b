//! Identification flights: they stay in the cage, keep control, and excite what is to be
//! identified.

use model::Model;
use sil::{FlightPlan, Recording, fly};

fn flown(seed: u64, duration_s: f64) -> (FlightPlan, Recording) {
    let plan = FlightPlan::identification(Model::thesis(), seed, duration_s);
    let recording = fly(&plan).expect("identification flights can be flown");
    (plan, recording)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, n), v| (sum + v * v, n + 1));
    (sum / f64::from(count)).sqrt()
}

#[test]
fn they_stay_in_the_cage_and_fly_low_and_fast() {
    for seed in 0..40 {
        let (plan, flight) = flown(seed, 40.0);
        let rows = &flight.rows;
        assert!(flight.complete, "seed {seed}");
        let margin_m = flight.cage_margin_m();
        // Low passes are commanded 0.15 m over the floor.
        assert!(margin_m > 0.05, "seed {seed}: {margin_m} m from floor or cage");
        let (lowest, highest) = range(rows.iter().map(|r| -f64::from(r.truth.position_m[2])));
        assert!(lowest < 0.26 && highest > 1.2, "seed {seed}: {lowest} to {highest} m");
        let speed = |k: usize| range(rows.iter().map(|r| f64::from(r.truth.velocity_m_s[k].abs()))).1;
        let (forward, sideward) = (speed(0), speed(1));
        assert!(
            (1.3..3.5).contains(&forward) && (1.0..3.5).contains(&sideward),
            "seed {seed}: {forward} {sideward} m/s"
        );
        assert!(speed(2) > 0.3, "seed {seed}: {} m/s", speed(2));
        let (left, right) = range(flight.euler_rad().iter().map(|e| e[2]));
        assert!(right - left > 0.9, "seed {seed}: turned by {} rad", right - left);
        for k in 0..3 {
            let rate = rms(rows.iter().map(|r| f64::from(r.truth.rate_rad_s[k])));
            assert!(rate > 0.1, "seed {seed}: rate {k} {rate} rad/s rms");
        }
        let saturated = flight.saturated_ticks(plan.config.command_range);
        assert!(saturated * 20 < rows.len(), "seed {seed}: {saturated} of {} ticks saturated", rows.len());
    }
}

#[test]
fn the_battery_falls_and_sags() {
    let (_, flight) = flown(1, 40.0);
    let volts = |rows: &[sil::Row]| {
        rows.iter().map(|r| f64::from(r.truth.battery_v)).sum::<f64>() / rows.len() as f64
    };
    let n = flight.rows.len();
    let fall = volts(&flight.rows[..n / 4]) - volts(&flight.rows[3 * n / 4..]);
    // 8 mV/s over the 30 s between the middles of the quarters, and as much again for the
    // difference in load.
    assert!((0.1..0.5).contains(&fall), "{fall} V");
}

#[test]
fn every_craft_of_the_demonstration_can_be_flown() {
    use model::Effect;
    let hidden: [(Effect, &[f64]); 6] = [
        (Effect::GroundEffect, &[1.0]),
        (Effect::SteadyWind, &[0.8, -0.6, 0.0]),
        (Effect::QuadraticDrag, &[-0.1, -0.1, -0.1]),
        (Effect::TrackingOffset, &[0.05, 0.0, 0.054]),
        (Effect::AttitudeOffset, &[0.03, -0.02]),
        (Effect::BatteryVoltage, &[4.0]),
    ];
    for (effect, values) in hidden {
        let mut model = Model::thesis();
        model.reference.battery_v = 11.1;
        let mut coefficients: Vec<f64> = values.to_vec();
        coefficients.resize(effect.info().coefficients.len(), 0.0);
        model.set(effect, &coefficients);
        for seed in 1..=4 {
            let flight = fly(&FlightPlan::identification(model.clone(), seed, 40.0)).unwrap();
            let margin_m = flight.cage_margin_m();
            assert!(flight.complete && margin_m > 0.0, "{effect} seed {seed}: {margin_m} m");
        }
    }
}
