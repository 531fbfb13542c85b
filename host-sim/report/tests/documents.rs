//! The SVG and HTML that leave this crate, read back by an independent XML parser.
//!
//! Checked: well-formed for any input, text escaped, nothing fetched from outside, gaps really gaps, peaks really there, marks in place,
//! the same bytes every time.

use std::collections::HashSet;

use proptest::prelude::*;
use report::{
    Axis, Cell, Column, Figure, InputFile, Kind, Mark, Page, Panels, Provenance, Sample, Section, Series,
    Style, Table, Verdict, binned_scatter, histogram,
};
use roxmltree::{Document, Node, ParsingOptions};
use serde_json::Value;

fn parse(text: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).unwrap_or_else(|error| panic!("{error} in\n{text}"))
}

fn elements<'a>(document: &'a Document<'_>, tag: &str) -> Vec<Node<'a, 'a>> {
    document.descendants().filter(|node| node.tag_name().name() == tag).collect()
}

/// Points of each polyline of the given colour that is long enough not to be a legend swatch, in tenths of a pixel.
fn lines(svg: &str, colour: &str) -> Vec<Vec<(f64, f64)>> {
    let document = parse(svg);
    let points = |node: &Node<'_, '_>| -> Vec<(f64, f64)> {
        let text = node.attribute("points").unwrap();
        let pair =
            |p: &str| p.split_once(',').map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap())).unwrap();
        text.split_whitespace().map(pair).collect()
    };
    elements(&document, "polyline")
        .iter()
        .filter(|n| n.attribute("stroke") == Some(colour))
        .map(points)
        .collect()
}

const BLUE: &str = "#0072B2";

fn line_figure(data: Vec<(f64, f64)>) -> Figure {
    // Without a name there is no legend, hence no swatch among the lines.
    Figure::new("t", Axis::new("time", "s"), Axis::new("y", "m")).with(Series::line(
        "",
        Style::PredictedAfter,
        data,
    ))
}

#[test]
fn nan_and_infinity_are_gaps() {
    let data = vec![
        (0.0, 1.0),
        (1.0, 2.0),
        (2.0, f64::NAN),
        (3.0, 2.0),
        (4.0, 1.0),
        (5.0, f64::INFINITY),
        (6.0, 0.0),
        (7.0, 1.0),
    ];
    let runs = lines(&line_figure(data).to_svg(800, 300), BLUE);
    assert_eq!(runs.iter().map(Vec::len).collect::<Vec<_>>(), [2, 2, 2]);
}

#[test]
fn a_point_between_gaps_is_a_dot() {
    let svg = line_figure(vec![(0.0, f64::NAN), (1.0, 2.0), (2.0, f64::NAN)]).to_svg(800, 300);
    assert_eq!(elements(&parse(&svg), "circle").len(), 1);
}

#[test]
fn a_million_samples_stay_small_and_keep_their_peak() {
    let peak = 654_321;
    let data: Vec<_> = (0..1_000_000)
        .map(|i| (f64::from(i) * 1e-3, if i == peak { 100.0 } else { f64::from(i % 7) }))
        .collect();
    let svg = line_figure(data).to_svg(800, 300);
    // Four points of about ten characters for each of less than 800 columns.
    assert!(svg.len() < 80_000, "{}", svg.len());
    let runs = lines(&svg, BLUE);
    let line = &runs[0];
    let top = line.iter().copied().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    let (left, right) = (line[0].0, line[line.len() - 1].0);
    let bottom = line.iter().map(|p| p.1).fold(0.0, f64::max);
    let second_highest = line.iter().map(|p| p.1).filter(|y| *y > top.1).fold(f64::INFINITY, f64::min);
    // On paper as in the data: 654321 of 999999 along, 94 of 100 above its neighbours, both to a tenth of a pixel in about 100.
    assert!(((top.0 - left) / (right - left) - 0.654_321).abs() < 2e-3);
    assert!(((second_highest - top.1) / (bottom - top.1) - 0.94).abs() < 2e-3);
}

#[test]
fn a_step_holds_its_value() {
    let step = Series::step("", Style::PredictedAfter, [(0.0, 0.0), (1.0, 10.0), (2.0, 5.0)]);
    let svg = Figure::new("", Axis::new("t", "s"), Axis::new("y", "")).with(step).to_svg(800, 300);
    let runs = lines(&svg, BLUE);
    assert!(runs[0].windows(2).all(|w| w[0].0 == w[1].0 || w[0].1 == w[1].1), "{runs:?}");
}

