//! Forces towards a point, and around a vertical axis: where these are, and what formulas say of them.

use nalgebra::Vector3;

use crate::discovery::shapes::Span;

/// Nearer than this there is no direction to the point or the axis, m. The name is that of the constant in formulas.
pub(crate) const NEAREST: (&str, &str, f64) = ("nearest", "m", 0.001);

/// Places of a craft that stand for all of a flight, about.
const PLACES: usize = 400;

/// How a force acts about a center.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum About {
    /// Towards a point.
    Point,
    /// Horizontally towards a vertical axis.
    Axis,
    /// Horizontally around a vertical axis, clockwise seen from above.
    Around,
}

/// A point or a vertical axis in the room, and how a force acts about it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Center {
    pub(crate) about: About,
    /// NED, m; down means nothing to an axis.
    pub(crate) place_ned_m: [f64; 3],
}

impl About {
    /// Names of the numbers that say where the center is.
    pub(crate) const fn names(self) -> &'static [&'static str] {
        match self {
            Self::Point => &["point_north", "point_east", "point_down"],
            Self::Axis | Self::Around => &["axis_north", "axis_east"],
        }
    }

    /// Whether the place along north, east or down means anything to it.
    const fn is_along(self, axis: usize) -> bool {
        axis < self.names().len()
    }

    /// Measured quantities that a force about a center depends on.
    pub(crate) const fn quantities(self) -> &'static [&'static str] {
        match self {
            Self::Point => &["east", "height", "north"],
            Self::Axis | Self::Around => &["east", "north"],
        }
    }

    /// From towards a center to the direction of the force.
    #[inline]
    fn turned(self, towards: Vector3<f64>) -> Vector3<f64> {
        if self == Self::Around { Vector3::new(towards.y, -towards.x, 0.0) } else { towards }
    }

    /// The distance as formulas spell it, with the names of where the center is.
    pub(crate) fn distance(self, names: &[String]) -> String {
        let squares: Vec<String> = ["north", "east", "down"]
            .into_iter()
            .zip(names)
            .map(|(quantity, name)| format!("({quantity} - {name})^2"))
            .collect();
        format!("sqrt({})", squares.join(" + "))
    }

    /// The part of its direction along each axis of the room, as formulas spell it.
    pub(crate) fn direction(self, names: &[String]) -> Vec<(&'static str, String)> {
        let towards = ["north", "east", "down"].into_iter().zip(names);
        let parts: Vec<(&'static str, String)> = match (self, names) {
            (Self::Around, [north, east, ..]) => {
                vec![("north", format!("({east} - east)")), ("east", format!("(north - {north})"))]
            }
            _ => towards.map(|(axis, name)| (axis, format!("({name} - {axis})"))).collect(),
        };
        let distance = self.distance(names);
        let over = |part: String| format!("{part} / max({}, {distance})", NEAREST.0);
        parts.into_iter().map(|(axis, part)| (axis, over(part))).collect()
    }
}

impl Center {
    /// The numbers that say where it is.
    pub(crate) const fn count(self) -> usize {
        self.about.names().len()
    }

    /// From a craft to it, NED, m.
    fn to(self, position_ned_m: &Vector3<f64>) -> Vector3<f64> {
        let mut to = Vector3::from(self.place_ned_m) - position_ned_m;
        if !self.about.is_along(2) {
            to.z = 0.0;
        }
        to
    }

    /// How far a craft is from it, m.
    #[inline]
    pub(crate) fn distance_m(self, position_ned_m: &Vector3<f64>) -> f64 {
        self.to(position_ned_m).norm()
    }

    /// Whether it is as far away as another one, from everywhere.
    pub(crate) fn shares_distance(self, other: Self) -> bool {
        let is_point = |center: Self| center.about == About::Point;
        self.place_ned_m == other.place_ned_m && is_point(self) == is_point(other)
    }

    /// The direction in which a force acts on a craft at a place, NED.
    #[inline]
    pub(crate) fn direction_from(self, position_ned_m: &Vector3<f64>) -> Vector3<f64> {
        let to = self.to(position_ned_m);
        self.about.turned(to / to.norm().max(NEAREST.2))
    }

    /// Slopes of the distance and of the direction over where the center is along an axis of the room: 1 and 1/m.
    #[inline]
    pub(crate) fn slopes_along(self, axis: usize, position_ned_m: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let to = self.to(position_ned_m);
        let distance_m = to.norm();
        let unit = to / distance_m.max(f64::MIN_POSITIVE);
        let mut along = Vector3::ith(axis, 1.0);
        if distance_m > NEAREST.2 {
            along -= unit * unit[axis];
        }
        (unit[axis], self.about.turned(along / distance_m.max(NEAREST.2)))
    }

