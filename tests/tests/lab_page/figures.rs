//! Figures and what can be taken away: the room, two flights, coefficients flight by flight, files.

use std::process::Command;

use fantoccini::key::Key;
use serde_json::{Value, json};
use stories::program;

use crate::browser::{Browser, missing};
use crate::flights;
use crate::page::{identify, opened, split};
use crate::server::Lab;

fn to_tab(browser: &Browser, tab: &str) {
    browser.click(&format!("[role=tab][data-tab={tab}]"));
    browser.wait_for(&format!("[role=tab][data-tab={tab}][aria-selected=true]"), "");
}

/// Waits until a script on the page, in which `plot` is this plot, returns true.
fn wait_for_plot(browser: &Browser, id: &str, what: &str, script: &str) {
    let script = format!(
        "const plot = document.getElementById(arguments[0]); if (!plot?.data || !plot.checkVisibility()) return false; {script}"
    );
    browser.wait_until(what, &script, id);
}

/// What the server says of an address of model 1.
fn asked(lab: &Lab, path: &str) -> Value {
    let answer = lab.visitor().get(path).send(lab);
    assert_eq!(answer.status, 200, "{path}: {}", answer.body);
    answer.json()
}

#[test]
fn the_room_shows_where_the_model_fails() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (lab, browser) = opened("room", folder.path());
    split(&browser);
    identify(&browser);
    to_tab(&browser, "path");
    browser.choose("#path-kind", "map-all");
    browser.wait_for("#room-summary", "Mean residual of w in cells of");
    let cells = "const [above, , east] = plot.data;
        return above?.type === 'heatmap' && east?.type === 'heatmap' && above.z.flat().some(m => m !== null)
            && plot._fullLayout.xaxis.title.text === 'east [m]' && plot._fullLayout.yaxis.title.text === 'north [m]'";
    wait_for_plot(&browser, "path-plot", "cells from above and from the side", cells);
    browser.settle();
    browser.screenshot("all-flights");

    // The time under the slider is a place in the room, in each of the views.
    browser.click("#cursor-time");
    browser.press(Key::Right, 3);
    let marked = "const marks = plot.data.filter(t => t.name === 'cursor');
        return marks.length === 3 && marks.every(m => Number.isFinite(m.x[0]) && Number.isFinite(m.y[0]))";
    wait_for_plot(&browser, "path-plot", "the cursor in the room", marked);

    browser.choose("#path-axis", "p");
    browser.wait_for("#room-summary", "Mean residual of p in cells of");
    browser.choose("#path-kind", "map");
    let address = "return location.hash.includes('space=map') && !location.hash.includes('map-all')";
    browser.wait_until("the view in the address", address, Value::Null);
    browser.settle();
    browser.screenshot("one-flight");
    browser.choose("#path-kind", "flat");
    wait_for_plot(&browser, "path-plot", "the path", "return plot.data.some(t => t.name === 'path')");

    // Nothing is lost: the samples of all flights are those of each.
    let samples = |flight: &str| {
        let query = format!("/api/room?model=1&axis=w{flight}");
        asked(&lab, &query)["samples"].as_u64().unwrap()
    };
    let each: u64 =
        ["A", "B", "C", "D", "E"].map(|name| samples(&format!("&flight={name}.csv"))).iter().sum();
    assert_eq!(samples(""), each);
    browser.finish(&[]);
}

#[test]
fn two_flights_lie_side_by_side() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (lab, browser) = opened("two-flights", folder.path());
    split(&browser);
    identify(&browser);
    browser.choose("#flight", "A.csv");
    browser.choose("#beside", "B.csv");
    browser.wait_for("#legend", "measured in B.csv");
    let lines = "return plot.data.length === 6 * 6";
    wait_for_plot(&browser, "plots-drawing", "the lines of both flights", lines);
    browser.click("#difference");
    wait_for_plot(&browser, "plots-drawing", "their differences", "return plot.data.length === 6 * 7");
    let shift = "const input = document.querySelector('#shift'); input.value = arguments[0];
        input.dispatchEvent(new Event('change', { bubbles: true })); return true";
    browser.run(shift, 5);
    let shifted = "const first = plot.data[0].x[0], second = plot.data.find(t => t.line.width === 2.6 && t.x[0] !== first);
        return location.hash.includes('shift=5') && !!second && Math.abs(Math.abs(second.x[0] - first) - 5) < 0.5";
    wait_for_plot(&browser, "plots-drawing", "the shift", shifted);
    browser.settle();
    browser.screenshot("shifted");

    // A bookmark shows the same.
    browser.run("location.reload(); return true", Value::Null);
    browser.wait_for("body[data-ready='true'] #legend", "measured in B.csv");
    wait_for_plot(&browser, "plots-drawing", "the same after a reload", shifted);
    // Who chooses the second flight has both change places.
    browser.choose("#flight", "B.csv");
    browser.wait_for("#legend", "measured in A.csv");
    browser.choose("#beside", "");
    browser.wait_for_no("#shift");

    // A flight beside itself does not differ from itself.
    let same = asked(&lab, "/api/series?model=1&flight=A.csv&beside=A.csv&width=4000");
    let apart = same["channels"][0]["residual_apart"].as_array().unwrap();
    assert!(apart.len() > 1000 && apart.iter().all(|x| x.is_null() || x.as_f64() == Some(0.0)));
    browser.finish(&[]);
}