#[test]
fn a_limit_outside_the_data_is_inside_the_plot() {
    let limit = |y| {
        lines(&line_figure(vec![(0.0, 0.0), (1.0, 1.0)]).mark(Mark::limit("", y)).to_svg(800, 300), "#CC79A7")
    };
    let drawn = limit(50.0);
    assert_eq!(drawn.len(), 1);
    assert!(drawn[0].iter().all(|p| (0.0..3000.0).contains(&p.1)), "{drawn:?}");
    assert!(limit(f64::NAN).is_empty());
}

#[test]
fn dashes_belong_to_their_roles() {
    let data = vec![(0.0, 0.0), (1.0, 1.0)];
    let dash = |style| {
        let figure =
            Figure::new("", Axis::new("", ""), Axis::new("", "")).with(Series::line("", style, data.clone()));
        let svg = figure.to_svg(400, 300);
        let document = parse(&svg);
        // The axes are lines in ink; what remains is the series.
        let drawn =
            elements(&document, "polyline").into_iter().find(|n| n.attribute("stroke") != Some("#222222"));
        drawn.expect("the series is drawn").attribute("stroke-dasharray").map(str::to_owned)
    };
    assert_eq!(dash(Style::Measured), None);
    assert_eq!(dash(Style::PredictedAfter), None);
    let dashed =
        [Style::PredictedBefore, Style::Reference, Style::Limit].map(|style| dash(style).expect("dashed"));
    assert_eq!(dashed.iter().collect::<HashSet<_>>().len(), 3);
}

#[test]
fn panels_share_their_x_axis() {
    let panel = |from: f64| line_figure(vec![(from, 0.0), (from + 5.0, 1.0)]);
    let svg = Panels::new([panel(0.0), panel(5.0)]).to_svg(800, 500);
    let runs = lines(&svg, BLUE);
    // The first ends in x where the second begins.
    assert_eq!(runs.len(), 2);
    assert_eq!(runs[0][1].0, runs[1][0].0);
    let text = parse(&svg)
        .root_element()
        .descendants()
        .filter(Node::is_text)
        .filter_map(|n| n.text())
        .collect::<Vec<_>>()
        .join("|");
    assert_eq!(text.matches("time [s]").count(), 1, "{text}");
}

#[test]
fn without_data_the_figure_says_so() {
    let no_value = vec![(0.0, f64::NAN), (f64::INFINITY, 1.0)];
    let figures = [
        line_figure(vec![]),
        line_figure(no_value).mark(Mark::limit("limit", 3.0)),
        histogram("h", Axis::new("x", "N"), &[Sample { name: "a", style: Style::Measured, values: &[] }], 10),
        binned_scatter("s", Axis::new("x", ""), Axis::new("y", ""), &[], 10),
    ];
    for figure in figures {
        assert!(figure.to_svg(800, 300).contains("no data"), "{}", figure.title);
    }
    parse(&Panels::new([]).to_svg(800, 300));
    assert!(!line_figure(vec![(0.0, 1.0)]).to_svg(800, 300).contains("no data"));
}

const NASTY: &str = "<script>alert(\"1\")</script> & 'x' ]]> \u{0} \u{1b}[31m \u{FFFE}";

fn nasty_page() -> Page {
    let figure = Figure::new(NASTY, Axis::new(NASTY, NASTY), Axis::new(NASTY, NASTY))
        .with(Series::line(NASTY, Style::Measured, [(0.0, 0.0), (1.0, 1.0)]))
        .mark(Mark::limit(NASTY, 0.5));
    let table = Table::new(NASTY, [Column::text(NASTY), Column::number(NASTY, NASTY)])
        .row([Cell::from(NASTY).verdict(Verdict::Bad), Cell::number(f64::NAN, 3), Cell::from("surplus")])
        .row([NASTY]);
    let section = Section::new(NASTY)
        .paragraph(NASTY)
        .list([NASTY])
        .preformatted(NASTY)
        .table(table)
        .figure(figure.clone(), NASTY)
        .figure(Panels::new([figure.clone(), figure]), NASTY);
    Page::new(NASTY, NASTY).section(section).provenance(Provenance {
        command_line: NASTY.into(),
        version: NASTY.into(),
        date: NASTY.into(),
        inputs: vec![InputFile { path: NASTY.into(), hash: NASTY.into() }],
    })
}

