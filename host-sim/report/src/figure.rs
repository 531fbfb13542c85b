//! What a figure shows, before any pixel.

use crate::axis::Axis;
use crate::style::Style;

/// How the points of a series are joined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Straight lines between neighbours.
    Line,
    /// Markers only.
    Points,
    /// Each value holds until the next point.
    Step,
    /// Bars from zero, centred on x, as wide as the smallest distance between neighbours.
    Bars,
}

/// One named set of points.
#[derive(Clone, Debug)]
pub struct Series {
    /// Legend entry; an empty name keeps the series out of the legend.
    pub name: String,
    /// How the points are joined.
    pub kind: Kind,
    /// Role, and with it colour, dash and width.
    pub style: Style,
    /// Points (x, y) in the units of the axes. A NaN breaks the line.
    pub data: Vec<(f64, f64)>,
}

impl Series {
    /// A series of the given kind.
    pub fn new(kind: Kind, name: impl Into<String>, style: Style, data: impl Into<Vec<(f64, f64)>>) -> Self {
        Self { name: name.into(), kind, style, data: data.into() }
    }

    /// Straight lines between neighbours.
    pub fn line(name: impl Into<String>, style: Style, data: impl Into<Vec<(f64, f64)>>) -> Self {
        Self::new(Kind::Line, name, style, data)
    }

    /// Markers only.
    pub fn points(name: impl Into<String>, style: Style, data: impl Into<Vec<(f64, f64)>>) -> Self {
        Self::new(Kind::Points, name, style, data)
    }

    /// Each value holds until the next point.
    pub fn step(name: impl Into<String>, style: Style, data: impl Into<Vec<(f64, f64)>>) -> Self {
        Self::new(Kind::Step, name, style, data)
    }

    /// Bars from zero, centred on x.
    pub fn bars(name: impl Into<String>, style: Style, data: impl Into<Vec<(f64, f64)>>) -> Self {
        Self::new(Kind::Bars, name, style, data)
    }

    /// The points a line goes through: those of the series, for a step also the end of each tread.
    pub(crate) fn corners(&self, x_can_draw: impl Fn(f64) -> bool) -> impl Iterator<Item = (f64, f64)> {
        let next = self.data.iter().skip(1).map(Some).chain([None]);
        self.data.iter().zip(next).flat_map(move |(&(x, y), next)| {
            let tread = next.filter(|_| self.kind == Kind::Step && x_can_draw(x)).map(|next| (next.0, y));
            [Some((x, y)), tread].into_iter().flatten()
        })
    }

    /// Half the smallest distance between neighbours in x; half a unit for a single bar.
    pub(crate) fn half_bar_width(&self) -> f64 {
        let linear = Axis::new("", "");
        let mut xs: Vec<_> = self.data.iter().map(|p| p.0).filter(|x| linear.can_draw(*x)).collect();
        xs.sort_by(f64::total_cmp);
        let smallest = xs.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min);
        if smallest.is_finite() { 0.5 * smallest } else { 0.5 }
    }
}

/// A line or band across the whole plot: a specification limit, an event, an interval.
///
/// Marks widen the axes, so that a limit is always seen. One that cannot be drawn (NaN) is left out of the plot and named
/// "(no data)" in the legend.
#[derive(Clone, Debug)]
pub enum Mark {
    /// Horizontal line at `y`.
    Horizontal {
        /// Legend entry; may be empty.
        name: String,
        /// Where, in the unit of the y axis.
        y: f64,
        /// Role of the line.
        style: Style,
    },
    /// Vertical line at `x`.
    Vertical {
        /// Legend entry; may be empty.
        name: String,
        /// Where, in the unit of the x axis.
        x: f64,
        /// Role of the line.
        style: Style,
    },
    /// Shaded strip between two values of y, in either order.
    HorizontalBand {
        /// Legend entry; may be empty.
        name: String,
        /// Both edges, in the unit of the y axis.
        y: (f64, f64),
        /// Role of the band.
        style: Style,
    },
    /// Shaded strip between two values of x, in either order.
    VerticalBand {
        /// Legend entry; may be empty.
        name: String,
        /// Both edges, in the unit of the x axis.
        x: (f64, f64),
        /// Role of the band.
        style: Style,
    },
}

impl Mark {
    /// Horizontal line at the specification limit `y`.
    pub fn limit(name: impl Into<String>, y: f64) -> Self {
        Self::Horizontal { name: name.into(), y, style: Style::Limit }
    }

    /// Shaded strip of allowed values of y.
    pub fn allowed(name: impl Into<String>, y: (f64, f64)) -> Self {
        Self::HorizontalBand { name: name.into(), y, style: Style::Reference }
    }

    /// Vertical line at the event `x`.
    pub fn event(name: impl Into<String>, x: f64) -> Self {
        Self::Vertical { name: name.into(), x, style: Style::Limit }
    }
}

/// A plot: two axes, series, marks.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Heading above the plot; may be empty.
    pub title: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Drawn in this order, the first at the back.
    pub series: Vec<Series>,
    /// Lines and bands behind the series.
    pub marks: Vec<Mark>,
    /// One unit of x is as long as one of y, as on a map.
    pub equal_scale: bool,
}

impl Figure {
    /// An empty figure, which says "no data" until a series is added.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, series: Vec::new(), marks: Vec::new(), equal_scale: false }
    }

    /// Adds a series in front of the others.
    #[must_use]
    pub fn with(mut self, series: Series) -> Self {
        self.series.push(series);
        self
    }

    /// Adds a line or band behind the series.
    #[must_use]
    pub fn mark(mut self, mark: Mark) -> Self {
        self.marks.push(mark);
        self
    }

    /// Makes one unit of x as long as one of y (linear axes, single figure only), as on a map of the flown track.
    #[must_use]
    pub fn equal_scale(mut self) -> Self {
        self.equal_scale = true;
        self
    }
}

/// Figures stacked over one x axis, the first on top.
///
/// The x axis (label, unit, linear or logarithmic) is that of the first figure; its range covers all of them.
#[derive(Clone, Debug)]
pub struct Panels {
    /// From top to bottom.
    pub figures: Vec<Figure>,
}

impl Panels {
    /// Stacks `figures`, the first on top.
    pub fn new(figures: impl Into<Vec<Figure>>) -> Self {
        Self { figures: figures.into() }
    }
}

impl From<Figure> for Panels {
    fn from(figure: Figure) -> Self {
        Self { figures: vec![figure] }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_goes_through_the_end_of_each_tread() {
        let points = [(0.0, 1.0), (2.0, 3.0)];
        let corners = |series: Series| series.corners(|_| true).collect::<Vec<_>>();
        assert_eq!(corners(Series::line("", Style::Measured, points)), points);
        assert_eq!(corners(Series::step("", Style::Measured, points)), [(0.0, 1.0), (2.0, 1.0), (2.0, 3.0)]);
    }

    #[test]
    fn bars_are_as_wide_as_their_nearest_neighbours_are_apart() {
        let width = |data: &[(f64, f64)]| Series::bars("", Style::Measured, data).half_bar_width();
        assert_eq!(width(&[(0.0, 1.0), (4.0, 1.0), (5.0, 1.0), (f64::NAN, 1.0)]), 0.5);
        assert_eq!(width(&[(7.0, 1.0)]), 0.5);
        assert_eq!(width(&[(0.0, 1.0), (4.0, 1.0)]), 2.0);
    }
}