#[test]
fn figures_and_samples_are_taken_away() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (_lab, browser) = opened("taken-away", folder.path());
    split(&browser);
    identify(&browser);
    browser.choose("#flight", "A.csv");
    for (tab, words) in [("time", ["basic (model 1), A.csv", "acceleration forward", "measured"])] {
        to_tab(&browser, tab);
        browser.settle();
        browser.click("#save-svg");
        let figure = browser.downloaded(&format!("model-1-A-{tab}.svg"));
        assert!(figure.starts_with("<svg") && figure.trim_end().ends_with("</svg>"), "{}", &figure[..80]);
        for word in words {
            assert!(figure.contains(word), "{word} is not in the figure of {tab}");
        }
        std::fs::write(browser.screenshot(tab).with_extension("svg"), figure).unwrap();
    }
    to_tab(&browser, "model");
    browser.settle();
    browser.click("a[href*='/api/download/series.csv']");
    let text = browser.downloaded("model-1-A.csv");
    assert!(text.starts_with("t_s,u_measured_m_s2,u_predicted_m_s2,u_residual_m_s2,"), "{}", &text[..80]);
    browser.click("a[href*='/api/download/series.parquet']");
    let table = browser.downloaded_bytes("model-1-A.parquet");
    assert!(table.starts_with(b"PAR1") && table.ends_with(b"PAR1"));
    browser.finish(&[]);
}

#[test]
fn parameters_of_the_craft_and_what_each_flight_says_of_them() {
    if missing() {
        return;
    }
    let (folder, craft) = (flights::small(), flights::small_world().craft);
    let (lab, browser) = opened("parameters", folder.path());
    split(&browser);
    browser.choose(".flight[data-name='E.csv'] select", "later");
    browser.wait_for(".flight.later[data-name='E.csv']", "");
    identify(&browser);
    to_tab(&browser, "model");
    browser.wait_for("#physical tbody th", "kT");
    browser.run("document.querySelector('#physical').scrollIntoView(); return true", Value::Null);
    browser.screenshot("physical");

    // Without the effect that the craft has, the moments' coefficients are not its own.
    let add = r#"{"do":"add","model":1,"effect":"flapping-moment"}"#;
    assert_eq!(lab.visitor().post("/api/jobs", add).with_origin(&lab).send(&lab).status, 200);
    lab.state();
    browser.wait_for(".model.chosen[data-id='2']", "flapping-moment");
    let all = asked(&lab, "/api/model?id=2")["physical"].clone();
    let inertia = craft.inertia_kg_m2;
    let flown = [
        ("m", craft.mass_kg, 1e-12),
        ("k_T", craft.thrust_n_s2, 0.03),
        ("I_xx", inertia[(0, 0)], 0.1),
        ("I_yy", inertia[(1, 1)], 0.1),
        ("k_Q/I_zz", craft.torque_nm_s2 / inertia[(2, 2)], 0.1),
    ];
    for (symbol, truth, part) in flown {
        let one = all.as_array().unwrap().iter().find(|one| one["symbol"] == symbol).expect(symbol);
        let value = one["value"].as_f64().unwrap();
        assert!((value / truth - 1.0).abs() < part, "{symbol}: {value}, flown with {truth}: {one}");
    }

    browser.click("#timeline");
    wait_for_plot(&browser, "timeline-plot", "each coefficient", "return plot.data.length > 60");
    browser.wait_for("#by-flight .legend", "flown later");
    browser.wait_for("#timeline-summary", "times its standard errors");
    browser.settle();
    browser.run("document.querySelector('#by-flight').scrollIntoView(); return true", Value::Null);
    browser.screenshot("timeline");
    browser.click("#timeline-svg");
    let figure = browser.downloaded("model-2-coefficients-flight-by-flight-model.svg");
    assert!(figure.contains("linear-drag: C_du ["), "{}", &figure[..200]);
    let rows = asked(&lab, "/api/timeline?model=2");
    let first = &rows["coefficients"][0];
    assert_eq!(first["flights"].as_array().unwrap().len(), 5, "{first}");
    assert_eq!(rows["flights"][4], json!({ "flight": "E.csv", "problem": null }));
    browser.finish(&[]);
}

/// A diagnosis that leaves two effects open, as the lab keeps it.
fn undecided() -> Value {
    json!({
        "verdict": "missing-effect",
        "verdicts": { "translation": "missing-effect", "rotation": "adequate" },
        "summary": "A wind, or a tilted attitude.",
        "effects": [{
            "effect": "steady-wind",
            "supported": true,
            "axes": {},
            "p_value": null,
            "held_out_p_value": null,
            "flights_improved": [2, 2],
            "coefficients": [],
            "confounded_with": ["attitude-offset"],
            "reason": "it improves all flights",
        }],
        "unexplained": [],
        "not_identified": [],
        "sentences": {},
    })
}

#[test]
fn the_flight_that_tells_two_effects_apart_is_a_file() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let before = Lab::start(folder.path());
    before.identify();
    drop(before);
    std::fs::write(folder.path().join("lab/diagnosis-1.json"), undecided().to_string()).unwrap();

    let (_lab, browser) = opened("what-to-fly", folder.path());
    let card = ".card[data-effect='steady-wind']";
    browser.wait_for(&format!("{card} .to-fly"), "In a terminal: quadlab plan --model lab/model-1.toml");
    let command = browser.text(&format!("{card} .to-fly code"));
    browser.click(&format!("{card} button.plan"));
    browser.wait_for(&format!("{card} .to-fly a"), "Pattern file steady-wind-or-attitude-offset.csv");
    browser.screenshot("planned");
    browser.click(&format!("{card} .to-fly a"));
    let name = "steady-wind-or-attitude-offset.csv";
    let pattern = browser.downloaded(name);

    // The command that the card shows writes the same.
    let mut shell = Command::new(program("quadlab"));
    let output = shell.args(command.split(' ').skip(1)).current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{command}\n{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(std::fs::read_to_string(folder.path().join(name)).unwrap(), pattern);
    browser.finish(&[]);
}
