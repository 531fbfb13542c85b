//! What the script of a page knows of a drawn figure, as JSON: where its axes lie, and the numbers behind its lines.
//!
//! Lines are drawn with as many points as there are pixels. Here they have all their samples, or where these are very many the
//! first, lowest, highest and last of each of [`COLUMNS`] parts of the axis, so that a part of the figure can be looked at closely.
//! Numbers are 32-bit floats, little endian, in base 64; those along the horizontal axis count from its lower end.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use plotters::style::RGBColor;
use serde_json::{Map, Value, json};

use super::layout::{Layout, RIGHT_PX};
use super::plot::MOST_MARKERS;
use crate::axis::Scale;
use crate::decimate;
use crate::figure::{Figure, Kind, Mark, Series};
use crate::number::unit;
use crate::style::{Look, Marker, Style};

/// Parts of the axis, ten times magnified still one for each few pixels.
const COLUMNS: f64 = 2048.0;
/// Lines with no more samples have all of them.
const ALL: usize = 8192;

/// The figures of one drawing.
pub(super) fn data(figures: &[Figure], layout: &Layout) -> String {
    // A map keeps its shape, and a bar its foot.
    let zooms = figures.iter().all(|f| !f.equal_scale && f.series.iter().all(|s| s.kind != Kind::Bars));
    let mut columns = Columns::default();
    let panels = figures.iter().enumerate().map(|(i, figure)| {
        let top = layout.top(i);
        let lines = figure.series.iter().map(|series| line(series, layout, i, &mut columns));
        let lines: Vec<Value> = lines.collect();
        let marks: Vec<Value> =
            figure.marks.iter().filter_map(|mark| marked(mark, &layout.x, &layout.y[i])).collect();
        json!({
            "name": figure.title,
            "top": top,
            "bottom": top + layout.plot_height,
            "y": axis(&layout.y[i]),
            "lines": lines,
            "marks": marks,
        })
    });
    let panels: Vec<Value> = panels.collect();
    let all = json!({
        "width": layout.width,
        "left": layout.left,
        "right": layout.width - RIGHT_PX,
        "zooms": zooms,
        "x": axis(&layout.x),
        "columns": columns.0,
        "panels": panels,
    });
    not_markup(&all.to_string())
}

/// JSON without a character that HTML or XML could read as its own: in JSON these stand in texts only.
fn not_markup(json: &str) -> String {
    json.replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026")
}

/// Numbers of all lines; those that several lines have, such as their times, are there once.
#[derive(Default)]
struct Columns(Vec<String>);

impl Columns {
    fn add(&mut self, values: impl Iterator<Item = f64>) -> usize {
        let column = base64(values);
        let place = self.0.iter().position(|known| *known == column);
        place.unwrap_or_else(|| {
            self.0.push(column);
            self.0.len() - 1
        })
    }
}

fn line(series: &Series, layout: &Layout, i: usize, columns: &mut Columns) -> Value {
    let (x, y) = (&layout.x, &layout.y[i]);
    let points = points(series, x, y);
    let from = if x.axis().logarithmic { 0.0 } else { x.ends().0 };
    let [across, upwards] = [
        columns.add(points.iter().map(|point| point.0 - from)),
        columns.add(points.iter().map(|point| point.1)),
    ];
    let kind = match series.kind {
        Kind::Line => "line",
        Kind::Points => "points",
        Kind::Step => "step",
        Kind::Bars => "bars",
    };
    let half = if series.kind == Kind::Bars { series.half_bar_width() } else { 0.0 };
    let numbers = json!({ "kind": kind, "x": across, "y": upwards, "of": series.data.len(), "half": half });
    let mut told = named(&series.name, series.style, numbers);
    if series.kind == Kind::Points {
        told["marker"] = json!(match series.style.look().marker {
            Marker::Disc => "disc",
            Marker::Triangle => "triangle",
            Marker::Cross => "cross",
        });
    }
    told
}

/// The samples of a series, thinned where they are very many. Not a number in y is a gap.
fn points(series: &Series, x: &Scale, y: &Scale) -> Vec<(f64, f64)> {
    let place = |(across, upwards): (f64, f64)| {
        (x.can_draw(across) && y.can_draw(upwards)).then(|| (COLUMNS * x.fraction(across), upwards))
    };
    let back = |(column, upwards): (f64, f64)| (x.value(column / COLUMNS), upwards);
    if series.kind == Kind::Points {
        let places: Vec<_> = series.data.iter().filter_map(|point| place(*point)).collect();
        if places.len() > MOST_MARKERS {
            return decimate::cloud(&places, MOST_MARKERS).into_iter().map(back).collect();
        }
    } else if series.data.len() > ALL {
        let runs = decimate::line(series.data.iter().map(|point| place(*point)));
        let gap = |run: Vec<(f64, f64)>| {
            let end = run.last().map(|last| (last.0, f64::NAN));
            run.into_iter().chain(end)
        };
        return runs.into_iter().flat_map(gap).map(back).collect();
    }
    let mut last = x.ends().0;
    let known = |(across, upwards): &(f64, f64)| {
        if x.can_draw(*across) {
            last = *across;
            return (last, if y.can_draw(*upwards) { *upwards } else { f64::NAN });
        }
        (last, f64::NAN)
    };
    series.data.iter().map(known).collect()
}

