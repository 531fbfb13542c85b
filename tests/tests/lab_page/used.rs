//! Which part of a flight is used: dragged over, written beside the flight, honoured, and taken back. And where faults are.

use std::fs;
use std::path::Path;

use fantoccini::key::Key;
use flights::parts_to_use;
use serde_json::{Value, json};

use crate::browser::{Browser, missing};
use crate::flights::{real, small};
use crate::page::{identify, opened, split};
use crate::server::Lab;

/// Drags in the first panel from one share of its width to another, as a hand does.
fn drag(browser: &Browser, from: f64, to: f64) {
    let place = "const plot = document.getElementById('plots-drawing');
        const [box, axes] = [plot.getBoundingClientRect(), plot._fullLayout];
        return [box.left + axes.xaxis._offset, axes.xaxis._length, box.top + axes.yaxis._offset + axes.yaxis._length / 2]";
    let place = browser.run(place, Value::Null);
    let [left, width, y] = [0, 1, 2].map(|n| place[n].as_f64().expect("a place"));
    let mouse = |kind: &str, share: f64| {
        let held = i32::from(kind != "mouseReleased");
        let event = json!({
            "type": kind, "x": left + share * width, "y": y, "button": "left", "buttons": held, "clickCount": 1,
        });
        browser.devtools("Input.dispatchMouseEvent", event);
    };
    mouse("mousePressed", from);
    for step in 1..=5 {
        mouse("mouseMoved", from + (to - from) * f64::from(step) / 5.0);
    }
    mouse("mouseReleased", to);
}

/// Waits until a script, in which `plot` is that of the Time tab, returns true.
fn wait_for_plot(browser: &Browser, what: &str, script: &str) {
    let script = format!(
        "const plot = document.getElementById('plots-drawing');
         if (!plot?.data || !plot.checkVisibility() || plot.closest('[aria-busy]')) return false; {script}"
    );
    browser.wait_until(what, &script, Value::Null);
}

fn flight(lab: &Lab, name: &str) -> Value {
    let state = lab.state();
    let flights = state["flights"].as_array().expect("flights");
    flights.iter().find(|flight| flight["name"] == name).expect("the flight").clone()
}

/// Waits until the list of flights names so many parts of A.
fn wait_for_parts(browser: &Browser, count: usize) {
    let has =
        "const parts = document.querySelector(\".flight[data-name='A.csv'] .parts\")?.textContent ?? '';
        return (parts.match(/ to /g) ?? []).length === arguments[0]";
    browser.wait_until(&format!("{count} parts"), has, count);
}

/// The parts in the file beside A, s.
fn written(folder: &Path) -> Vec<[f64; 2]> {
    parts_to_use(&folder.join("A.csv")).unwrap().expect("a file beside the flight")
}

/// What the page makes of ranges of time.
fn assert_ranges(browser: &Browser) {
    let made = "return import('/page/used.js').then(({ within, without, either, unused }) => {
        const ranges = [[0, 3], [5, 9]];
        return [within(ranges, [2, 6]), without(ranges, [2, 6]), without(ranges, [-Infinity, 4]), without([[0, 9]], [3, 4]),
            within(ranges, [3, 5]), either([[5, 9]], [[0, 3], [2.5, 4], [9, 10]]), unused({ parts: [[1, 2], [4, 9]] }, [0, 9]),
            either([], []), without([[0, 9]], [0, 8.99])]})";
    let expected = json!([
        [[2, 3], [5, 6]],
        [[0, 2], [6, 9]],
        [[5, 9]],
        [[0, 3], [4, 9]],
        [],
        [[0, 4], [5, 10]],
        [[0, 1], [2, 4]],
        [],
        [],
    ]);
    assert_eq!(browser.run(made, Value::Null), expected);
}

fn are_about(parts: &[[f64; 2]], expected: &[[f64; 2]]) -> bool {
    let all = |parts: &[[f64; 2]]| parts.iter().flatten().copied().collect::<Vec<f64>>();
    let (parts, expected) = (all(parts), all(expected));
    parts.len() == expected.len() && parts.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 0.011)
}

/// All of the flight is drawn, and what is not used shaded.
const ALL_IS_DRAWN: &str = "const t = plot.data[0].x;
    return t[0] < 1 && t[t.length - 1] > 22 && plot.layout.shapes.length > 0 && plot.data[0].y.every(y => y !== null)";

