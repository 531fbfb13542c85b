//! Axes: what they are called, which range they cover, where the ticks stand.
//!
//! Own ticks rather than those of `plotters`, because its ranges loop or lose digits for constant, tiny and huge data. Steps are 1, 2
//! or 5 times a power of ten. Values far from one are divided by a power of a thousand that moves into the label: `[10⁻⁶ N s²]`.

use std::ops::Range;

use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};

use crate::number::{fixed, significant, superscript, unit};

/// Fewer labelled ticks do not say how an axis runs.
const FEWEST_TICKS: usize = 3;
/// Larger magnitudes are not drawn, so that no difference or square of drawn values can overflow.
const LARGEST: f64 = 1e100;

/// Name and unit of one axis.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Axis {
    /// What is plotted, such as `roll rate`.
    pub label: String,
    /// Its unit, such as `rad/s`; empty for none.
    pub unit: String,
    /// Ticks at powers of ten; values that are not positive become gaps.
    pub logarithmic: bool,
}

impl Axis {
    /// A linear axis.
    pub fn new(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), logarithmic: false }
    }

    /// A logarithmic axis.
    pub fn logarithmic(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { logarithmic: true, ..Self::new(label, unit) }
    }

    /// Whether `value` has a place on this axis.
    pub(crate) fn can_draw(&self, value: f64) -> bool {
        value.abs() <= LARGEST && (!self.logarithmic || value >= 1.0 / LARGEST)
    }

    fn transform(&self, value: f64) -> f64 {
        if self.logarithmic { value.log10() } else { value }
    }
}

/// Smallest and largest of the values seen so far.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Extent(Option<(f64, f64)>);

impl Extent {
    pub(crate) fn add(&mut self, value: f64) {
        let (low, high) = self.0.unwrap_or((value, value));
        self.0 = Some((low.min(value), high.max(value)));
    }

    pub(crate) fn low(self) -> Option<f64> {
        self.0.map(|(low, _)| low)
    }

    pub(crate) fn is_empty(self) -> bool {
        self.0.is_none()
    }
}

/// An axis with its range and ticks: the coordinate `plotters` draws with.
#[derive(Clone, Debug)]
pub(crate) struct Scale {
    axis: Axis,
    /// Range, after taking the logarithm if there is one.
    low: f64,
    high: f64,
    /// Data units, ascending.
    ticks: Vec<f64>,
    /// Grid lines between the ticks of a logarithmic axis.
    minor: Vec<f64>,
    /// Tick labels are divided by 10^`power`, a multiple of three.
    power: i32,
    decimals: usize,
}

impl Scale {
    /// Covers `extent`, widened below and above by the shares `margin` of its length, with about `ticks` ticks.
    pub(crate) fn new(axis: &Axis, extent: Extent, margin: (f64, f64), ticks: usize) -> Self {
        let (low, high) = match extent.0 {
            Some((low, high)) => widen(axis.transform(low), axis.transform(high), margin, axis.logarithmic),
            None => (0.0, 1.0),
        };
        Self::between(axis, low, high, ticks)
    }

    /// The same axis with the same centre and `factor` times the length.
    pub(crate) fn stretched(&self, factor: f64, ticks: usize) -> Self {
        let half = 0.5 * (self.high - self.low) * factor;
        let centre = 0.5 * (self.high + self.low);
        Self::between(&self.axis, centre - half, centre + half, ticks)
    }

    fn between(axis: &Axis, low: f64, high: f64, target: usize) -> Self {
        let mut scale =
            Self { axis: axis.clone(), low, high, ticks: vec![], minor: vec![], power: 0, decimals: 0 };
        if axis.logarithmic {
            scale.place_logarithmic_ticks(target);
        } else {
            scale.place_linear_ticks(target);
        }
        scale
    }

    fn place_linear_ticks(&mut self, target: usize) {
        let mut step = round_step((self.high - self.low) / target.max(FEWEST_TICKS) as f64);
        self.ticks = self.multiples(step);
        // How many fall inside depends on where the range begins.
        while self.ticks.len() < FEWEST_TICKS {
            step = round_step(0.4 * step);
            self.ticks = self.multiples(step);
        }
        let largest = self.low.abs().max(self.high.abs());
        let exponent = largest.log10().floor();
        self.power = if (-2.0..5.0).contains(&exponent) { 0 } else { (exponent / 3.0).floor() as i32 * 3 };
        self.decimals = (f64::from(self.power) - (step.log10() + 1e-9).floor()).clamp(0.0, 12.0) as usize;
    }

    /// Multiples of `step` within the range. A hair outside still counts as on the edge: 0.3 / 0.1 is not 3 in floating point.
    fn multiples(&self, step: f64) -> Vec<f64> {
        let first = (self.low / step - 1e-9).ceil();
        let count = ((self.high / step + 1e-9).floor() - first).max(-1.0) as i64;
        (0..=count).map(|i| (first + i as f64) * step).collect()
    }

