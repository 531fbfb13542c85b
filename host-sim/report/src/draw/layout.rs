//! Where everything stands: sizes and scales of a stack of plots.

use super::legend::Header;
use super::text::{LINE_PX, TEXT_PX, text_width, wrap};
use crate::axis::{Extent, Scale};
use crate::figure::{Figure, Kind, Mark, Series};

/// Room right of the plot, for the half of the last tick label that sticks out.
pub(super) const RIGHT_PX: i32 = 24;
/// Tick labels below the last plot.
pub(super) const TICKS_PX: i32 = 24;
/// Label of the x axis below the tick labels.
const X_LABEL_PX: i32 = 22;
/// Space below each plot of a stack but the last.
pub(super) const BETWEEN_PX: i32 = 12;
const SMALLEST_PLOT_PX: i32 = 90;

/// Sizes in CSS pixels and the scales, for all panels of a stack.
pub(super) struct Layout {
    pub(super) width: i32,
    pub(super) height: i32,
    /// Left edge of every plot.
    pub(super) left: i32,
    pub(super) plot_height: i32,
    pub(super) headers: Vec<Header>,
    /// Lines of the y labels.
    pub(super) y_titles: Vec<Vec<String>>,
    pub(super) x: Scale,
    pub(super) y: Vec<Scale>,
}

impl Layout {
    pub(super) fn new(figures: &[Figure], width: i32, height: i32) -> Self {
        let headers: Vec<_> = figures.iter().map(|figure| Header::new(figure, width)).collect();
        let count = figures.len() as i32;
        let around = headers.iter().map(Header::height).sum::<i32>()
            + BETWEEN_PX * (count - 1)
            + TICKS_PX
            + X_LABEL_PX;
        let plot_height = ((height - around) / count).max(SMALLEST_PLOT_PX);
        let (x_extent, y_extents) = extents(figures);
        let y_target = (plot_height / 42).clamp(2, 8) as usize;
        let mut y: Vec<_> = std::iter::zip(figures, &y_extents)
            .map(|(figure, extent)| Scale::new(&figure.y, *extent, y_margin(figure, *extent), y_target))
            .collect();
        let y_titles: Vec<_> = y.iter().map(|scale| wrap(&scale.title(), plot_height, TEXT_PX)).collect();
        let title_lines = y_titles.iter().map(Vec::len).max().unwrap_or(0) as i32;
        let tick_width =
            y.iter().flat_map(Scale::tick_labels).map(|label| text_width(&label, TEXT_PX)).max().unwrap_or(0);
        let left = title_lines * LINE_PX + tick_width + 18;
        let plot_width = (width - left - RIGHT_PX).max(SMALLEST_PLOT_PX);
        let mut x = fitting_x_scale(figures, x_extent, plot_width);
        if let [figure] = figures
            && figure.equal_scale
            && !figure.x.logarithmic
            && !figure.y.logarithmic
        {
            equalise(&mut x, &mut y[0], plot_width, plot_height, y_target);
        }
        if x_extent.is_empty() {
            x.remove_ticks();
        }
        y.iter_mut()
            .zip(&y_extents)
            .filter(|(_, extent)| extent.is_empty())
            .for_each(|(scale, _)| scale.remove_ticks());
        let (width, height) = (left + plot_width + RIGHT_PX, around + plot_height * count);
        Self { width, height, left, plot_height, headers, y_titles, x, y }
    }

    /// Upper edge of a plot.
    pub(super) fn top(&self, i: usize) -> i32 {
        let headers: i32 = self.headers[..=i].iter().map(Header::height).sum();
        headers + i as i32 * (self.plot_height + BETWEEN_PX)
    }
}

/// Ranges of the data and marks: x over all figures, y for each.
fn extents(figures: &[Figure]) -> (Extent, Vec<Extent>) {
    let x_axis = &figures[0].x;
    let mut x = Extent::default();
    let mut all_y = vec![];
    for figure in figures {
        let mut y = Extent::default();
        for series in &figure.series {
            let points = series
                .corners(|x| x_axis.can_draw(x))
                .filter(|(x, y)| x_axis.can_draw(*x) && figure.y.can_draw(*y));
            let half = if series.kind == Kind::Bars { series.half_bar_width() } else { 0.0 };
            for point in points {
                [point.0 - half, point.0 + half]
                    .into_iter()
                    .filter(|v| x_axis.can_draw(*v))
                    .for_each(|v| x.add(v));
                y.add(point.1);
            }
            if series.kind == Kind::Bars && !y.is_empty() && !figure.y.logarithmic {
                y.add(0.0);
            }
        }
        // A mark alone does not make a range: limits without data would look like data that stays within them.
        if !y.is_empty() {
            let (mark_x, mark_y) = mark_extents(figure);
            mark_x.into_iter().filter(|v| x_axis.can_draw(*v)).for_each(|v| x.add(v));
            mark_y.into_iter().filter(|v| figure.y.can_draw(*v)).for_each(|v| y.add(v));
        }
        all_y.push(y);
    }
    (x, all_y)
}

