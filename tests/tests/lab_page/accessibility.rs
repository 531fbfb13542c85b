//! Whether the page can be used without a mouse, with a screen reader, and read in either scheme.
//!
//! Names are those that Chromium gives to screen readers (its accessibility tree), and contrast is that of WCAG 2.2 from
//! the colours it computed: the page is not asked what it meant.

use std::collections::BTreeSet;

use fantoccini::key::Key;
use serde_json::{Value, json};

use crate::browser::{Browser, missing};
use crate::flights;
use crate::page::{diagnose, identify, opened};

/// Roles that a user acts on, or that stand for a picture.
const NAMED_ROLES: [&str; 14] = [
    "button",
    "checkbox",
    "combobox",
    "image",
    "link",
    "listbox",
    "menuitem",
    "radio",
    "searchbox",
    "slider",
    "spinbutton",
    "switch",
    "tab",
    "textbox",
];

/// Contrast of small text, WCAG 2.2 level AA.
const CONTRAST: f64 = 4.5;

/// What the `contrast` script finds too faint: text, contrast, where.
const CONTRAST_SCRIPT: &str = include_str!("contrast.js");

/// What has no name in the tree that screen readers get.
fn nameless(browser: &Browser) -> Vec<String> {
    browser.devtools("Accessibility.enable", json!({}));
    let tree = browser.devtools("Accessibility.getFullAXTree", json!({}));
    let nodes = tree["nodes"].as_array().expect("a tree");
    assert!(!nodes.is_empty(), "the tree is empty");
    let text = |value: &Value| value["value"].as_str().unwrap_or_default().trim().to_owned();
    let counts =
        |node: &&Value| node["ignored"] != true && NAMED_ROLES.contains(&text(&node["role"]).as_str());
    let found = nodes.iter().filter(counts).filter(|node| text(&node["name"]).is_empty());
    found.map(|node| format!("{} {}", text(&node["role"]), outline(browser, node))).collect()
}

/// The element of a node of the tree.
fn outline(browser: &Browser, node: &Value) -> String {
    let of = json!({ "backendNodeId": node["backendDOMNodeId"] });
    let html = browser.devtools("DOM.getOuterHTML", of);
    html["outerHTML"].as_str().unwrap_or_default().chars().take(160).collect()
}

fn texts(value: &Value) -> Vec<String> {
    value.as_array().into_iter().flatten().map(|v| v.as_str().unwrap_or_default().to_owned()).collect()
}

/// What of the page as it stands now is against the rules, in the scheme `scheme`.
pub(crate) fn faults(browser: &Browser, scheme: &str) -> Vec<String> {
    browser.prefer(scheme);
    let mut faults: Vec<String> =
        nameless(browser).into_iter().map(|element| format!("no name: {element}")).collect();
    let twice = "const all = [...document.querySelectorAll('[id]')].map(e => e.id);
        return [...new Set(all.filter((id, at) => all.indexOf(id) !== at))]";
    faults.extend(texts(&browser.run(twice, Value::Null)).iter().map(|id| format!("id {id} is there twice")));
    let without =
        "return [...document.querySelectorAll('img:not([alt])')].map(e => e.outerHTML.slice(0, 160))";
    faults.extend(texts(&browser.run(without, Value::Null)).iter().map(|img| format!("no alt: {img}")));
    faults.extend(texts(&browser.run(CONTRAST_SCRIPT, CONTRAST)));
    faults.into_iter().map(|fault| format!("{scheme}: {fault}")).collect()
}

/// What the tab key never comes to. Of a row of tabs one is enough: arrows lead to the others.
fn not_reached(browser: &Browser) -> BTreeSet<String> {
    let mark = "let next = 0;
        const all = document.querySelectorAll('a[href], button, input, select, textarea, summary, [tabindex], [role=tab]');
        for (const e of all) {
            // Of a group of radio buttons the tab key comes to the one that is chosen.
            if (e.matches('input[type=radio]:not(:checked)')) { continue; }
            if (!e.disabled && e.checkVisibility({ visibilityProperty: true }) && e.getAttribute('tabindex') !== '-1') {
                e.dataset.reach = next++;
            }
        }
        document.addEventListener('focusin', event => { event.target.dataset.reached = 1; });
        document.activeElement?.blur();
        return next";
    let elements = browser.run(mark, Value::Null).as_u64().expect("a count");
    assert!(elements > 5, "only {elements} elements can be acted on");
    // Further than once around, wherever it begins.
    browser.press(Key::Tab, 2 * elements as usize);
    let missed = "return [...document.querySelectorAll('[data-reach]:not([data-reached])')].map(e => e.outerHTML.slice(0, 160))";
    let missed = texts(&browser.run(missed, Value::Null));
    missed.into_iter().map(|element| format!("tab does not reach {element}")).collect()
}

