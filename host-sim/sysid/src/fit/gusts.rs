//! A wind that wanders within each flight.

use model::{Effect, Model};

use crate::fit::linearise::residuals_at_rows;
use crate::prepare::{Prepared, Stretch};

/// Frequency above which the push of a wind is noise, Hz.
const HIGHEST_HZ: f64 = 2.0;
/// Standard errors from zero of the drag along both axes without which a push tells no wind.
const DETERMINED: f64 = 3.0;
/// Steps to the wind of a drag that grows with it.
const STEPS: usize = 20;

/// Prepares flights for winds that wander: from now on, the slow part of the horizontal forces is none of the model's.
pub fn expect(flights: &mut [&mut Prepared]) {
    for stretch in flights.iter_mut().flat_map(|flight| &mut flight.stretches) {
        let still = vec![0.0; stretch.time_s.len()];
        stretch.gust_ned_m_s = Some([still.clone(), still]);
    }
}

/// Takes the winds from them.
pub fn clear(flights: &mut [&mut Prepared]) {
    for stretch in flights.iter_mut().flat_map(|flight| &mut flight.stretches) {
        stretch.gust_ned_m_s = None;
    }
}

/// The wind of each flight by its push, about a model of drag that was fitted without the slow part of the forces. Nothing where the drag is
/// not known.
pub fn estimate(flights: &mut [&mut Prepared], model: &Model) -> Option<()> {
    let drag = Drag::of(model)?;
    for flight in flights.iter_mut() {
        let residual = residuals_at_rows(flight, model, 1).residual;
        let mut first = 0;
        let mut winds = Vec::new();
        for stretch in &flight.stretches {
            let rows = first..first + flight.row_samples(stretch, 1).len();
            first = rows.end;
            winds.push(wind(flight, stretch, [&residual[0][rows.clone()], &residual[1][rows]], &drag));
        }
        for (stretch, wind) in flight.stretches.iter_mut().zip(winds) {
            stretch.gust_ned_m_s = Some(wind);
        }
    }
    Some(())
}

/// Root mean square of a flight's wind, m/s.
pub fn rms_m_s(flight: &Prepared) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for [north, east] in flight.stretches.iter().filter_map(|s| s.gust_ned_m_s.as_ref()) {
        sum += north.iter().zip(east).map(|(n, e)| n * n + e * e).sum::<f64>();
        count += north.len() as f64;
    }
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}

/// Deceleration by air along the horizontal body axes.
struct Drag {
    linear_per_s: [f64; 2],
    quadratic_per_m: f64,
}

impl Drag {
    fn of(model: &Model) -> Option<Self> {
        let per_mass = 1.0 / model.vehicle.mass;
        let linear = &model.term(Effect::LinearDrag)?.coefficients[..2];
        let known = linear.iter().all(|c| c.std_error.is_some_and(|error| -c.value > DETERMINED * error));
        let quadratic = model.term(Effect::QuadraticDrag).map_or(0.0, |term| -term.coefficients[0].value);
        known.then(|| Self {
            linear_per_s: [0, 1].map(|i| -linear[i].value * per_mass),
            quadratic_per_m: quadratic.max(0.0) * per_mass,
        })
    }

    /// The wind that pushes a craft so, body axes.
    fn wind_m_s(&self, push_m_s2: [f64; 2]) -> [f64; 2] {
        let mut wind = [0.0f64; 2];
        for _ in 0..STEPS {
            let by_speed = self.quadratic_per_m * wind[0].hypot(wind[1]);
            let next = [0, 1].map(|i| push_m_s2[i] / (self.linear_per_s[i] + by_speed));
            wind = [0, 1].map(|i| 0.5 * (wind[i] + next[i]));
        }
        wind
    }
}

fn wind(flight: &Prepared, stretch: &Stretch, push_m_s2: [&[f64]; 2], drag: &Drag) -> [Vec<f64>; 2] {
    let rows: Vec<usize> = flight.row_samples(stretch, 1).collect();
    let mut wind = [0, 1].map(|_| Vec::with_capacity(rows.len()));
    for (row, &k) in rows.iter().enumerate() {
        let [u, v] = drag.wind_m_s([push_m_s2[0][row], push_m_s2[1][row]]);
        let (sine, cosine) = stretch.euler_rad[2][k].sin_cos();
        wind[0].push(cosine * u - sine * v);
        wind[1].push(sine * u + cosine * v);
    }
    let stiffness = (std::f64::consts::TAU * HIGHEST_HZ * flight.period_s).powi(-4);
    wind.map(|wind| {
        let smooth = smoothed(&wind, stiffness);
        // Before the first row and after the last it is what it is there.
        (0..stretch.time_s.len()).map(|k| smooth[k.saturating_sub(rows[0]).min(smooth.len() - 1)]).collect()
    })
}

