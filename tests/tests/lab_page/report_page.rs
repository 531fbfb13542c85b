//! Pages of figures, opened from a file without a network: values are read under the pointer, and the range is zoomed.

use std::fs;
use std::path::Path;
use std::process::Command;

use fantoccini::key::Key;
use report::{Axis, Figure, Page, Section, Series, Style};
use serde_json::{Value, json};
use stories::program;

use crate::accessibility::faults;
use crate::browser::{Browser, missing};
use crate::flights;
use crate::server::Lab;

/// The figure of that number, in view; and the place of a share of its axis in a panel, CSS pixels of the window.
fn place(browser: &Browser, figure: usize, panel: usize, share: f64) -> [f64; 2] {
    let script = "const [number, panel, share] = arguments[0];
        const figure = document.querySelectorAll('figure')[number];
        figure.scrollIntoView({ block: 'start' });
        const data = JSON.parse(figure.querySelector('script').textContent);
        const { left, top, width } = figure.querySelector('.card > svg').getBoundingClientRect();
        const scale = width / data.width, drawn = data.panels[panel];
        return [left + scale * (data.left + share * (data.right - data.left)), top + scale * (drawn.top + drawn.bottom) / 2]";
    let at = browser.run(script, json!([figure, panel, share]));
    [0, 1].map(|n| at[n].as_f64().expect("a place"))
}

/// What is shown at the pointer: name and value of each row.
fn reading(browser: &Browser) -> Vec<(String, String)> {
    let script = "return [...document.querySelectorAll('.reading:not([hidden]) > div')].map(row =>
        [row.querySelector('span:not(:has(svg))').textContent, row.querySelector('b').textContent])";
    let rows: Vec<[String; 2]> = serde_json::from_value(browser.run(script, 0)).unwrap();
    rows.into_iter().map(|[name, value]| (name, value)).collect()
}

/// The number and the unit of a row.
fn value(rows: &[(String, String)], name: &str) -> (f64, String) {
    let (_, text) = rows.iter().find(|row| row.0 == name).unwrap_or_else(|| panic!("no {name} in {rows:?}"));
    let (number, unit) = text.split_once(' ').expect("a unit");
    (number.replace('−', "-").parse().expect("a number"), unit.to_owned())
}

/// Labels of the axis of a zoomed figure.
fn ticks(browser: &Browser, figure: usize) -> Vec<f64> {
    let script = "const figure = document.querySelectorAll('figure')[arguments[0]];
        return [...figure.querySelectorAll('.closer .tick')].map(tick => Number(tick.textContent))";
    serde_json::from_value(browser.run(script, figure)).unwrap()
}

/// Numbers of the figures over time.
fn over_time(browser: &Browser) -> Vec<usize> {
    let script = "return [...document.querySelectorAll('figure')].flatMap((figure, n) =>
        JSON.parse(figure.querySelector('script').textContent).panels[0].lines[0].kind === 'line' && JSON.parse(figure.querySelector('script').textContent).x.name === 'time' ? [n] : [])";
    serde_json::from_value(browser.run(script, 0)).unwrap()
}

fn open_page(name: &'static str, page: &Path) -> Browser {
    let mut browser = Browser::start(name);
    browser.open_file(page);
    browser.wait_for(".card.live", "");
    browser
}