fn marked(mark: &Mark, x: &Scale, y: &Scale) -> Option<Value> {
    let (along, name, [from, to], style) = match mark {
        Mark::Horizontal { name, y, style } => ("y", name, [*y, *y], style),
        Mark::Vertical { name, x, style } => ("x", name, [*x, *x], style),
        Mark::HorizontalBand { name, y, style } => ("y", name, [y.0, y.1], style),
        Mark::VerticalBand { name, x, style } => ("x", name, [x.0, x.1], style),
    };
    let scale = if along == "x" { x } else { y };
    let band = matches!(mark, Mark::HorizontalBand { .. } | Mark::VerticalBand { .. });
    let place = json!({ "along": along, "band": band, "from": from, "to": to });
    (scale.can_draw(from) && scale.can_draw(to)).then(|| named(name, *style, place))
}

fn axis(scale: &Scale) -> Value {
    let ((low, high), axis) = (scale.drawn(), scale.axis());
    json!({
        "name": axis.label,
        "unit": unit(&axis.unit),
        "log": axis.logarithmic,
        "low": low,
        "high": high,
        "power": scale.power(),
    })
}

/// What something is called and how it looks, and more of it.
fn named(name: &str, style: Style, more: Value) -> Value {
    let Look { colour: RGBColor(r, g, b), width, dash, .. } = style.look();
    let dash = dash.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    let mut all = Map::new();
    all.insert("name".into(), name.into());
    all.insert("colour".into(), format!("#{r:02X}{g:02X}{b:02X}").into());
    all.insert("stroke".into(), width.into());
    all.insert("dash".into(), dash.into());
    if let Value::Object(more) = more {
        all.extend(more);
    }
    all.into()
}

fn base64(values: impl Iterator<Item = f64>) -> String {
    STANDARD.encode(values.flat_map(|value| (value as f32).to_le_bytes()).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::axis::{Axis, Extent};

    fn scale(low: f64, high: f64) -> Scale {
        let mut extent = Extent::default();
        [low, high].into_iter().for_each(|end| extent.add(end));
        Scale::new(&Axis::new("", ""), extent, (0.0, 0.0), 5)
    }

    #[test]
    fn numbers_are_four_bytes_each_in_base_64() {
        // 1.0 is 00 00 80 3F.
        assert_eq!(base64([1.0].into_iter()), "AACAPw==");
        assert_eq!(base64([1.0, 1.0].into_iter()), "AACAPwAAgD8=");
        assert_eq!(base64([1.0, 1.0, 1.0].into_iter()), "AACAPwAAgD8AAIA/");
        assert_eq!(base64([].into_iter()), "");
    }

    #[test]
    fn times_that_lines_share_are_there_once() {
        let mut columns = Columns::default();
        let places = [[0.0, 1.0], [5.0, 6.0], [0.0, 1.0]].map(|values| columns.add(values.into_iter()));
        assert_eq!((places, columns.0.len()), ([0, 1, 0], 2));
    }

    #[test]
    fn text_is_neither_markup_nor_the_end_of_a_script() {
        let name = "a</script>&\"\\\u{1}°";
        let text = not_markup(&json!({ "name": name }).to_string());
        assert!(!text.contains(['<', '>', '&']), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap()["name"], name);
    }

    #[test]
    fn a_line_has_all_its_samples_and_a_very_long_one_its_peaks() {
        let (x, y) = (scale(0.0, 100.0), scale(0.0, 9.0));
        let of = |count: u32| {
            let data: Vec<_> = (0..count)
                .map(|i| (100.0 * f64::from(i) / f64::from(count), f64::from(i % 7)))
                .map(|(t, v)| if (50.0..50.001).contains(&t) { (t, 9.0) } else { (t, v) })
                .collect();
            points(&Series::line("", Style::Measured, data), &x, &y)
        };
        assert_eq!(of(6000).len(), 6000);
        let thinned = of(600_000);
        assert!((4000..=8200).contains(&thinned.len()), "{}", thinned.len());
        let peak = thinned.iter().find(|point| point.1 == 9.0).expect("the peak");
        assert!((50.0..50.001).contains(&peak.0), "{peak:?}");
        assert!(thinned.windows(2).all(|pair| pair[0].0 <= pair[1].0));
    }

    #[test]
    fn what_cannot_be_drawn_is_a_gap_in_its_place() {
        let (x, y) = (scale(0.0, 10.0), scale(0.0, 1.0));
        let data = vec![(1.0, 0.5), (2.0, f64::NAN), (f64::INFINITY, 0.5), (4.0, 1e200), (5.0, 0.5)];
        let points = points(&Series::line("", Style::Measured, data), &x, &y);
        assert_eq!(points.iter().map(|point| point.0).collect::<Vec<_>>(), [1.0, 2.0, 2.0, 4.0, 5.0]);
        assert_eq!(
            points.iter().map(|point| point.1.is_nan()).collect::<Vec<_>>(),
            [false, true, true, true, false]
        );
    }
}
