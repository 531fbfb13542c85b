//! Who has no flights yet: the demonstration, from the page and from the command line.

use std::process::{Command, Stdio};

use model::Vehicle;
use serde_json::Value;
use stories::program;

use crate::browser::missing;
use crate::page::{diagnose, identify, open, opened_empty};
use crate::server::{Lab, Request};

/// How far the line that says that the page waits moves what stands below it.
const MOVED_BY_WAITING: &str =
    "const line = document.getElementById('loading'), panel = document.getElementById('panel-time');
    const top = () => panel.getBoundingClientRect().top;
    line.hidden = true;
    const before = top();
    line.hidden = false;
    const moved = line.checkVisibility() ? top() - before : null;
    line.hidden = true;
    return moved;";

/// The hidden effect is drawn by chance, so what is found is not said here.
#[test]
fn an_empty_folder_offers_flights_with_a_hidden_effect() {
    if missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let (lab, browser) = opened_empty("first-use", folder.path());
    assert_eq!(browser.count("#hints li"), 3, "hints of first use");
    browser.screenshot("empty");
    browser.click("#demo");
    for name in ["A", "B", "C", "D", "E"] {
        browser.wait_for(&format!(".flight[data-name='{name}.csv']"), "");
    }
    browser.wait_for("#warning", "quadlab demo --seed ");
    browser.wait_for_no("#demo");
    Vehicle::read(&folder.path().join("vehicle.toml")).unwrap();
    identify(&browser);
    assert!(!diagnose(&browser).is_empty());
    browser.screenshot("diagnosed");
    browser.finish(&[]);

    // Where flights are nothing is flown over them.
    let flight = std::fs::read(folder.path().join("A.csv")).unwrap();
    let answer = lab.visitor().post("/api/demo", "{}").with_origin(&lab).send(&lab);
    assert_eq!(answer.status, 400, "{}", answer.body);
    assert!(answer.body.contains("in an empty folder"), "{}", answer.body);
    lab.state();
    assert_eq!(std::fs::read(folder.path().join("A.csv")).unwrap(), flight);
}

#[test]
fn the_demonstration_opens_in_the_lab() {
    if missing() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let mut demo = Command::new(program("quadlab"));
    demo.args(["demo", "--lab", "--no-open", "--seed", "4", "--out"]).arg(folder.path()).stdin(Stdio::null());
    let lab = Lab::of(demo);
    let mut browser = crate::browser::Browser::start("demo-lab");
    open(&lab, &mut browser);
    identify(&browser);
    assert_eq!(browser.run(MOVED_BY_WAITING, Value::Null), 0, "px, of what may be clicked just then");
    assert_eq!(diagnose(&browser), "missing-effect");
    // What `quadlab demo --seed 4` finds, as the README shows.
    browser.wait_for(".card.supported[data-effect='tracking-offset']", "");
    browser.finish(&[]);
    assert_eq!(Request::get("/").send(&lab).status, 403, "without its token");
}