fn run(folder: &Path, arguments: &[&str]) {
    let output = Command::new(program("quadlab")).args(arguments).current_dir(folder).output().unwrap();
    assert!(output.status.code() == Some(0), "{arguments:?}\n{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn a_report_without_a_network_shows_values_and_zooms() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let lab = Lab::start(folder.path());
    lab.identify();
    let [page, samples] = ["report.html?id=1", "series.csv?model=1&flight=A.csv"].map(|file| {
        let answer = lab.visitor().get(&format!("/api/download/{file}")).send(&lab);
        assert_eq!(answer.status, 200, "{}", answer.body);
        answer.body
    });
    drop(lab);
    let path = folder.path().join("report.html");
    fs::write(&path, page).unwrap();
    let browser = open_page("report", &path);
    let [figure] = over_time(&browser)[..] else { panic!("one figure is over time") };

    // What is shown is a sample, with its number in the table of samples.
    browser.point_at(place(&browser, figure, 2, 0.4));
    browser.wait_for(".reading", "measured");
    browser.screenshot("light-values");
    let rows = reading(&browser);
    let (time_s, unit) = value(&rows, "time");
    assert_eq!(unit, "s");
    let columns: Vec<&str> = samples.lines().next().unwrap().split(',').collect();
    let table: Vec<Vec<f64>> = samples
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect())
        .collect();
    let start_s = table[0][0];
    let row = table
        .iter()
        .min_by(|a, b| (a[0] - start_s - time_s).abs().total_cmp(&(b[0] - start_s - time_s).abs()))
        .unwrap();
    assert!((row[0] - start_s - time_s).abs() < 1e-3, "{time_s} s is no sample");
    for (name, column) in [("measured", "w_measured_m_s2"), ("predicted", "w_predicted_m_s2")] {
        let (shown, unit) = value(&rows, name);
        let sample = row[columns.iter().position(|known| *known == column).unwrap()];
        assert_eq!(unit, "m/s^2");
        assert!(
            (shown - sample).abs() <= 1e-4 * sample.abs(),
            "{name}: {shown} is shown, {sample} was flown"
        );
    }

    // A tenth of the flight, by dragging: its numbers on the axis, and its samples in the line.
    let length_s = table[table.len() - 1][0] - start_s;
    assert_eq!(ticks(&browser, figure), [0.0; 0]);
    browser.drag(place(&browser, figure, 0, 0.5), place(&browser, figure, 0, 0.6));
    browser.wait_until("a zoom", "return document.querySelectorAll('.closer .tick').length >= 3", 0);
    for at in ticks(&browser, figure) {
        assert!((0.49 * length_s..=0.61 * length_s).contains(&at), "{at} s of {length_s} s");
    }
    let joints = "const figure = document.querySelectorAll('figure')[arguments[0]];
        return figure.querySelector('.closer path').getAttribute('d').split(/[ML]/).length - 1";
    let joints = browser.run(joints, figure).as_f64().unwrap();
    let flown = 0.1 * table.len() as f64;
    assert!((joints - flown).abs() < 0.02 * flown + 4.0, "{joints} samples of {flown} are drawn");
    browser.point_at(place(&browser, figure, 1, 0.5));
    browser.wait_for(".reading", "measured");
    let (inside_s, _) = value(&reading(&browser), "time");
    assert!((inside_s / length_s - 0.55).abs() < 0.01, "{inside_s} s of {length_s} s");
    browser.screenshot("light-zoomed");
    browser.double_click(place(&browser, figure, 0, 0.5));
    browser.wait_for_no(".closer .tick");

    // The same by keyboard.
    let card = format!("document.querySelectorAll('figure')[{figure}].querySelector('.card')");
    browser.run(&format!("{card}.focus(); return true"), 0);
    browser.press(Key::Right, 3);
    browser.wait_for(".reading", "measured");
    browser.type_keys("++");
    browser.wait_until("a zoom", "return document.querySelectorAll('.closer .tick').length >= 3", 0);
    assert!(browser.text(".spoken").contains("measured"), "{}", browser.text(".spoken"));
    browser.press(Key::Escape, 1);
    browser.wait_for_no(".closer .tick");

    let mut found = Vec::new();
    for scheme in ["light", "dark"] {
        found.extend(faults(&browser, scheme));
        browser.point_at(place(&browser, figure, 0, 0.3));
        browser.drag(place(&browser, figure, 0, 0.2), place(&browser, figure, 0, 0.7));
        browser.screenshot(scheme);
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    browser.finish(&[]);
}

/// The basic model of the five flights of a folder, in model.toml.
fn identify_basic(folder: &Path) {
    let files = ["--train", "A.csv", "B.csv", "C.csv", "--validate", "D.csv", "E.csv"];
    let before = ["identify", "--vehicle", "vehicle.toml"];
    run(folder, &[&before[..], &files[..], &["--out", "model.toml"]].concat());
}

#[test]
fn figures_over_the_same_time_zoom_together() {
    if missing() {
        return;
    }
    let folder = flights::small();
    identify_basic(folder.path());
    run(
        folder.path(),
        &[
            "diagnose",
            "--model",
            "model.toml",
            "--train",
            "A.csv",
            "B.csv",
            "C.csv",
            "--validate",
            "D.csv",
            "E.csv",
            "--html",
            "found.html",
        ],
    );
    let browser = open_page("report-linked", &folder.path().join("found.html"));
    let figures = over_time(&browser);
    assert_eq!(figures.len(), 2, "the error over time, and measured against predicted");
    browser.drag(place(&browser, figures[0], 0, 0.2), place(&browser, figures[0], 0, 0.3));
    browser.wait_until("a zoom", "return document.querySelectorAll('.closer .tick').length >= 6", 0);
    assert_eq!(ticks(&browser, figures[0]), ticks(&browser, figures[1]));
    for figure in 0..browser.count("figure") {
        assert_eq!(!ticks(&browser, figure).is_empty(), figures.contains(&figure), "figure {figure}");
    }
    browser.screenshot("linked");
    browser.finish(&[]);
}

/// Logarithmic axes, bars, and more samples than a page holds.
#[test]
fn a_figure_of_any_kind_is_read() {
    if missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let gain = (1..=1000).map(|k| (0.1 * f64::from(k), 50.0 / f64::from(k))).collect::<Vec<_>>();
    let log = Figure::new("Gain", Axis::logarithmic("frequency", "rad/s"), Axis::logarithmic("gain", "1"))
        .with(Series::line("open loop", Style::PredictedAfter, gain));
    let bars = Figure::new("Errors", Axis::new("error", "m"), Axis::new("count", "")).with(Series::bars(
        "samples",
        Style::Measured,
        [(0.0, 3.0), (1.0, 7.0), (2.0, 4.0)],
    ));
    let many = (0..100_000).map(|k| (0.01 * f64::from(k), f64::from(k % 1000))).collect::<Vec<_>>();
    let long = Figure::new("Long", Axis::new("time", "s"), Axis::new("sawtooth", "m")).with(Series::line(
        "flown",
        Style::Measured,
        many,
    ));
    let clouds = [Style::Measured, Style::PredictedBefore, Style::PredictedAfter].into_iter().zip(1..).fold(
        Figure::new("Clouds", Axis::new("speed", "m/s"), Axis::new("drag", "N")),
        |figure, (style, slope)| {
            let points = (0..=20).map(|k| (f64::from(k), f64::from(slope * k))).collect::<Vec<_>>();
            figure.with(Series::points(format!("cloud {slope}"), style, points))
        },
    );
    let section =
        Section::new("All kinds").figure(log, "").figure(bars, "").figure(long, "").figure(clouds, "");
    let path = folder.path().join("kinds.html");
    Page::new("Kinds", "").section(section).write(&path).unwrap();

    let browser = open_page("report-kinds", &path);
    // Half way from 0.1 to 100 rad/s.
    browser.point_at(place(&browser, 0, 0, 0.5));
    browser.wait_for(".reading", "open loop");
    let rows = reading(&browser);
    let (frequency, _) = value(&rows, "frequency");
    let gain: f64 = rows[1].1.parse().unwrap();
    assert!((frequency / 3.16 - 1.0).abs() < 0.05, "{rows:?}");
    assert!((gain * frequency / 5.0 - 1.0).abs() < 1e-3, "{rows:?}");
    browser.drag(place(&browser, 0, 0, 0.5), place(&browser, 0, 0, 0.7));
    browser.wait_until("a zoom", "return document.querySelectorAll('.closer .tick').length >= 3", 0);
    let shown = ticks(&browser, 0);
    assert!(shown.iter().all(|tick| (3.0..=13.0).contains(tick)), "{shown:?}");
    browser.screenshot("logarithmic");

    browser.point_at(place(&browser, 1, 0, 0.5));
    browser.wait_for(".reading", "samples");
    assert_eq!(reading(&browser)[1], ("samples".to_owned(), "7".to_owned()));
    assert_eq!(browser.count("figure:nth-of-type(2) .plot-tools"), 0, "bars keep their foot");

    browser.drag(place(&browser, 2, 0, 0.4), place(&browser, 2, 0, 0.5));
    browser.wait_for(".thinned", "of 100000 samples, with all peaks");
    browser.point_at(place(&browser, 2, 0, 0.5));
    browser.wait_for(".reading", "≈");
    browser.screenshot("thinned");

    // Series of points differ by their shapes as well, near by too.
    browser.drag(place(&browser, 3, 0, 0.2), place(&browser, 3, 0, 0.8));
    let shapes = "const drawn = document.querySelectorAll('figure')[3].querySelector('.closer [clip-path]');
        const joints = path => path.getAttribute('d').replace(/[^A-Z]/g, '');
        return drawn ? [...new Set([...drawn.querySelectorAll('circle, path')].map(at =>
            at.tagName === 'circle' ? 'disc' : joints(at)))] : []";
    browser.wait_until("a zoom", &format!("return (() => {{ {shapes} }})().length > 0"), 0);
    assert_eq!(browser.run(shapes, 0), json!(["disc", "MLHZ", "MLML"]));
    browser.screenshot("clouds");
    browser.finish(&[]);
}

/// A page carries what a zoom shows, and stays a page: a minute at 100 Hz.
#[test]
fn a_page_with_all_samples_is_less_than_three_times_as_large() {
    let folder = flights::flown(60.0);
    identify_basic(folder.path());
    run(folder.path(), &["compare", "--model", "model.toml", "--flights", "D.csv", "--html", "page.html"]);
    let page = fs::read_to_string(folder.path().join("page.html")).unwrap();
    let mut bare = String::new();
    let mut rest = page.as_str();
    while let Some((before, script)) = rest.split_once("<script") {
        bare.push_str(before);
        rest = script.split_once("</script>").expect("an end of the script").1;
    }
    bare.push_str(rest);
    println!("{} bytes, without what the script needs {}", page.len(), bare.len());
    assert!(bare.len() < page.len() && page.len() < 3 * bare.len(), "{} of {}", page.len(), bare.len());
    assert_eq!(page.matches("type=\"module\"").count(), 1);
    let told = page
        .split("<script type=\"application/json\">")
        .nth(1)
        .and_then(|text| text.split("</script>").next());
    assert!(serde_json::from_str::<Value>(told.expect("data of a figure")).is_ok());
}