#[test]
fn a_flight_named_script_is_only_text() {
    let html = nasty_page().render();
    let document = parse(&html);
    let kinds: Vec<_> =
        elements(&document, "script").iter().map(|node| node.attribute("type").unwrap()).collect();
    assert_eq!(kinds, ["application/json", "application/json", "module"]);
    assert!(!html.contains("<script>"), "{html}");
    let heading = elements(&document, "h1")[0].text().unwrap();
    assert!(heading.starts_with("<script>alert(\"1\")</script> & 'x'"), "{heading}");
}

#[test]
fn nothing_is_fetched_and_ids_are_unique() {
    let html = nasty_page().render();
    let document = parse(&html);
    let mut ids = HashSet::new();
    for node in document.descendants() {
        for attribute in node.attributes() {
            assert!(!["src", "href", "srcset", "data"].contains(&attribute.name()), "{attribute:?}");
            assert!(!attribute.name().starts_with("on"), "{attribute:?}");
            assert!(
                attribute.name() != "id" || ids.insert(attribute.value().to_owned()),
                "{attribute:?} twice"
            );
        }
    }
    let html = html.replace("url(#", "");
    for outside in ["url(", "@import", "import ", "import(", "fetch(", "XMLHttpRequest", "http:", "https:"] {
        let allowed = if outside == "http:" { html.matches("http://www.w3.org/").count() } else { 0 };
        assert_eq!(html.matches(outside).count(), allowed, "{outside}");
    }
}

/// What a page tells its script of its figures.
fn told(html: &str) -> Vec<Value> {
    let document = parse(html);
    let all = elements(&document, "script");
    let data = all.iter().filter(|node| node.attribute("type") == Some("application/json"));
    data.map(|node| serde_json::from_str(node.text().unwrap()).unwrap()).collect()
}

/// Numbers of a column: 32-bit floats in base 64.
fn column(figure: &Value, place: &Value) -> Vec<f64> {
    let text = figure["columns"][place.as_u64().unwrap() as usize].as_str().unwrap();
    let value = |c: u8| match c {
        b'A'..=b'Z' => c - b'A',
        b'a'..=b'z' => c - b'a' + 26,
        b'0'..=b'9' => c - b'0' + 52,
        b'+' => 62,
        _ => 63,
    };
    let bits: Vec<u8> = text
        .bytes()
        .filter(|c| *c != b'=')
        .flat_map(|c| (0..6).rev().map(move |bit| value(c) >> bit & 1))
        .collect();
    let bytes: Vec<u8> =
        bits.chunks_exact(8).map(|byte| byte.iter().fold(0, |all, bit| all << 1 | bit)).collect();
    bytes.chunks_exact(4).map(|four| f64::from(f32::from_le_bytes(four.try_into().unwrap()))).collect()
}

/// Places of the samples of a line in tenths of a pixel, by what the page tells its script.
fn places(figure: &Value, panel: &Value, line: &Value) -> Vec<(f64, f64)> {
    let number = |value: &Value| value.as_f64().unwrap();
    let drawn = |axis: &Value, value: f64| if axis["log"] == true { value.log10() } else { value };
    let share = |axis: &Value, value: f64| {
        (value - number(&axis["low"])) / (number(&axis["high"]) - number(&axis["low"]))
    };
    let (x, y) = (&figure["x"], &panel["y"]);
    let across = |value: f64| if x["log"] == true { value.log10() } else { value + number(&x["low"]) };
    let (left, right) = (number(&figure["left"]), number(&figure["right"]));
    let (top, bottom) = (number(&panel["top"]), number(&panel["bottom"]));
    let place = |(a, b): (&f64, &f64)| {
        let (a, b) = (share(x, across(*a)), share(y, drawn(y, *b)));
        (10.0 * (left + a * (right - left)), 10.0 * (bottom - b * (bottom - top)))
    };
    column(figure, &line["x"]).iter().zip(&column(figure, &line["y"])).map(place).collect()
}

