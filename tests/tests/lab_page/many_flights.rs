//! Flights of two days: what changed between them. Real flights. A hundred flights in one folder.

use std::process::Command;

use serde_json::{Value, json};
use stories::program;

use crate::browser::{Browser, missing};
use crate::flights;
use crate::page::{identify, opened, split, wait_idle};

/// Says what a flight is used for.
fn used(browser: &Browser, flight: &str, set: &str) {
    browser.choose(&format!(".flight[data-name='{flight}'] select"), set);
    browser.wait_for(&format!(".flight.{set}[data-name='{flight}']"), "");
}

/// Asks what changed, and gives the verdict.
fn changed(browser: &Browser) -> String {
    browser.click("#changed");
    browser.wait_for("#changed-verdict[data-verdict]", "");
    wait_idle(browser);
    let verdict =
        browser.run("return document.querySelector('#changed-verdict').dataset.verdict", Value::Null);
    verdict.as_str().expect("a verdict").to_owned()
}

/// Fits the model to each flight alone.
fn fit_each(browser: &Browser) {
    browser.click("[role=tab][data-tab=model]");
    browser.click("#timeline");
    browser.wait_for("#timeline-summary", "scatters most");
    browser.wait_for("#timeline-plot", "linear-drag");
}

#[test]
fn a_weight_is_found_in_flights_flown_later() {
    if missing() {
        return;
    }
    let folder = flights::before_and_after();
    let (lab, browser) = opened("changed", folder.path());
    split(&browser);
    used(&browser, "later-A.csv", "later");
    used(&browser, "later-B.csv", "later");
    identify(&browser);
    assert_eq!(changed(&browser), "missing-effect");
    // The world hangs a tenth of its mass on the craft.
    browser.wait_for(".card.supported[data-change='mass-change']", "");
    browser.screenshot("named");

    // Each flight fitted alone has its own values.
    fit_each(&browser);
    browser.screenshot("timeline");

    // What the page says a terminal takes finds the same.
    let commands = browser.text("#changes code");
    browser.finish(&[]);
    drop(lab);
    let arguments: Vec<&str> = commands.split_whitespace().skip(1).collect();
    let output =
        Command::new(program("quadlab")).args(&arguments).current_dir(folder.path()).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("mass-change"), "{commands}\n{said}\n{}", String::from_utf8_lossy(&output.stderr));
}

/// A Crazyflie of others, flown before and after a weight was glued on near a motor.
#[test]
fn real_flights_show_a_weight_that_was_glued_on() {
    if missing() {
        return;
    }
    let names = ["normal_flight__E9", "weight_W3_near_M3__E9"];
    let Some(folder) = flights::real("crazypad", &names) else { return };
    let (_lab, browser) = opened("real", folder.path());
    for flight in ["_leg1", "_leg2"] {
        used(&browser, &format!("motor__add_weight_W3_near_M3__E9_log00{flight}.csv"), "later");
    }
    identify(&browser);
    assert_eq!(changed(&browser), "missing-effect");
    browser.wait_for("#changes .card.supported", "");
    browser.screenshot("changed");
    browser.finish(&[]);
}

#[test]
fn a_hundred_flights_are_listed_and_fitted() {
    if missing() {
        return;
    }
    let folder = flights::hundred();
    let (lab, browser) = opened("hundred", folder.path());
    browser.wait_until(
        "all flights",
        "return document.querySelectorAll('.flight[data-name]').length === 100",
        json!(0),
    );
    lab.state();
    identify(&browser);
    browser.click(".flight[data-name='flight-099.csv'] button.name");
    browser.wait_for("#plots .panel-name", "");
    browser.settle();
    browser.screenshot("listed");
    // What is one line a flight has all of them, and can be read.
    fit_each(&browser);
    browser.screenshot("timeline");
    browser.finish(&[]);
}