#[test]
fn a_part_is_dragged_over_used_and_taken_back() {
    if missing() {
        return;
    }
    let folder = small();
    let (lab, browser) = opened("used", folder.path());
    split(&browser);
    identify(&browser);
    browser.choose("#flight", "A.csv");
    wait_for_plot(&browser, "the flight", "return plot.data[0].x.length > 100");
    let before = flight(&lab, "A.csv");
    assert_ranges(&browser);
    browser.choose("#drag", "use");
    browser.wait_for("#used", "All airborne parts of A.csv are used.");
    browser.wait_for("#used", "Shown range");
    drag(&browser, 0.25, 0.75);
    browser.wait_for("#used", "Dragged range");
    browser.wait_for(".choosing", "");
    browser.screenshot("dragged");

    browser.click("#use-only");
    browser.wait_for(".flight[data-name='A.csv'] .parts", "Used of A.csv: ");
    browser.wait_for_no(".choosing");
    let [[from, to]] = written(folder.path())[..] else { panic!("one part") };
    assert!((4.0..8.0).contains(&from) && (16.0..20.0).contains(&to), "{from} to {to}");
    assert_eq!((1e3 * from).fract(), 0.0, "{from} is not a whole number of milliseconds");
    let used = flight(&lab, "A.csv");
    let parts = used["used"][0]["parts"].as_array().unwrap();
    assert!(parts.len() == 1 && (parts[0][0].as_f64().unwrap() - from).abs() < 0.011, "{used}");
    assert_eq!(used["used"][0]["flown"], before["used"][0]["flown"]);
    assert!(used["duration_s"].as_f64().unwrap() < 0.6 * before["duration_s"].as_f64().unwrap());
    wait_for_plot(&browser, "all of the flight, with shades", ALL_IS_DRAWN);
    browser.settle();
    for scheme in ["light", "dark"] {
        browser.prefer(scheme);
        browser.settle();
        browser.screenshot(&format!("part-{scheme}"));
    }
    // What is computed of the flight is of the part alone.
    let path = lab.visitor().get("/api/path?model=1&flight=A.csv&axis=w").send(&lab).json();
    let times: Vec<f64> = path["t"].as_array().unwrap().iter().filter_map(Value::as_f64).collect();
    assert!(times[0] >= from && *times.last().unwrap() <= to, "{} to {:?}", times[0], times.last());

    // On the keyboard, the range that is shown is left out.
    browser.run("location.hash += '&from=11&to=13'; return true", Value::Null);
    browser.wait_for("#used", "Shown range, 11.00 to 13.00 s");
    browser.run("document.getElementById('use-not').focus(); return true", Value::Null);
    browser.press(Key::Enter, 1);
    wait_for_parts(&browser, 2);
    // What is used is told by its rows, every 10 ms.
    let two = written(folder.path());
    assert!(are_about(&two, &[[from, 11.0], [13.0, to]]), "{two:?}");

    // Widened again, as far as what is left out.
    browser.click("#use-too");
    wait_for_parts(&browser, 1);
    assert!(are_about(&written(folder.path()), &[[from, to]]));

    // Opened again, it is as it was; and one click brings all of it back.
    browser.click(".flight[data-name='A.csv'] .parts button");
    browser.wait_for_no(".flight[data-name='A.csv'] .parts");
    assert_eq!(parts_to_use(&folder.path().join("A.csv")).unwrap(), None);
    assert_eq!(flight(&lab, "A.csv"), before);
    browser.finish(&[]);
}

/// The file that the user wrote, also where nothing can be used with it.
#[test]
fn a_file_of_parts_that_cannot_be_right_is_taken_away_on_the_page() {
    if missing() {
        return;
    }
    let folder = small();
    fs::write(folder.path().join("A.use.toml"), "use = [[90.0, 99.0]]\n").unwrap();
    let (lab, browser) = opened("wrong-parts", folder.path());
    browser.wait_for(".flight[data-name='A.csv'] .bad-text", "the log goes from 0.00 to");
    browser.screenshot("unusable");
    browser.click(".flight[data-name='A.csv'] .parts button");
    browser.wait_for_no(".flight[data-name='A.csv'] .bad-text");
    assert!(!folder.path().join("A.use.toml").exists());
    assert_eq!(flight(&lab, "A.csv")["set"], "train");
    browser.finish(&[]);
}

/// A tracker that repeats its pose from 10 to 10.5 s, and a value that is missing at 3 s.
fn spoil(flight: &Path) {
    let text = fs::read_to_string(flight).unwrap();
    let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
    let column = |name: &str| header.iter().position(|known| *known == name).expect(name);
    let pose = ["x", "y", "z", "phi", "theta", "psi"].map(column);
    let [t, yaw_rate] = ["t", "r"].map(column);
    let (mut held, mut spoiled) = (None, vec![header.join(",")]);
    for line in text.lines().skip(1) {
        let mut cells: Vec<&str> = line.split(',').collect();
        let time_s: f64 = cells[t].parse().unwrap();
        if (time_s - 3.0).abs() < 0.004 {
            cells[yaw_rate] = "";
        }
        if (9.996..10.504).contains(&time_s) {
            let held = held.get_or_insert_with(|| pose.map(|column| cells[column]));
            pose.iter().zip(held).for_each(|(column, value)| cells[*column] = value);
        }
        spoiled.push(cells.join(","));
    }
    fs::write(flight, spoiled.join("\n") + "\n").unwrap();
}