#[test]
fn what_the_script_is_told_lies_where_it_is_drawn() {
    let wave: Vec<_> =
        (0..60).map(|i| (100.0 + 0.25 * f64::from(i), (0.3 * f64::from(i)).sin() - 4.0)).collect();
    let decay: Vec<_> = (1..40).map(|i| (f64::from(i * i), 1e3 / f64::from(i))).collect();
    let bode = Figure::new("b", Axis::logarithmic("frequency", "rad/s"), Axis::logarithmic("gain", "1"))
        .with(Series::line("", Style::PredictedAfter, decay));
    let stack = Panels::new([
        line_figure(wave.clone()),
        line_figure(wave.into_iter().map(|(t, y)| (t, 1e-5 * y)).collect()),
    ]);
    let html = Page::new("", "").section(Section::new("").figure(bode, "").figure(stack, "")).render();
    let figures = told(&html);
    let told: Vec<Vec<(f64, f64)>> = figures
        .iter()
        .flat_map(|figure| {
            figure["panels"]
                .as_array()
                .unwrap()
                .iter()
                .map(move |panel| places(figure, panel, &panel["lines"][0]))
        })
        .collect();
    let drawn = lines(&html, BLUE);
    assert_eq!((told.len(), drawn.len()), (3, 3));
    for (told, drawn) in told.iter().zip(&drawn) {
        assert_eq!(told.len(), drawn.len());
        for (a, b) in told.iter().zip(drawn) {
            assert!((a.0 - b.0).abs() <= 1.0 && (a.1 - b.1).abs() <= 1.0, "{a:?}, {b:?}");
        }
    }
    assert_eq!(figures[0]["x"]["unit"], "rad/s");
    assert_eq!(figures[0]["panels"][0]["y"]["unit"], "");
    assert_eq!(figures[1]["columns"].as_array().unwrap().len(), 3, "the panels have one time");
}

#[test]
fn a_page_without_figures_has_no_script() {
    assert!(!Page::new("t", "l").section(Section::new("s").paragraph("p")).render().contains("<script"));
}

#[test]
fn surplus_and_missing_cells_are_neither_lost_nor_shifted() {
    let table = Table::new("", [Column::text("a"), Column::number("b", "N")]).row(["1", "2", "3"]).row(["4"]);
    let html = Page::new("", "").section(Section::new("").table(table)).render();
    let document = parse(&html);
    let rows: Vec<Vec<_>> = elements(&document, "tr")
        .iter()
        .map(|row| row.children().map(|cell| cell.text().unwrap_or("").to_owned()).collect())
        .collect();
    assert_eq!(rows[1..], [["1", "2", "3"], ["4", "", ""]]);
    assert_eq!(rows[0].len(), 3);
}

#[test]
fn verdicts_are_told_by_a_symbol() {
    let row =
        [Verdict::Good, Verdict::Bad, Verdict::Neutral].map(|verdict| Cell::number(1.0, 2).verdict(verdict));
    let table = Table::new("", ["a", "b", "c"].map(|name| Column::number(name, ""))).row(row);
    let html = Page::new("", "").section(Section::new("").table(table)).render();
    for expected in ["✓\u{a0}1.0", "✗\u{a0}1.0", "–\u{a0}1.0"] {
        assert!(html.contains(expected), "{expected}");
    }
}

#[test]
fn the_same_page_gives_the_same_bytes() {
    assert_eq!(nasty_page().render(), nasty_page().render());
}

#[test]
fn a_page_is_written_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("page.html");
    nasty_page().write(&path).unwrap();
    assert_eq!(std::fs::read_to_string(&path).unwrap(), nasty_page().render());
    let error = nasty_page().write(folder.path()).unwrap_err().to_string();
    assert!(error.contains(folder.path().to_str().unwrap()), "{error}");
}

fn kind() -> impl Strategy<Value = Kind> {
    prop::sample::select(vec![Kind::Line, Kind::Points, Kind::Step, Kind::Bars])
}

fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        prop::num::f64::ANY,
        -10.0..10.0_f64,
        Just(0.0),
        Just(f64::MAX),
        Just(f64::MIN_POSITIVE),
        Just(f64::NAN)
    ]
}

fn axis() -> impl Strategy<Value = Axis> {
    (".{0,60}", ".{0,8}", any::<bool>())
        .prop_map(|(label, unit, logarithmic)| Axis { logarithmic, ..Axis::new(label, unit) })
}

fn figure() -> impl Strategy<Value = Figure> {
    let series = (kind(), ".{0,80}", 0_usize..9, prop::collection::vec((number(), number()), 0..40))
        .prop_map(|(kind, name, category, data)| Series::new(kind, name, Style::Category(category), data));
    let mark = (0..4, ".{0,9}", number(), number()).prop_map(|(which, name, a, b)| match which {
        0 => Mark::limit(name, a),
        1 => Mark::event(name, a),
        2 => Mark::allowed(name, (a, b)),
        _ => Mark::VerticalBand { name, x: (a, b), style: Style::Limit },
    });
    let parts = (
        ".{0,200}",
        axis(),
        axis(),
        prop::collection::vec(series, 0..4),
        prop::collection::vec(mark, 0..3),
        any::<bool>(),
    );
    parts.prop_map(|(title, x, y, series, marks, equal_scale)| Figure {
        series,
        marks,
        equal_scale,
        ..Figure::new(title, x, y)
    })
}

