//! An effect that its user writes on the page.

use std::fs;

use serde_json::Value;

use crate::browser::{Browser, missing};
use crate::flights;
use crate::page::{
    GONE, assert_commands_make_the_models, command_of, diagnose, identify, open, opened, split,
    wait_for_models, wait_idle,
};
use crate::server::Lab;

/// What is hidden in the flights, as a user writes who does not know the catalogue.
const TILT: &str = r#"[[effect]]
id = "tilting-rotors"
sentence = "Moving through the air tilts the <b>rotors</b>."
acceleration.p = "roll * v"
acceleration.q = "pitch * u"
coefficient = [
{ name = "roll", unit = "1/(s m)", possible = [-500.0, 500.0], typical = 3.0 },
{ name = "pitch", unit = "1/(s m)", possible = [-500.0, 500.0], typical = 3.0 },
]
"#;

fn write(browser: &Browser, text: &str) {
    browser.click("[role=tab][data-tab=own]");
    browser.fill("#own-text", text);
}

fn value(browser: &Browser) -> String {
    let value = browser.run("return document.querySelector('#own-text').value", Value::Null);
    value.as_str().unwrap_or_default().to_owned()
}

#[test]
fn an_own_effect_is_mended_tried_kept_added_and_there_again() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (lab, mut browser) = opened("own-effect", folder.path());
    split(&browser);

    // Before there is a model: the example is right as it is.
    browser.click("[role=tab][data-tab=own]");
    browser.wait_for("#own-described", "my-drag");
    browser.wait_for("#own-nothing", "Identify");
    identify(&browser);
    browser.wait_for("#own-plot .main-svg", "");

    // A mistake is told while typing, with its field.
    write(&browser, &TILT.replacen("roll * v", "roll * v * v", 1));
    browser.wait_for("#own-problem", "acceleration.p: has the unit");
    browser.wait_for("#own-problem", "the row needs rad/s²");
    browser.wait_for("#own-try:disabled", "");
    browser.screenshot("mistake");
    write(&browser, TILT);
    browser.wait_for("#own-described", "moments about p, q");
    browser.wait_for("#own-legend", "pitch, at its typical size");

    // It is worth something on the flights that judge; looking goes on meanwhile.
    browser.click("#own-try");
    browser.click("[role=tab][data-tab=time]");
    browser.wait_for("#panel-time .main-svg", "");
    browser.click("[role=tab][data-tab=own]");
    browser.wait_for("[data-tried='tilting-rotors'].supported .criteria", "met");
    browser.wait_for("[data-tried='tilting-rotors'] .falls", "falls by");
    browser.settle();
    browser.screenshot("tried");
    assert!(!folder.path().join("lab/effects").exists(), "a trial is not kept");

    browser.click("#own-keep");
    browser.wait_for("[data-own='tilting-rotors']", "");
    let file = folder.path().join("lab/effects/tilting-rotors.toml");
    assert_eq!(fs::read_to_string(&file).unwrap(), TILT);
    assert_eq!(diagnose(&browser), "missing-effect");
    // What it says of itself is text, on its card as everywhere.
    let card = "const card = document.querySelector('#advice .card[data-effect=tilting-rotors]');
        return !!card && card.textContent.includes('tilts the <b>rotors</b>')";
    browser.wait_until("a card of it", card, Value::Null);

    browser.click("#own-add");
    wait_for_models(&browser, 2);
    wait_idle(&browser);
    browser.wait_for(".model.chosen[data-id='2']", "tilting-rotors");
    browser.wait_for("[data-own='tilting-rotors']", "in model 2");
    // A model goes on to mean what it was made of.
    write(&browser, &TILT.replacen("pitch * u", "pitch * v", 1));
    browser.wait_for("#own-problem", "model 2 has it as it was before");
    browser.screenshot("in-a-model");

    // The server ends as in a power cut, and all is there again.
    lab.cut();
    let again = Lab::start(folder.path());
    open(&again, &mut browser);
    wait_for_models(&browser, 2);
    browser.click("[role=tab][data-tab=own]");
    browser.click("[data-own='tilting-rotors'] button.name");
    browser.wait_for("#own-described", "tilting-rotors");
    assert_eq!(value(&browser), TILT);
    assert!(again.state()["own"][0]["problem"].is_null());
    let commands = ["1", "2"].map(|id| (id, command_of(&browser, id)));
    assert!(commands[1].1.contains("--effects lab/effects/tilting-rotors.toml"), "{}", commands[1].1);
    browser.finish(&GONE);
    drop(again);
    assert_commands_make_the_models(folder.path(), &commands);
}

/// Edited and removed while no model has it.
#[test]
fn a_kept_effect_is_edited_and_removed() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (lab, browser) = opened("own-effect-edited", folder.path());
    write(&browser, TILT);
    browser.wait_for("#own-described", "tilting-rotors");
    browser.click("#own-keep");
    browser.wait_for("[data-own='tilting-rotors']", "");
    let edited = TILT.replacen("pitch * u", "pitch * u * 2", 1);
    write(&browser, &edited);
    browser.wait_for("#own-described", "tilting-rotors");
    browser.wait_for(".rows", "pitch * u * 2");
    browser.click("#own-keep:enabled");
    browser.wait_for("[data-own='tilting-rotors'] [aria-pressed=true]", "");
    assert_eq!(fs::read_to_string(folder.path().join("lab/effects/tilting-rotors.toml")).unwrap(), edited);
    // Another one is opened, and what was being written is not lost.
    write(&browser, "half a word");
    browser.wait_for("#own-problem", "line 1");
    browser.click("[data-own='tilting-rotors'] button.name");
    browser.wait_for(".rows", "pitch * u * 2");
    browser.click("#own-back");
    browser.wait_for("#own-problem", "line 1");
    assert_eq!(value(&browser), "half a word");
    browser.click("[data-own='tilting-rotors'] button.keep");
    browser.wait_for_no("[data-own]");
    assert!(!folder.path().join("lab/effects/tilting-rotors.toml").exists());
    assert!(lab.state()["own"].as_array().is_some_and(Vec::is_empty));
    browser.finish(&[]);
}
