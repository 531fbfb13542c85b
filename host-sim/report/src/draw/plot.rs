//! Axes, grid, marks and series of one plot.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::cartesian::Cartesian2d;
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, FontTransform, RGBColor};

use super::canvas::{
    Area, BAND_OPACITY, BAR_OPACITY, Backend, INK, MARKER_UNITS, Outcome, UNITS, draw_marker, fill, stroke,
    text, to_units, units,
};
use super::layout::{Layout, RIGHT_PX, TICKS_PX};
use super::text::{LINE_PX, TEXT_PX, TITLE_PX};
use crate::axis::Scale;
use crate::decimate;
use crate::figure::{Figure, Kind, Mark, Series};

/// More markers than this cannot be told apart and make the file heavy.
pub(super) const MOST_MARKERS: usize = 1500;
const GRID: RGBColor = RGBColor(0xDD, 0xDD, 0xDD);
const FINE_GRID: RGBColor = RGBColor(0xF0, 0xF0, 0xF0);

type Chart<'a, 'b> = ChartContext<'b, Backend<'a>, Cartesian2d<Scale, Scale>>;

/// Axes, grid, marks and series of panel `i`, the plot starting `top` pixels down.
pub(super) fn draw_plot(root: &Area<'_>, figure: &Figure, layout: &Layout, i: usize, top: i32) -> Outcome {
    draw_y_title(root, &layout.y_titles[i], top + layout.plot_height / 2)?;
    let last = i + 1 == layout.y.len();
    let below = if last { TICKS_PX } else { 0 };
    let frame = root.clone().shrink(
        units(0, top),
        ((layout.width * UNITS) as u32, ((layout.plot_height + below) * UNITS) as u32),
    );
    let mut chart = ChartBuilder::on(&frame)
        .margin_right(RIGHT_PX * UNITS)
        .y_label_area_size(layout.left * UNITS)
        .x_label_area_size(below * UNITS)
        .build_cartesian_2d(layout.x.clone(), layout.y[i].clone())?;
    draw_grid(&mut chart)?;
    let area = chart.plotting_area().strip_coord_spec();
    Plot { area, x: &layout.x, y: &layout.y[i], figure }.draw()
}

fn draw_y_title(root: &Area<'_>, lines: &[String], middle: i32) -> Outcome {
    let style = text(TEXT_PX).transform(FontTransform::Rotate270).pos(Pos::new(HPos::Center, VPos::Center));
    for (i, line) in lines.iter().enumerate() {
        root.draw(&Text::new(
            line.as_str(),
            units(LINE_PX * i as i32 + LINE_PX / 2 + 3, middle),
            style.clone(),
        ))?;
    }
    Ok(())
}

fn draw_grid(chart: &mut Chart<'_, '_>) -> Outcome {
    chart
        .configure_mesh()
        .light_line_style(FINE_GRID.stroke_width(UNITS as u32))
        .bold_line_style(GRID.stroke_width(UNITS as u32))
        .axis_style(INK.stroke_width(UNITS as u32))
        .set_all_tick_mark_size(4 * UNITS)
        .label_style(text(TEXT_PX))
        .draw()
}

/// The area inside the axes, with drawing units from its upper left corner as coordinates.
struct Plot<'a, 'b> {
    area: Area<'b>,
    x: &'a Scale,
    y: &'a Scale,
    figure: &'a Figure,
}

impl Plot<'_, '_> {
    fn draw(&self) -> Outcome {
        if self.is_empty() {
            let style = text(TITLE_PX).pos(Pos::new(HPos::Center, VPos::Center));
            let (width, height) = self.size_px();
            return self.area.draw(&Text::new("no data", to_units((width / 2.0, height / 2.0)), style));
        }
        for mark in &self.figure.marks {
            self.draw_mark(mark)?;
        }
        for series in &self.figure.series {
            match series.kind {
                Kind::Line | Kind::Step => self.draw_line(series)?,
                Kind::Points => self.draw_points(series)?,
                Kind::Bars => self.draw_bars(series)?,
            }
        }
        Ok(())
    }

    fn is_empty(&self) -> bool {
        self.figure.series.iter().all(|series| series.data.iter().all(|point| self.place(*point).is_none()))
    }