/// Every coordinate of the drawing, with the size it should lie in.
fn coordinates(svg: &str) -> (f64, f64, Vec<(f64, f64)>) {
    let document = parse(svg);
    let size: Vec<f64> = document
        .root_element()
        .attribute("viewBox")
        .unwrap()
        .split(' ')
        .map(|n| n.parse().unwrap())
        .collect();
    let mut all = vec![];
    for node in document.descendants() {
        let number = |name: &str| node.attribute(name).map(|text| text.parse::<f64>().unwrap());
        for (x, y) in [("x", "y"), ("cx", "cy"), ("x1", "y1"), ("x2", "y2")] {
            all.extend(number(x).zip(number(y)));
        }
        for pair in node.attribute("points").unwrap_or("").split_whitespace() {
            let (x, y) = pair.split_once(',').unwrap();
            all.push((x.parse().unwrap(), y.parse().unwrap()));
        }
        for name in ["width", "height", "r"] {
            assert!(number(name).is_none_or(|n| n >= 0.0), "{node:?}");
        }
    }
    (size[2], size[3], all)
}

/// Labels of the ticks along the axis of x and of y, told by how they are anchored.
fn tick_labels(svg: &str) -> [Vec<String>; 2] {
    let document = parse(svg);
    let anchored = |anchor: &str| {
        let texts =
            elements(&document, "text").into_iter().filter(|n| n.attribute("text-anchor") == Some(anchor));
        texts.filter_map(|n| n.text().map(|t| t.trim().to_owned())).collect::<Vec<_>>()
    };
    // The name of the axis is in the middle, too, and the only text of two letters.
    [anchored("middle").into_iter().filter(|t| t != "xx" && t != "yy").collect(), anchored("end")]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn any_figure_is_well_formed_and_stays_inside(figures in prop::collection::vec(figure(), 0..4), width in 0_u32..2000, height in 0_u32..1500) {
        let (right, bottom, all) = coordinates(&Panels::new(figures).to_svg(width, height));
        for (x, y) in all {
            // Markers and bars on the edge reach over it by less than their size, 5 px.
            prop_assert!((-50.0..=right + 50.0).contains(&x) && (-50.0..=bottom + 50.0).contains(&y), "({x}, {y})");
        }
    }

    #[test]
    fn every_axis_shows_three_labels(
        points in prop::collection::vec((number(), number()), 1..20),
        x_log: bool,
        y_log: bool,
        equal_scale: bool,
        width in 0_u32..1200,
        height in 0_u32..700,
    ) {
        let can_draw = |v: f64, log: bool| v.abs() <= 1e100 && (!log || v >= 1e-100);
        prop_assume!(points.iter().any(|(x, y)| can_draw(*x, x_log) && can_draw(*y, y_log)));
        let axis = |name: &str, logarithmic| Axis { logarithmic, ..Axis::new(name, "") };
        let figure = Figure {
            equal_scale,
            ..Figure::new("", axis("xx", x_log), axis("yy", y_log)).with(Series::points("", Style::Measured, points))
        };
        let [x, y] = tick_labels(&figure.to_svg(width, height)).map(|labels| labels.into_iter().collect::<HashSet<_>>());
        prop_assert!(x.len() >= 3 && y.len() >= 3, "{x:?} {y:?}");
    }

    #[test]
    fn any_summary_is_well_formed(points in prop::collection::vec((number(), number()), 0..60), bins in 0_usize..30) {
        parse(&binned_scatter("s", Axis::new("x", ""), Axis::new("y", ""), &points, bins).to_svg(600, 300));
        let values: Vec<_> = points.iter().map(|p| p.0).collect();
        let sample = Sample { name: "a", style: Style::Measured, values: &values };
        parse(&histogram("h", Axis::new("x", ""), &[sample], bins).to_svg(600, 300));
        parse(&histogram("h", Axis::new("x", ""), &[sample, sample], bins).to_svg(600, 300));
    }

    #[test]
    fn any_text_makes_a_well_formed_page(text in "\\PC{0,40}|.{0,40}") {
        let table = Table::new(&*text, [Column::number(&*text, &*text)]).row([&*text]);
        let page = Page::new(&*text, &*text).section(Section::new(&*text).paragraph(&*text).preformatted(&*text).table(table));
        parse(&page.render());
    }
}