#[test]
fn a_fault_leads_to_its_place() {
    if missing() {
        return;
    }
    let folder = small();
    spoil(&folder.path().join("B.csv"));
    let (lab, browser) = opened("faults", folder.path());
    let faults = flight(&lab, "B.csv")["faults"].clone();
    let frozen =
        faults.as_array().unwrap().iter().find(|fault| fault["places"] != json!([])).expect("a place");
    let [from, to] = [0, 1].map(|n| frozen["places"][0][n].as_f64().unwrap());
    assert!((from - 10.01).abs() < 0.011 && (to - 10.5).abs() < 0.011, "{frozen}");

    // Before there is a model, height and battery are shown there.
    let unfold = ".flight[data-name='B.csv'] summary[data-key^='unfold B']";
    let place = ".flight[data-name='B.csv'] button.fault[title*=' at ']";
    browser.click(unfold);
    browser.screenshot("list");
    browser.click(place);
    let zoomed =
        "const [from, to] = document.getElementById('overview-plot')?._fullLayout?.xaxis2.range ?? [];
        return from > 8 && to < 13";
    browser.wait_until("the place over time", zoomed, Value::Null);

    split(&browser);
    identify(&browser);
    browser.click("[role=tab][data-tab=model]");
    browser.click(place);
    browser.wait_for("[role=tab][data-tab=time][aria-selected=true]", "");
    let there = "const [from, to] = plot._fullLayout.xaxis.range;
        return location.hash.includes('flight=B.csv') && from > 8.5 && from < 10 && to > 10.5 && to < 12";
    wait_for_plot(&browser, "the place in the Time tab", there);
    browser.wait_for(".cursor-time", "10.0");
    browser.settle();
    browser.screenshot("place");
    // The cursor stays on it.
    browser.run(
        "const box = document.getElementById('plots'), place = box.getBoundingClientRect();
         box.dispatchEvent(new MouseEvent('mousemove', { clientX: place.left + 400, clientY: place.top + 100, bubbles: true }));
         return true",
        Value::Null,
    );
    browser.wait_for(".cursor-time", "10.0");

    // One that is about the whole flight shows the whole flight.
    browser.click(".flight[data-name='B.csv'] button.fault:not([title*=' at '])");
    let whole = "const [from, to] = plot._fullLayout.xaxis.range;
        return !location.hash.includes('from=') && from < 1 && to > 22";
    wait_for_plot(&browser, "the whole flight", whole);
    browser.finish(&[]);
}

/// A real log that holds two flights: each is looked at by itself, and has parts of its own.
#[test]
fn a_log_of_two_flights_is_two_flights_on_the_page() {
    if missing() {
        return;
    }
    let Some(folder) = real("logs", &["ardupilot_copter36_b"]) else { return };
    let (lab, browser) = opened("two-flights", folder.path());
    let log = "ardupilot_copter36_b.bin";
    let names: Vec<String> = serde_json::from_value(flight(&lab, log)["flights"].clone()).unwrap();
    let [first, second] = &names[..] else { panic!("{names:?}") };

    // One is fitted on, the other judges.
    identify(&browser);
    let model = &lab.state()["models"][0];
    assert_eq!((&model["fitted_on"], &model["judged_on"]), (&json!([first]), &json!([second])));
    let used = flight(&lab, log)["used"].clone();
    for (n, name) in names.iter().enumerate() {
        browser.choose("#flight", name);
        let [from, to]: [f64; 2] = serde_json::from_value(used[n]["parts"][0].clone()).unwrap();
        let is_drawn = format!(
            "const t = plot.data[0].x; return Math.abs(t[0] - {from}) < 1 && Math.abs(t[t.length - 1] - {to}) < 1"
        );
        wait_for_plot(&browser, name, &is_drawn);
    }

    // Part of the second, which is shown.
    browser.choose("#drag", "use");
    browser.run("location.hash += '&from=5&to=20'; return true", Value::Null);
    browser.wait_for("#used", "Shown range, 5.00 to 20.00 s");
    browser.click("#use-only");
    browser.wait_for(&format!(".flight[data-name='{log}'] .parts"), &format!("Used of {second}: "));
    let file = |name: &str| parts_to_use(&folder.path().join(name)).unwrap();
    assert!(are_about(&file(second).expect("a file"), &[[5.0, 20.0]]), "{:?}", file(second));
    assert_eq!(file(first), None);
    let now = flight(&lab, log)["used"].clone();
    assert_eq!((&now[0], &now[1]["chosen"], &now[1]["flown"]), (&used[0], &json!(true), &used[1]["flown"]));
    // It is told by its rows, which do not come evenly.
    let [[from, to]]: [[f64; 2]; 1] = serde_json::from_value(now[1]["parts"].clone()).unwrap();
    assert!((from - 5.0).abs() < 0.1 && (to - 20.0).abs() < 0.1, "{from} to {to} s");
    browser.screenshot("part");
    browser.finish(&[]);
}
