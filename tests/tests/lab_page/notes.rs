//! Notes on flights and models: kept, shown in every tab, never part of the page, never written over what is being typed.

use std::fs;

use fantoccini::key::Key;
use serde_json::{Value, json};

use crate::browser::{Browser, missing};
use crate::flights::small;
use crate::page::{identify, open, opened, split};
use crate::server::Lab;

const FLIGHT: &str = ".flight[data-name='A.csv'] .note-of";
const MODEL: &str = ".model[data-id='1'] .note-of";

fn wait_for_value(browser: &Browser, field: &str, value: &str) {
    let has = "const [field, value] = arguments[0]; return document.querySelector(field)?.value === value";
    browser.wait_until(&format!("{value:?} in {field}"), has, json!([field, value]));
}

#[test]
fn notes_are_kept_and_seen_in_every_tab() {
    if missing() {
        return;
    }
    let folder = small();
    let (lab, mut browser) = opened("notes", folder.path());
    split(&browser);
    identify(&browser);
    let [of_flight, of_model] = [FLIGHT, MODEL].map(|note| format!("{note} textarea"));
    for note in [FLIGHT, MODEL] {
        browser.click(&format!("{note} summary"));
    }
    // Kept on leaving the field, and by Ctrl+Enter.
    let hostile = "<img src=x onerror=\"document.title='taken'\"> & </textarea><b id=taken>windy";
    browser.append(&of_flight, hostile);
    browser.append(&of_model, "before the new propellers");
    browser.wait_for(&format!("{FLIGHT} summary"), &hostile[..40]);
    browser.run(
        "const field = document.querySelector(arguments[0]);
         field.dispatchEvent(new KeyboardEvent('keydown', { key: 'Enter', ctrlKey: true, bubbles: true, cancelable: true }));
         return true",
        of_model.as_str(),
    );
    browser.wait_for(&format!("{MODEL} summary"), "Note: before the new propellers");
    browser.wait_for(MODEL, "Saved.");
    assert_eq!(lab.state()["models"][0]["note"], "before the new propellers");
    for scheme in ["light", "dark"] {
        browser.prefer(scheme);
        browser.settle();
        browser.screenshot(scheme);
    }

    // In a second tab it is there, and what that writes comes to the first.
    let tabs = browser.second_tab();
    browser.open(&format!("http://127.0.0.1:{}/", lab.port));
    browser.wait_for(&format!("{MODEL} summary"), "before the new propellers");
    browser.click(&format!("{FLIGHT} summary"));
    wait_for_value(&browser, &of_flight, hostile);
    browser.append(&of_flight, "!");
    browser.to_tab(&tabs[0]);
    wait_for_value(&browser, &of_flight, &format!("{hostile}!"));

    // But nothing is written over what is being typed.
    browser.append(&of_model, ", half wr");
    let other = r#"{"model":1,"text":"of somebody else"}"#;
    assert_eq!(lab.visitor().post("/api/notes", other).with_origin(&lab).send(&lab).status, 200);
    browser.wait_for(MODEL, "It was changed in another tab to “of somebody else”");
    browser.wait_for(&format!("{MODEL} summary"), "of somebody else");
    wait_for_value(&browser, &of_model, "before the new propellers, half wr");
    let focus = "return document.activeElement === document.querySelector(arguments[0])";
    assert_eq!(browser.run(focus, of_model.as_str()), true, "the field loses the focus");
    browser.screenshot("conflict");
    browser.append(&of_model, "itten");
    browser.press(Key::Tab, 1);
    browser.wait_for(&format!("{MODEL} summary"), "half written");
    browser.to_tab(&tabs[1]);
    browser.wait_for(&format!("{MODEL} summary"), "half written");
    browser.to_tab(&tabs[0]);

    // Text everywhere, and not in the model's file.
    let taken = "return document.querySelectorAll('#left img, #taken, [onerror]').length + (document.title === 'taken' ? 1 : 0)";
    assert_eq!(browser.run(taken, Value::Null), 0, "a note became a part of the page");
    let file = fs::read_to_string(folder.path().join("lab/model-1.toml")).unwrap();
    assert!(!file.contains("propellers"), "{file}");

    // Too long a note is said, and not kept.
    browser.run(
        "const field = document.querySelector(arguments[0]);
         field.value = 'x'.repeat(4001); field.dispatchEvent(new Event('input')); field.focus(); field.blur(); return true",
        of_model.as_str(),
    );
    browser.wait_for(MODEL, "A note has 4000 characters at most, and this one has 4001: shorten it.");
    assert_eq!(lab.state()["models"][0]["note"], "before the new propellers, half written");

    // Opened again, all is there.
    browser.to_tab(&tabs[0]);
    drop(lab);
    let again = Lab::start(folder.path());
    open(&again, &mut browser);
    browser.wait_for(&format!("{MODEL} summary"), "half written");
    browser.wait_for(&format!("{FLIGHT} summary"), "<img src=x");
    browser.finish(&crate::page::GONE);
}