    fn size_px(&self) -> (f64, f64) {
        let (width, height) = self.area.dim_in_pixel();
        (f64::from(width) / f64::from(UNITS), f64::from(height) / f64::from(UNITS))
    }

    fn x_px(&self, x: f64) -> Option<f64> {
        self.x.can_draw(x).then(|| self.x.fraction(x) * self.size_px().0)
    }

    fn y_px(&self, y: f64) -> Option<f64> {
        self.y.can_draw(y).then(|| (1.0 - self.y.fraction(y)) * self.size_px().1)
    }

    /// CSS pixels from the upper left corner of the plot; `None` for a gap.
    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x_px(x)?, self.y_px(y)?))
    }

    fn draw_mark(&self, mark: &Mark) -> Outcome {
        let (width, height) = self.size_px();
        let corners = match mark {
            Mark::Horizontal { y, .. } => self.y_px(*y).map(|y| ((0.0, y), (width, y))),
            Mark::Vertical { x, .. } => self.x_px(*x).map(|x| ((x, 0.0), (x, height))),
            Mark::HorizontalBand { y, .. } => self
                .y_px(y.0.max(y.1))
                .zip(self.y_px(y.0.min(y.1)))
                .map(|(top, bottom)| ((0.0, top), (width, bottom))),
            Mark::VerticalBand { x, .. } => self
                .x_px(x.0.min(x.1))
                .zip(self.x_px(x.0.max(x.1)))
                .map(|(left, right)| ((left, 0.0), (right, height))),
        };
        let Some((from, to)) = corners.map(|(from, to)| (to_units(from), to_units(to))) else {
            return Ok(());
        };
        match mark {
            Mark::Horizontal { style, .. } | Mark::Vertical { style, .. } => {
                self.area.draw(&PathElement::new(vec![from, to], stroke(*style)))
            }
            Mark::HorizontalBand { style, .. } | Mark::VerticalBand { style, .. } => {
                self.area.draw(&Rectangle::new([from, to], fill(*style, BAND_OPACITY)))
            }
        }
    }

    fn draw_line(&self, series: &Series) -> Outcome {
        let style = series.style;
        let points = series.corners(|x| self.x.can_draw(x));
        for run in decimate::line(points.map(|point| self.place(point))) {
            match run.as_slice() {
                // A lone point between two gaps has no line to be seen by.
                [point] => self.area.draw(&Circle::new(to_units(*point), UNITS * 3 / 2, fill(style, 1.0)))?,
                run => self.area.draw(&PathElement::new(
                    run.iter().copied().map(to_units).collect::<Vec<_>>(),
                    stroke(style),
                ))?,
            }
        }
        Ok(())
    }

    fn draw_points(&self, series: &Series) -> Outcome {
        let places: Vec<_> = series.data.iter().filter_map(|point| self.place(*point)).collect();
        let places = decimate::cloud(&places, MOST_MARKERS);
        let radius_units = if places.len() > 300 { UNITS * 3 / 2 } else { MARKER_UNITS };
        places
            .into_iter()
            .try_for_each(|place| draw_marker(&self.area, to_units(place), series.style, radius_units))
    }

    fn draw_bars(&self, series: &Series) -> Outcome {
        let half = series.half_bar_width();
        let (width, height) = self.size_px();
        let base = self.y_px(0.0).unwrap_or(height);
        // More bars than pixel columns: those that reach furthest in each column stand for the others.
        let tops = decimate::line(series.data.iter().map(|point| self.place(*point)));
        let half_px = series
            .data
            .iter()
            .find_map(|(x, _)| Some(0.48 * (self.x_px(x + half)? - self.x_px(x - half)?)))
            .unwrap_or(1.0)
            .max(0.4);
        for (x, top) in tops.into_iter().flatten() {
            let (left, right) = ((x - half_px).max(0.0), (x + half_px).min(width));
            let corners = [to_units((left, top.min(base))), to_units((right, top.max(base)))];
            self.area.draw(&Rectangle::new(corners, fill(series.style, BAR_OPACITY)))?;
        }
        Ok(())
    }
}
