//! An effect that no catalogue has: its formula is found on the page, kept and added.

use crate::browser::missing;
use crate::flights;
use crate::page::{add, diagnose, identify, opened, split, wait_idle};

#[test]
fn a_formula_is_discovered_kept_and_added() {
    if missing() {
        return;
    }
    let folder = flights::weathercock();
    let (lab, browser) = opened("discovery", folder.path());
    split(&browser);
    browser.wait_for("#discover:disabled", "");
    identify(&browser);
    browser.click("#discover");
    browser.wait_for("#discovered-verdict[data-verdict='proposed']", "A formula fits");
    wait_idle(&browser);
    let card = "[data-discovered='discovered-1-1']";
    browser.wait_for(&format!("{card} code"), "r: k * v");
    browser.wait_for(card, "sideward airspeed");
    browser.wait_for(card, "weathercock");
    browser.wait_for("#discovery", "quadlab discover --model lab/model-1.toml");
    browser.screenshot("discovered");

    // Kept, it is an effect as any other.
    browser.click(&format!("{card} .keep-discovered"));
    browser.wait_for(card, "among your own effects");
    assert_eq!(diagnose(&browser), "missing-effect");
    add(&browser, "discovered-1-1");
    browser.wait_for(".model[data-id='2']", "discovered-1-1");
    assert!(folder.path().join("lab/effects/discovered-1-1.toml").exists());
    browser.finish(&[]);

    // Who opens the folder again finds it.
    drop(lab);
    let (_lab, browser) = opened("discovery-again", folder.path());
    browser.click(".model[data-id='1'] input[type=radio]");
    browser.wait_for(&format!("{card} code"), "r: k * v");
}
