//! Stories through the page, as a user clicks them.

use std::fs;
use std::path::Path;
use std::process::Command;

use model::{Effect, Model};
use serde_json::{Value, json};
use stories::program;

use crate::browser::{Browser, missing};
use crate::flights;
use crate::server::Lab;

/// The page of a folder, once it is filled.
pub(crate) fn opened(name: &'static str, folder: &Path) -> (Lab, Browser) {
    let (lab, mut browser) = (Lab::start(folder), Browser::start(name));
    open(&lab, &mut browser);
    (lab, browser)
}

/// The page of a folder without flights.
pub(crate) fn opened_empty(name: &'static str, folder: &Path) -> (Lab, Browser) {
    let (lab, mut browser) = (Lab::start(folder), Browser::start(name));
    browser.open(&lab.address);
    browser.wait_for("body[data-ready='true']", "");
    (lab, browser)
}

pub(crate) fn open(lab: &Lab, browser: &mut Browser) {
    browser.open(&lab.address);
    browser.wait_for("body[data-ready='true'] .flight[data-name]", "");
}

/// Trains on A, B and C and judges on D and E.
pub(crate) fn split(browser: &Browser) {
    for (name, set) in [("A", "train"), ("B", "train"), ("C", "train"), ("D", "validate"), ("E", "validate")]
    {
        let select = format!(".flight[data-name='{name}.csv'] select");
        browser.choose(&select, set);
        let kept = "const [select, set] = arguments[0]; return document.querySelector(select)?.value === set";
        browser.wait_until(&format!("{name} in {set}"), kept, json!([select, set]));
        browser.wait_for(&format!(".flight.{set}[data-name='{name}.csv']"), "");
    }
}

/// Waits until no job runs.
pub(crate) fn wait_idle(browser: &Browser) {
    browser.wait_until("the end of a job", "return document.body.dataset.busy === 'false'", Value::Null);
}

pub(crate) fn wait_for_models(browser: &Browser, count: usize) {
    let are = "return document.querySelectorAll('.model[data-id]').length === arguments[0]";
    browser.wait_until(&format!("{count} models"), are, count);
}

/// Identifies the first model.
pub(crate) fn identify(browser: &Browser) {
    browser.click("#identify");
    wait_for_models(browser, 1);
    wait_idle(browser);
}

/// Diagnoses the model that is chosen, and gives the verdict.
pub(crate) fn diagnose(browser: &Browser) -> String {
    browser.click("#diagnose");
    browser.wait_for("#verdict[data-verdict]", "");
    wait_idle(browser);
    let verdict = browser.run("return document.querySelector('#verdict').dataset.verdict", Value::Null);
    verdict.as_str().expect("a verdict").to_owned()
}

/// Adds the effect of a card to the model that is chosen.
pub(crate) fn add(browser: &Browser, effect: &str) {
    let models = browser.count(".model[data-id]");
    browser.click(&format!(".card[data-effect='{effect}'] button.add"));
    wait_for_models(browser, models + 1);
    wait_idle(browser);
}

fn choose_model(browser: &Browser, id: &str) {
    browser.click(&format!(".model[data-id='{id}'] input[type=radio]"));
    browser.wait_for(&format!(".model.chosen[data-id='{id}']"), "");
}

/// Texts of all models.
fn models(browser: &Browser) -> String {
    browser.text(".model[data-id]")
}

/// Downloads the file of the model that is chosen.
fn downloaded(browser: &Browser) -> Model {
    browser.click("[role=tab][data-tab=model]");
    browser.click("a[href*='/api/download/model.toml']");
    let text = browser.downloaded("model-3.toml");
    Model::parse(&text, Path::new("model-3.toml")).unwrap()
}

#[test]
fn wind_and_ground_effect_are_found_card_by_card_and_kept() {
    if missing() {
        return;
    }
    let Some(folder) = flights::hidden("case-06") else { return };
    let (lab, mut browser) = opened("case-06", folder.path());
    split(&browser);
    identify(&browser);
    for effect in ["steady-wind", "ground-effect"] {
        assert_eq!(diagnose(&browser), "missing-effect");
        browser.wait_for(&format!(".card.supported[data-effect='{effect}'] button.add"), "");
        browser.screenshot(effect);
        add(&browser, effect);
    }
    assert_eq!(diagnose(&browser), "adequate");
    browser.screenshot("adequate");
    let model = downloaded(&browser);
    for effect in [Effect::SteadyWind, Effect::GroundEffect] {
        assert!(model.term(effect).is_some(), "{effect} is not in the model");
    }

    // Undo: the model before, whose cards are there again.
    browser.click("#undo");
    browser.wait_for(".model.chosen[data-id='2']", "");
    browser.wait_for(".card.supported[data-effect='ground-effect'] button.add", "");
    let before = models(&browser);

    // Closed and opened again, all is there.
    drop(lab);
    let again = Lab::start(folder.path());
    open(&again, &mut browser);
    wait_for_models(&browser, 3);
    assert_eq!(models(&browser), before);
    browser.wait_for(".card.supported[data-effect='ground-effect'] button.add", "");
    choose_model(&browser, "3");
    browser.wait_for("#verdict[data-verdict=adequate]", "");
    browser.finish(&GONE);
}