    /// For people.
    pub(crate) fn called(self) -> String {
        let [north, east, down] = self.place_ned_m.map(|value| report::number::significant(value, 3));
        match self.about {
            About::Point => format!("the point at north {north} m, east {east} m, down {down} m"),
            About::Axis | About::Around => format!("the vertical axis at north {north} m, east {east} m"),
        }
    }
}

/// Where flights went, NED, m.
#[derive(Debug, Clone, Default)]
pub(crate) struct Flown(Vec<Vector3<f64>>);

impl Flown {
    /// Of flights, thinned out.
    pub(crate) fn new(flights: &[&sysid::Prepared]) -> Self {
        let mut all = Vec::new();
        for flight in flights {
            let samples: usize = flight.stretches.iter().map(|stretch| stretch.time_s.len()).sum();
            for stretch in &flight.stretches {
                let at = |k: usize| Vector3::from(stretch.position_ned_m.each_ref().map(|axis| axis[k]));
                all.extend((0..stretch.time_s.len()).step_by(samples.div_ceil(PLACES)).map(at));
            }
        }
        Self(all)
    }

    /// Where a quantity of the place went.
    fn span(&self, of: impl Fn(&Vector3<f64>) -> f64) -> Span {
        let ends =
            self.0.iter().map(of).fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
                [low.min(value), high.max(value)]
            });
        Span { low: ends[0], high: ends[1] }
    }

    /// Distances from a center.
    pub(crate) fn distances(&self, center: Center) -> Span {
        self.span(|place| center.distance_m(place))
    }

    /// Along north, east or down.
    pub(crate) fn along(&self, axis: usize) -> Span {
        self.span(|place| place[axis])
    }

    /// Centers that every form is tried about, in and beside what was flown; those that share their distances beside each other. None is
    /// beyond it along two axes: from so far off, a center is much like the nearest of these, from which a fit goes on.
    pub(crate) fn centers(&self) -> Vec<Center> {
        let spans = [0, 1, 2].map(|axis| self.along(axis));
        if !spans.iter().all(Span::is_wide) {
            return Vec::new();
        }
        let grid = |axis: usize, steps: [i32; 2], parts: i32| {
            let span = spans[axis];
            let place = move |k: i32| span.low + span.length() * f64::from(k) / f64::from(parts);
            (steps[0]..=steps[1]).map(place).collect::<Vec<f64>>()
        };
        let every = |steps: [i32; 2], parts: i32, abouts: &[About], downs: &[f64]| {
            let mut all = Vec::new();
            for north in grid(0, steps, parts) {
                for east in grid(1, steps, parts) {
                    for down in downs {
                        let at = |about: &About| Center { about: *about, place_ned_m: [north, east, *down] };
                        all.extend(abouts.iter().map(at));
                    }
                }
            }
            all
        };
        let mut all = every([-1, 3], 2, &[About::Point], &grid(2, [-1, 3], 2));
        all.extend(every([-1, 5], 4, &[About::Axis, About::Around], &[0.0]));
        // The last place in a span is half of it from its middle, the first one beyond three quarters or more.
        let is_beyond = |center: &Center, axis: usize| {
            let span = spans[axis];
            let from_middle = center.place_ned_m[axis] - 0.5 * (span.low + span.high);
            center.about.is_along(axis) && from_middle.abs() > 0.6 * span.length()
        };
        all.retain(|center| (0..3).filter(|axis| is_beyond(center, *axis)).count() < 2);
        all
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_center_is_beyond_what_was_flown_along_two_axes() {
        let corner = |k: i32| Vector3::from([0, 1, 2].map(|axis| f64::from(k >> axis & 1) + 10.0));
        let centers = Flown((0..8).map(corner).collect()).centers();
        // Of five places along each axis three are in it or at its end; of seven in the plane, five.
        let of = |about| centers.iter().filter(|center| center.about == about).count();
        assert_eq!([About::Point, About::Axis, About::Around].map(of), [27 + 2 * 27, 25 + 20, 25 + 20]);
        let pairs = centers.windows(2).filter(|pair| pair[0].shares_distance(pair[1])).count();
        assert_eq!(pairs, of(About::Axis), "an axis is beside what turns about it");
        let beyond = |center: &Center| {
            (0..center.count()).filter(|axis| !(9.9..11.1).contains(&center.place_ned_m[*axis])).count()
        };
        assert!(centers.iter().all(|center| beyond(center) < 2));
        assert!(Flown(vec![Vector3::zeros(); 2]).centers().is_empty(), "nothing was flown");
    }
}