#[test]
fn the_page_can_be_read_and_used_by_all() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (_lab, browser) = opened("accessibility", folder.path());
    let mut all = faults(&browser, "light");
    identify(&browser);
    diagnose(&browser);
    for scheme in ["light", "dark"] {
        browser.prefer(scheme);
        for tab in ["time", "where", "spectrum", "path", "model", "own"] {
            browser.click(&format!("[role=tab][data-tab={tab}]"));
            browser.wait_for(&format!("[role=tab][data-tab={tab}][aria-selected=true]"), "");
            browser.settle();
            browser.screenshot(&format!("{scheme}-{tab}"));
            all.extend(faults(&browser, scheme).into_iter().map(|fault| format!("{tab}, {fault}")));
        }
    }
    all.extend(not_reached(&browser));
    all.sort();
    all.dedup();
    assert!(all.is_empty(), "{}", all.join("\n"));
    browser.finish(&[]);
}

/// What of the page as it stands now does not fit into a window of that size.
fn misfits(browser: &Browser, width: u32, height: u32) -> Vec<String> {
    let size = json!({ "width": width, "height": height, "deviceScaleFactor": 1, "mobile": false });
    browser.devtools("Emulation.setDeviceMetricsOverride", size);
    browser.wait_until("the window's size", "return innerWidth === arguments[0]", width);
    browser.settle();
    // What scrolls within a part of the page is within it; what is for screen readers only is nowhere.
    let script = "const out = [], [w, h] = [innerWidth, innerHeight];
        if (document.documentElement.scrollWidth > w) out.push('the page scrolls sideways');
        for (const id of ['left', 'middle', 'right']) {
            const part = document.getElementById(id), box = part.getBoundingClientRect();
            if (box.left < -1 || box.right > w + 1 || box.bottom > h + 1) out.push(`#${id} reaches out of the window`);
            if (part.scrollWidth > part.clientWidth + 1) out.push(`#${id} scrolls sideways`);
        }
        for (const e of document.querySelectorAll('button, select, input, [role=tab], h2, h3')) {
            const box = e.getBoundingClientRect();
            if (e.checkVisibility() && box.width > 1 && (box.right > w + 1 || box.left < -1)) {
                out.push(`out of the window: ${e.outerHTML.slice(0, 120)}`);
            }
        }
        const plots = document.querySelector('[role=tabpanel]:not([hidden]) .main-svg');
        const share = plots ? plots.getBoundingClientRect().width / w : 1;
        if (share < 0.4) out.push(`the plots take ${Math.round(100 * share)} % of the width`);
        return out";
    texts(&browser.run(script, Value::Null)).into_iter().map(|what| format!("{width} px: {what}")).collect()
}

#[test]
fn the_page_fits_small_and_large_windows() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (_lab, browser) = opened("widths", folder.path());
    identify(&browser);
    diagnose(&browser);
    let mut all = Vec::new();
    for tab in ["time", "where", "spectrum", "path", "model", "own"] {
        browser.click(&format!("[role=tab][data-tab={tab}]"));
        browser.wait_for(&format!("[role=tab][data-tab={tab}][aria-selected=true]"), "");
        for (width, height) in [(1280, 720), (1920, 1080), (3840, 2160)] {
            all.extend(misfits(&browser, width, height).into_iter().map(|misfit| format!("{tab}, {misfit}")));
            if tab == "time" || tab == "path" {
                browser.screenshot(&format!("{tab}-{width}"));
            }
        }
    }
    assert!(all.is_empty(), "{}", all.join("\n"));
    browser.finish(&[]);
}

/// The rules see what breaks them.
#[test]
fn a_bad_page_is_seen_as_one() {
    if missing() {
        return;
    }
    let browser = Browser::start("bad-page");
    browser.open_text(
        "<title>bad</title><body style='background: #fff; color: #999'><p id=a>faint</p><p id=a style='color: #000'>good</p>
        <img src='data:image/gif;base64,R0lGODlhAQABAAAAACw='><button></button><a href='#b' title='named'></a>
        <div style='background: #000'><span style='color: #666'>faint on dark</span></div>"
            .to_owned()
            .as_str(),
    );
    let all = faults(&browser, "light").join("\n");
    for fault in [
        "no name: button",
        "no name: image",
        "no alt",
        "id a is there twice",
        "\"faint\"",
        "\"faint on dark\"",
    ] {
        assert!(all.contains(fault), "{fault} is not in\n{all}");
    }
    for good in ["named", "good"] {
        assert!(!all.contains(good), "{all}");
    }
}
