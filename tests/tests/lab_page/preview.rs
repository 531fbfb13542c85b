//! A card that is pointed at shows what its effect would do, and nothing is kept of it.

use fantoccini::key::Key;
use serde_json::{Value, json};

use crate::browser::{Browser, missing};
use crate::flights;
use crate::page::{add, diagnose, identify, opened, split};
use crate::server::Lab;

const CARD: &str = ".card[data-effect='flapping-moment']";

/// What the server says of the accelerations of a flight.
fn series(lab: &Lab, query: &str) -> Value {
    let path = format!("/api/series?flight=D.csv&width=8000&{query}");
    let answer = lab.visitor().get(&path).send(lab);
    assert_eq!(answer.status, 200, "{path}: {}", answer.body);
    answer.json()
}

/// How many lines are drawn, and where panels and axes stand.
fn drawn(browser: &Browser) -> (u64, Value) {
    let script = "const plot = document.getElementById('plots-drawing'), full = plot._fullLayout;
        const axes = Object.keys(full).filter(name => /^[xy]axis/.test(name)).sort();
        return [plot.data.length, [full.width, full.height, plot.getBoundingClientRect().top, axes.map(name => [name, full[name].range, full[name].domain])]]";
    let [lines, frame] = <[Value; 2]>::try_from(browser.run(script, 0).as_array().unwrap().clone()).unwrap();
    (lines.as_u64().unwrap(), frame)
}

fn wait_for_lines(browser: &Browser, count: u64) {
    let script = "return document.getElementById('plots-drawing').data?.length === arguments[0]";
    browser.wait_until(&format!("{count} lines"), script, count);
}

/// Until the card is there, and a held-out flight is drawn.
fn diagnosed(browser: &Browser) {
    split(browser);
    identify(browser);
    diagnose(browser);
    browser.choose("#flight", "D.csv");
    browser.wait_for(&format!("{CARD} button.preview"), "Preview");
    browser.settle();
}

/// Three lines in each of six panels; an effect that is tried adds two.
#[test]
fn a_card_that_is_pointed_at_shows_what_its_effect_would_do() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (lab, browser) = opened("preview", folder.path());
    diagnosed(&browser);
    let (lines, frame) = drawn(&browser);
    assert_eq!(lines, 3 * 6);

    browser.point(CARD);
    browser.wait_for("#legend", "with flapping-moment");
    wait_for_lines(&browser, 5 * 6);
    assert_eq!(drawn(&browser).1, frame, "panels and axes stay");
    browser.screenshot("light");
    browser.prefer("dark");
    browser.settle();
    browser.screenshot("dark");
    browser.prefer("light");
    let shows = "const plot = document.getElementById('plots-drawing');
        return plot.data.filter(t => t.line.dash === '6px,3px').flatMap(t => t.y).filter(y => y !== null).length > 1000";
    assert_eq!(browser.run(shows, 0), Value::Bool(true));

    browser.point("header");
    wait_for_lines(&browser, 3 * 6);
    browser.wait_until(
        "the legend as before",
        "return !document.querySelector('#legend').textContent.includes('flapping')",
        0,
    );
    assert_eq!(drawn(&browser).1, frame);

    // The button keeps it, at the other tab too, and the keyboard is enough for that.
    browser
        .run("document.querySelector(arguments[0]).focus(); return true", format!("{CARD} button.preview"));
    browser.press(Key::Space, 1);
    wait_for_lines(&browser, 5 * 6);
    browser.wait_for(&format!("{CARD} button.preview[aria-pressed=true]"), "");
    browser.click("[role=tab][data-tab=where]");
    browser.wait_for("#legend", "mean residual with flapping-moment");
    browser.settle();
    browser.screenshot("where");
    browser.click("[role=tab][data-tab=time]");
    browser.wait_for("#legend", "with flapping-moment");
    browser.click(&format!("{CARD} button.preview"));
    wait_for_lines(&browser, 3 * 6);

    // Nothing was kept, and what was drawn is what the job makes.
    assert_eq!(lab.state()["models"].as_array().unwrap().len(), 1);
    assert!(!folder.path().join("lab/model-2.toml").exists());
    let tried = series(&lab, "model=1&effect=flapping-moment");
    assert_ne!(tried, series(&lab, "model=1"));
    add(&browser, "flapping-moment");
    assert_eq!(tried, series(&lab, "model=2"));
    let refused = lab.visitor().get("/api/series?model=2&flight=D.csv&effect=flapping-moment").send(&lab);
    assert_eq!(refused.status, 400, "{}", refused.body);
    assert!(refused.body.contains("the model has flapping-moment already"), "{}", refused.body);

    // Another use of the flights is another fit.
    let body = r#"{"name":"D.csv","set":"train"}"#;
    assert_eq!(lab.visitor().post("/api/sets", body).with_origin(&lab).send(&lab).status, 200);
    assert_ne!(tried, series(&lab, "model=1&effect=flapping-moment"));
    browser.finish(&[]);
}

/// Answers that come when the pointer is elsewhere are drawn nowhere.
#[test]
fn a_card_that_was_left_is_not_drawn() {
    if missing() {
        return;
    }
    let folder = flights::small();
    let (_lab, browser) = opened("preview-left", folder.path());
    diagnosed(&browser);
    // Every request of a series with an effect, and how it ended.
    let watch = "window.asked = []; const real = window.fetch;
        window.fetch = (path, options) => {
            const answer = real(path, options);
            if (String(path).includes('effect=')) {
                const one = { path: String(path), end: '' };
                window.asked.push(one);
                answer.then(() => { one.end = 'answered'; }, error => { one.end = error.name; });
            }
            return answer;
        };
        return true";
    browser.run(watch, 0);
    browser.point(CARD);
    browser.wait_until("a request", "return window.asked.length === 1", 0);
    browser.point("header");
    browser.wait_until("its end", "return window.asked[0].end !== ''", 0);
    browser.settle();
    assert_eq!(drawn(&browser).0, 3 * 6);
    let text = browser.text("#legend");
    assert!(!text.contains("flapping-moment"), "{text}");
    let end = browser.run("return window.asked", 0);
    println!("{end}");
    assert_eq!(end.as_array().unwrap().len(), 1, "{end}");

    // A second model is back when the card is left.
    add(&browser, "flapping-moment");
    browser.wait_for("#legend", "second: basic (model 1)");
    diagnose(&browser);
    browser.run("document.querySelector('details.others').open = true; return true", json!(0));
    let other = ".card[data-effect='steady-wind']";
    browser.point(other);
    browser.wait_for("#legend", "with steady-wind");
    let text = browser.text("#legend");
    assert!(!text.contains("second"), "{text}");
    browser.settle();
    browser.screenshot("in-place-of-the-second");
    browser.point("header");
    browser.wait_for("#legend", "second: basic (model 1)");
    browser.finish(&[]);
}