    fn place_logarithmic_ticks(&mut self, target: usize) {
        let (first, last) = ((self.low - 1e-9).ceil() as i32, (self.high + 1e-9).floor() as i32);
        let inside = |v: &f64| (self.low - 1e-9..=self.high + 1e-9).contains(&v.log10());
        let within_decades = |digits: &[f64]| -> Vec<f64> {
            (first - 1..=last)
                .flat_map(|n| digits.iter().map(move |d| d * 10_f64.powi(n)))
                .filter(inside)
                .collect()
        };
        let decades = (last - first + 1).max(0) as usize;
        if decades <= 2 {
            self.ticks = within_decades(&[1.0, 2.0, 5.0]);
        } else {
            let step = decades.div_ceil(target.max(1)).min((decades - 1) / (FEWEST_TICKS - 1));
            self.ticks = (first..=last).step_by(step).map(|n| 10_f64.powi(n)).collect();
        }
        if decades <= 6 {
            self.minor = within_decades(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        }
    }

    /// Whether `value` has a place on this axis.
    pub(crate) fn can_draw(&self, value: f64) -> bool {
        self.axis.can_draw(value)
    }

    /// Length of the range in data units (decades on a logarithmic axis).
    pub(crate) fn length(&self) -> f64 {
        self.high - self.low
    }

    /// Place of a drawable value, 0 at the lower end and 1 at the upper.
    pub(crate) fn fraction(&self, value: f64) -> f64 {
        (self.axis.transform(value) - self.low) / (self.high - self.low)
    }

    /// The value at a place, 0 at the lower end and 1 at the upper.
    pub(crate) fn value(&self, fraction: f64) -> f64 {
        let place = self.low + fraction * (self.high - self.low);
        if self.axis.logarithmic { 10_f64.powf(place) } else { place }
    }

    /// Both ends as they are drawn: their logarithms on a logarithmic axis.
    pub(crate) fn drawn(&self) -> (f64, f64) {
        (self.low, self.high)
    }

    pub(crate) fn axis(&self) -> &Axis {
        &self.axis
    }

    /// Tick labels are divided by ten to this power.
    pub(crate) fn power(&self) -> i32 {
        self.power
    }

    /// Both ends in data units.
    pub(crate) fn ends(&self) -> (f64, f64) {
        if self.axis.logarithmic {
            (10_f64.powf(self.low), 10_f64.powf(self.high))
        } else {
            (self.low, self.high)
        }
    }

    pub(crate) fn remove_ticks(&mut self) {
        self.ticks.clear();
        self.minor.clear();
        self.power = 0;
    }

    pub(crate) fn tick_labels(&self) -> impl Iterator<Item = String> {
        self.ticks.iter().map(|tick| self.tick_label(*tick))
    }

    fn tick_label(&self, value: f64) -> String {
        if self.axis.logarithmic {
            // One digit is exact for 1, 2, 5 times a power of ten, which itself may be off in the last bit.
            return if (0.9e-3..0.9e5).contains(&value) {
                significant(value, 1)
            } else {
                format!("{value:.0e}")
            };
        }
        fixed(value / 10_f64.powi(self.power), self.decimals)
    }

    /// Label, unit and power of ten in one line: `drag [10⁻⁶ N s²]`.
    pub(crate) fn title(&self) -> String {
        let (label, unit) = (&self.axis.label, unit(&self.axis.unit));
        let power = if self.power == 0 { String::new() } else { format!("10{}", superscript(self.power)) };
        match (power.is_empty(), unit.is_empty()) {
            (true, true) => label.clone(),
            (true, false) => format!("{label} [{unit}]"),
            (false, true) => format!("{label} [{power}]"),
            (false, false) => format!("{label} [{power} {unit}]"),
        }
    }
}

/// Range for data between `low` and `high`; constant data gets room around it.
fn widen(low: f64, high: f64, margin: (f64, f64), logarithmic: bool) -> (f64, f64) {
    let length = high - low;
    if logarithmic {
        // At least one decade, else there may be no tick to read.
        let missing = (1.0 - length).max(0.0);
        return (low - 0.5 * missing - margin.0 * length, high + 0.5 * missing + margin.1 * length);
    }
    let largest = low.abs().max(high.abs());
    if largest < 1.0 / LARGEST {
        return (-1.0, 1.0);
    }
    // Below nine digits the ticks could not be told apart: this is constant data with rounding noise.
    if length < 1e-9 * largest {
        return (low - 0.1 * largest, high + 0.1 * largest);
    }
    (low - margin.0 * length, high + margin.1 * length)
}

/// Smallest of 1, 2, 5 times a power of ten that is not below `step`.
fn round_step(step: f64) -> f64 {
    let decade = 10_f64.powf(step.log10().floor());
    [1.0, 2.0, 5.0]
        .into_iter()
        .map(|m| m * decade)
        .find(|s| *s >= step * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

impl Ranged for Scale {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        limit.0 + (self.fraction(*value) * f64::from(limit.1 - limit.0)).round() as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        if hint.weight().allow_light_points() { self.minor.clone() } else { self.ticks.clone() }
    }

    fn range(&self) -> Range<f64> {
        let (low, high) = self.ends();
        low..high
    }
}

impl ValueFormatter<f64> for Scale {
    fn format_ext(&self, value: &f64) -> String {
        self.tick_label(*value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn scale(values: &[f64], logarithmic: bool) -> Scale {
        let axis = Axis { logarithmic, ..Axis::new("drag", "N") };
        let mut extent = Extent::default();
        values.iter().filter(|v| axis.can_draw(**v)).for_each(|v| extent.add(*v));
        Scale::new(&axis, extent, (0.0, 0.0), 6)
    }

    fn labels(values: &[f64], logarithmic: bool) -> Vec<String> {
        scale(values, logarithmic).tick_labels().collect()
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(labels(&[0.0, 1.0], false), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
        assert_eq!(labels(&[-0.31, 0.29], false), ["-0.3", "-0.2", "-0.1", "0.0", "0.1", "0.2"]);
        assert_eq!(labels(&[0.0, 1500.0], false), ["0", "500", "1000", "1500"]);
    }

    #[test]
    fn far_from_one_the_power_goes_into_the_label() {
        let scale = scale(&[0.0, 4.2e-6], false);
        assert_eq!(scale.title(), "drag [10⁻⁶ N]");
        assert_eq!(scale.tick_labels().collect::<Vec<_>>(), ["0", "1", "2", "3", "4"]);
    }

    #[test]
    fn logarithmic_ticks_are_decades_or_parts_of_one() {
        assert_eq!(labels(&[0.01, 1e6], true), ["0.01", "1", "100", "10000", "1e6"]);
        assert_eq!(labels(&[1.0, 10.0], true), ["1", "2", "5", "10"]);
        assert_eq!(labels(&[1e45, 1e48], true), ["1e45", "1e46", "1e47", "1e48"]);
        assert!(labels(&[3.0, 3.1], true).len() >= 2);
    }

    #[test]
    fn constant_data_has_room_and_ticks() {
        for value in [0.0, 9.81, -3e-7, 1e9, 5e-320] {
            let scale = scale(&[value], false);
            let (low, high) = scale.ends();
            assert!(low < value && value < high, "{value}: {low} to {high}");
            assert!(scale.ticks.len() >= 2, "{value}: {:?}", scale.ticks);
        }
    }

    proptest! {
        #[test]
        fn every_axis_has_three_labels(
            value in -1e3_f64..1e3,
            length in prop_oneof![Just(0.0), -12_f64..0.0, 0.0..3.0_f64],
            size in -80_i32..80,
            target in 1_usize..13,
            log: bool,
            margin in 0.0..0.1_f64,
        ) {
            // Constant data, ranges from a part in 10^12 to a thousand times the value, tiny and huge values.
            let low = value * 10_f64.powi(size);
            let high = if length == 0.0 { low } else { low + low.abs() * 10_f64.powf(length) };
            let axis = Axis { logarithmic: log, ..Axis::new("drag", "N") };
            let mut extent = Extent::default();
            [low, high].into_iter().filter(|v| axis.can_draw(*v)).for_each(|v| extent.add(v));
            let scale = Scale::new(&axis, extent, (margin, margin), target);
            let stretched = scale.stretched(1.7, target);
            for scale in [&scale, &stretched] {
                let distinct: std::collections::HashSet<_> = scale.tick_labels().collect();
                prop_assert!(distinct.len() >= FEWEST_TICKS, "{distinct:?} on {:?}", scale.ends());
                prop_assert_eq!(distinct.len(), scale.ticks.len(), "{:?}", distinct);
            }
        }

        #[test]
        fn ticks_are_few_distinct_and_inside(values in prop::collection::vec(prop::num::f64::ANY, 0..4), log: bool) {
            let scale = scale(&values, log);
            prop_assert!(scale.ticks.len() <= 13, "{:?}", scale.ticks);
            prop_assert!(scale.ticks.windows(2).all(|w| w[0] < w[1]), "{:?}", scale.ticks);
            let names: Vec<_> = scale.tick_labels().collect();
            prop_assert!(names.windows(2).all(|w| w[0] != w[1]), "{names:?}");
            for tick in &scale.ticks {
                // The hair allowed outside is 1e-9 of a step or of a decade.
                prop_assert!((-1e-6..=1.0 + 1e-6).contains(&scale.fraction(*tick)), "{tick} in {:?}", scale.ends());
            }
        }
    }
}