/// What the page says a model takes in a terminal.
pub(crate) fn command_of(browser: &Browser, id: &str) -> String {
    choose_model(browser, id);
    browser.click("[role=tab][data-tab=model]");
    browser.wait_for("#panel-model h3", &format!("(model {id})"));
    browser.text("#command")
}

/// Each command, in a terminal in the folder of the flights, makes the model that the lab has made.
pub(crate) fn assert_commands_make_the_models(folder: &Path, commands: &[(&str, String)]) {
    let programs = program("quadlab").parent().unwrap().to_owned();
    for (id, command) in commands {
        let file = folder.join(format!("lab/model-{id}.toml"));
        let of_lab = Model::read(&file).unwrap();
        fs::remove_file(&file).unwrap();
        let path = format!("{}:{}", programs.display(), std::env::var("PATH").unwrap_or_default());
        let mut shell = Command::new("sh");
        let output = shell.args(["-c", command]).current_dir(folder).env("PATH", path).output().unwrap();
        assert!(output.status.success(), "{command}\n{}", String::from_utf8_lossy(&output.stderr));
        let of_terminal = Model::read(&file).unwrap();
        assert_eq!(of_terminal.terms.len(), of_lab.terms.len(), "{command}");
        for (ours, theirs) in of_lab.terms.iter().zip(&of_terminal.terms) {
            assert_eq!(ours.effect, theirs.effect, "{command}");
            for (a, b) in ours.coefficients.iter().zip(&theirs.coefficients) {
                assert!((a.value - b.value).abs() <= 1e-9 * a.value.abs(), "{command}: {a:?}, {b:?}");
            }
        }
    }
}

/// Flights that are made here: what runs in every clone.
#[test]
fn two_tabs_show_one_state_and_a_terminal_makes_the_same() {
    if missing() {
        return;
    }
    let folder = flights::long();
    let (lab, mut browser) = opened("two-tabs", folder.path());
    split(&browser);
    identify(&browser);
    let tabs = browser.second_tab();
    browser.open(&format!("http://127.0.0.1:{}/", lab.port));
    browser.wait_for("body[data-ready='true'] .flight[data-name]", "");
    wait_for_models(&browser, 1);

    // What one starts both show, and either ends it. It starts when the other is already being watched: it may take less than the turn.
    browser.run("setTimeout(() => document.querySelector('#explain').click(), 1000)", 0);
    browser.to_tab(&tabs[0]);
    browser.wait_for("body[data-busy='true'] #progress", "");
    browser.click("#cancel");
    wait_idle(&browser);
    browser.to_tab(&tabs[1]);
    wait_idle(&browser);
    browser.wait_for("#diagnose:enabled", "");
    browser.wait_for_no("#error");

    // What one finds the other shows without being loaded again.
    assert_eq!(diagnose(&browser), "missing-effect");
    let card = ".card.supported[data-effect='flapping-moment']";
    browser.click(&format!("{card} button.why"));
    browser.wait_for(&format!("{card} .criteria"), "met");
    add(&browser, "flapping-moment");
    browser.wait_for(".model[data-id]", "flapping-moment");
    let found = models(&browser);
    browser.to_tab(&tabs[0]);
    browser.wait_for(".model[data-id]", "flapping-moment");
    assert_eq!(models(&browser), found);
    browser.click("#undo");
    browser.wait_for("#verdict[data-verdict=missing-effect]", "");
    browser.to_tab(&tabs[1]);
    browser.wait_for("#verdict[data-verdict=missing-effect]", "");

    let commands = ["1", "2"].map(|id| (id, command_of(&browser, id)));
    browser.finish(&[]);
    drop(lab);
    assert_commands_make_the_models(folder.path(), &commands);
}

#[test]
fn a_power_cut_in_the_middle_of_a_job_loses_no_model() {
    if missing() {
        return;
    }
    let folder = flights::long();
    let (lab, mut browser) = opened("power-cut", folder.path());
    split(&browser);
    identify(&browser);
    let before = models(&browser);
    browser.click("#explain");
    browser.wait_for("body[data-busy='true'] #cancel:enabled", "");
    lab.cut();
    browser.wait_for("#error", "");
    browser.screenshot("server-gone");

    let again = Lab::start(folder.path());
    open(&again, &mut browser);
    wait_idle(&browser);
    browser.wait_for(".model[data-id]", before.trim());
    assert_eq!(
        browser.run("return document.querySelector('.flight[data-name=\"D.csv\"] select').value", 0),
        "validate"
    );
    assert!(!diagnose(&browser).is_empty());
    browser.finish(&GONE);
}

/// What the console may say of a server that is gone.
pub(crate) const GONE: [&str; 4] = [
    "net::ERR_CONNECTION_",
    "net::ERR_EMPTY_RESPONSE",
    "net::ERR_INCOMPLETE_CHUNKED_ENCODING",
    "net::ERR_SOCKET_NOT_CONNECTED",
];