/// Whittaker's smoother: least squares with a penalty on second differences.
fn smoothed(signal: &[f64], stiffness: f64) -> Vec<f64> {
    let n = signal.len();
    if n < 3 {
        return signal.to_vec();
    }
    // Bands of I + stiffness D'D: the diagonal and those one and two below it.
    let mut bands = vec![[1.0, 0.0, 0.0]; n];
    for k in 0..n - 2 {
        let d = [1.0, -2.0, 1.0];
        for i in 0..3 {
            for j in i..3 {
                bands[k + i][j - i] += stiffness * d[i] * d[j];
            }
        }
    }
    // L D L': bands[k] becomes [D_k, L_(k+1)k, L_(k+2)k].
    let mut result = signal.to_vec();
    for k in 0..n {
        let [d, a, b] = bands[k];
        let (l, m) = (a / d, b / d);
        if k + 1 < n {
            bands[k + 1][0] -= l * a;
            bands[k + 1][1] -= l * b;
            result[k + 1] -= l * result[k];
        }
        if k + 2 < n {
            bands[k + 2][0] -= m * b;
            result[k + 2] -= m * result[k];
        }
        bands[k] = [d, l, m];
    }
    for k in (0..n).rev() {
        let [d, l, m] = bands[k];
        result[k] /= d;
        if k + 1 < n {
            result[k] -= l * result[k + 1];
        }
        if k + 2 < n {
            result[k] -= m * result[k + 2];
        }
    }
    result
}

#[cfg(test)]
mod tests {
    use model::Vehicle;

    use super::*;
    use crate::testing::prepared;

    /// N s/m along the body axes: a craft that is not alike from the front and from the side.
    const DRAG_N_S_M: [f64; 2] = [0.30, 0.24];

    fn known(std_error: f64) -> Model {
        let mut model = Model::new(Vehicle::thesis());
        model.set(Effect::LinearDrag, &[-DRAG_N_S_M[0], -DRAG_N_S_M[1], -0.3]);
        model.terms[0].coefficients.iter_mut().for_each(|c| c.std_error = Some(std_error));
        model
    }

    /// North of a craft, m, and the wind that moves it so, m/s: w = v + (m / d) a.
    fn north(t: f64, drag_n_s_m: f64) -> (f64, f64) {
        let mut sums = [0.0; 3];
        for (amplitude, rate) in [(0.15, 0.8), (0.03, 1.9)] {
            let (sine, cosine) = f64::sin_cos(rate * t);
            sums[0] += amplitude * sine;
            sums[1] += amplitude * rate * cosine;
            sums[2] -= amplitude * rate * rate * sine;
        }
        (sums[0], sums[1] + Vehicle::thesis().mass / drag_n_s_m * sums[2])
    }

    /// Nose north, then nose east: the push is felt by another drag.
    #[test]
    fn a_known_wind_is_found_by_the_motion_that_it_makes() {
        for (yaw_rad, drag_n_s_m) in [(0.0, DRAG_N_S_M[0]), (std::f64::consts::FRAC_PI_2, DRAG_N_S_M[1])] {
            let mut flight = prepared(2000, |t, row| {
                row.position_ned_m[0] = north(t, drag_n_s_m).0;
                row.euler_rad[2] = yaw_rad;
            });
            expect(&mut [&mut flight]);
            assert_eq!(rms_m_s(&flight), 0.0);
            estimate(&mut [&mut flight], &known(0.01)).unwrap();
            let stretch = &flight.stretches[0];
            let [found, across] = stretch.gust_ned_m_s.as_ref().unwrap();
            for k in 100..1900 {
                let expected = north(stretch.time_s[k], drag_n_s_m).1;
                assert!((found[k] - expected).abs() < 0.02, "{k}: {} for {expected}", found[k]);
                assert!(across[k].abs() < 1e-6);
            }
            assert!(rms_m_s(&flight) > 0.3);
            clear(&mut [&mut flight]);
            assert!(!flight.has_gusts());
        }
    }

    #[test]
    fn a_drag_that_is_hardly_known_tells_no_wind() {
        let mut flight = prepared(400, |_, _| {});
        expect(&mut [&mut flight]);
        assert!(estimate(&mut [&mut flight], &known(0.1)).is_none());
        assert!(estimate(&mut [&mut flight], &Model::new(Vehicle::thesis())).is_none());
    }

    #[test]
    fn a_drag_that_grows_with_the_wind_makes_a_push_a_smaller_wind() {
        let drag = Drag { linear_per_s: [0.2, 0.2], quadratic_per_m: 0.1 };
        let [u, v] = drag.wind_m_s([0.2 * 3.0 + 0.1 * 9.0, 0.0]);
        assert!((u - 3.0).abs() < 1e-3 && v == 0.0, "{u}");
    }

    /// A penalty on second differences leaves lines alone, and takes from an oscillation of w radians a sample by
    /// 1 / (1 + stiffness (2 sin(w/2))^4).
    #[test]
    fn the_smoother_leaves_lines_and_takes_oscillations() {
        let line: Vec<f64> = (0..50).map(|k| 3.0 - 0.2 * f64::from(k)).collect();
        for (a, b) in smoothed(&line, 1e4).iter().zip(&line) {
            assert!((a - b).abs() < 1e-6, "{a}, {b}");
        }
        let (w, stiffness) = (0.1f64, 4e3);
        let gain = 1.0 / (1.0 + stiffness * (2.0 * (0.5 * w).sin()).powi(4));
        let wave: Vec<f64> = (0..2000).map(|k| (w * f64::from(k)).sin()).collect();
        for (a, b) in smoothed(&wave, stiffness)[500..1500].iter().zip(&wave[500..]) {
            assert!((a - gain * b).abs() < 1e-6);
        }
        assert_eq!(smoothed(&[1.0, 5.0], 1e4), [1.0, 5.0]);
    }
}