/// Shares of the range added below and above the data; bars that all rise stand on the axis.
fn y_margin(figure: &Figure, extent: Extent) -> (f64, f64) {
    let has_bars = figure.series.iter().any(|series| series.kind == Kind::Bars);
    let below = if has_bars && extent.low() == Some(0.0) { 0.0 } else { 0.05 };
    (below, 0.05)
}

fn mark_extents(figure: &Figure) -> (Vec<f64>, Vec<f64>) {
    let (mut xs, mut ys) = (vec![], vec![]);
    for mark in &figure.marks {
        match mark {
            Mark::Horizontal { y, .. } => ys.push(*y),
            Mark::Vertical { x, .. } => xs.push(*x),
            Mark::HorizontalBand { y, .. } => ys.extend([y.0, y.1]),
            Mark::VerticalBand { x, .. } => xs.extend([x.0, x.1]),
        }
    }
    (xs, ys)
}

/// As many ticks as their labels leave room for.
fn fitting_x_scale(figures: &[Figure], extent: Extent, plot_width: i32) -> Scale {
    let on_the_edge = |s: &Series| s.kind == Kind::Points;
    let needs_margin = figures.iter().any(|f| f.equal_scale || f.series.iter().any(on_the_edge));
    let margin = if needs_margin { (0.03, 0.03) } else { (0.0, 0.0) };
    let most = (plot_width / 80).clamp(2, 12);
    let scales = (2..=most).rev().map(|target| Scale::new(&figures[0].x, extent, margin, target as usize));
    let fits = |scale: &Scale| {
        let widths: Vec<_> = scale.tick_labels().map(|label| text_width(&label, TEXT_PX) + 14).collect();
        widths.iter().max().unwrap_or(&0) * widths.len() as i32 <= plot_width
    };
    let fewest = Scale::new(&figures[0].x, extent, margin, 2);
    let mut scales = scales;
    scales.find(fits).unwrap_or(fewest)
}

/// Lengthens the range of one axis until a unit is equally long on both.
fn equalise(x: &mut Scale, y: &mut Scale, plot_width: i32, plot_height: i32, y_target: usize) {
    let x_px_per_unit = f64::from(plot_width) / x.length();
    let y_px_per_unit = f64::from(plot_height) / y.length();
    if x_px_per_unit > y_px_per_unit {
        *x = x.stretched(x_px_per_unit / y_px_per_unit, (plot_width / 90).clamp(2, 10) as usize);
    } else {
        *y = y.stretched(y_px_per_unit / x_px_per_unit, y_target);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::Axis;
    use crate::style::Style;

    fn figure(data: &[(f64, f64)]) -> Figure {
        Figure::new("", Axis::new("x", ""), Axis::new("y", "")).with(Series::line("", Style::Measured, data))
    }

    #[test]
    fn a_stack_shares_its_range_of_x_only() {
        let layout =
            Layout::new(&[figure(&[(0.0, 1.0), (1.0, 2.0)]), figure(&[(4.0, 7.0), (5.0, 9.0)])], 800, 500);
        assert_eq!(layout.x.ends(), (0.0, 5.0));
        assert!(layout.y[0].ends().1 < 3.0 && layout.y[1].ends().0 > 6.0);
    }

    #[test]
    fn marks_alone_are_no_range() {
        let alone = figure(&[]).mark(Mark::limit("", 50.0));
        assert!(extents(&[alone]).1[0].is_empty());
        let (_, y) = extents(&[figure(&[(0.0, 1.0)]).mark(Mark::limit("", 50.0))]);
        assert_eq!(y[0].low(), Some(1.0));
        assert!(Scale::new(&Axis::new("", ""), y[0], (0.0, 0.0), 5).ends().1 >= 50.0);
    }

    #[test]
    fn an_equal_scale_gives_both_axes_the_same_length_a_unit() {
        let layout = Layout::new(&[figure(&[(0.0, 0.0), (1.0, 20.0)]).equal_scale()], 800, 500);
        let plot_width = f64::from(layout.width - layout.left - RIGHT_PX);
        let (x, y) = (plot_width / layout.x.length(), f64::from(layout.plot_height) / layout.y[0].length());
        assert!((x / y - 1.0).abs() < 1e-9, "{x} {y}");
    }
}
