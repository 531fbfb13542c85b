//! The lab's page on a hundred minutes of flight at 1 kHz, in the browser: how long it takes to open once they are read, how long
//! a zoom takes to be drawn, and what memory the server takes. Aims: 2 s, 50 ms, three times the flights. A flight lasts no longer
//! than the battery of the craft that is flown.
//!
//! Times are those of the page's own marks (the browser's performance API). `QUADLAB_BENCH_FLIGHTS` and `QUADLAB_BENCH_SECONDS`
//! make it smaller.

#![allow(dead_code, reason = "the stories need more of these modules")]

#[path = "../tests/lab_page/browser.rs"]
mod browser;
#[path = "../tests/lab_page/server.rs"]
mod server;

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use browser::{Browser, missing};
use serde_json::{Value, json};
use server::{Lab, Visitor};
use stories::world::{Pattern, Sensors, Size, World};

/// Zooms that are timed.
const ZOOMS: usize = 12;

fn setting(name: &str, usual: u64) -> u64 {
    std::env::var(name).ok().map_or(usual, |text| text.parse().expect(name))
}

/// Flights of a craft whose rotors flap; bytes of all of them.
fn fly(folder: &Path, count: usize, seconds: f64) -> u64 {
    let world = World::new(Size::F330, 11).with("flapping-moment", 1.0).unwrap();
    let sensors = Sensors { rate_hz: 1000.0, ..Sensors::default() };
    let patterns: Vec<Pattern> = Pattern::TRAIN.into_iter().chain(Pattern::VALIDATE).collect();
    world.write(folder, &[]).unwrap();
    let mut bytes = 0;
    for n in 0..count {
        let round = (n / patterns.len()) as u64;
        let flight =
            world.fly(patterns[n % patterns.len()], seconds, &sensors, round).expect("the pilot copes");
        let text = flight.to_csv();
        bytes += text.len() as u64;
        fs::write(folder.join(format!("{n}.csv")), text).unwrap();
    }
    bytes
}

/// Waits until nothing is read and no job runs.
fn wait(lab: &Lab, visitor: &Visitor) -> Duration {
    let start = Instant::now();
    loop {
        let state = visitor.get("/api/state").send(lab).json();
        if state["reading"] == false && state["job"].is_null() {
            assert!(state["problem"].is_null(), "{}", state["problem"]);
            return start.elapsed();
        }
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// Starts and durations of what the page has drawn over time, ms.
fn drawn(browser: &Browser) -> Vec<[f64; 2]> {
    let entries = browser.run(
        "return performance.getEntriesByName('time drawn').map(e => [e.startTime, e.duration])",
        Value::Null,
    );
    serde_json::from_value(entries).unwrap()
}

/// What the page has asked for so far, and when that began and ended, ms.
fn answers(browser: &Browser) -> Vec<(String, [f64; 2])> {
    let entries = browser.run(
        "return performance.getEntriesByType('resource').filter(e => /api|plotly|main/.test(e.name))
            .map(e => [new URL(e.name).pathname, [e.startTime, e.responseEnd]])",
        Value::Null,
    );
    serde_json::from_value(entries).unwrap()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    if missing() {
        return;
    }
    let (count, seconds) =
        (setting("QUADLAB_BENCH_FLIGHTS", 20) as usize, setting("QUADLAB_BENCH_SECONDS", 300) as f64);
    let folder = tempfile::tempdir().unwrap();
    let bytes = fly(folder.path(), count, seconds);
    println!("{count} flights of {seconds} s at 1 kHz, {} MB", bytes >> 20);

    let lab = Lab::start(folder.path());
    let visitor = lab.visitor();
    println!("read in {:.1} s", wait(&lab, &visitor).as_secs_f64());
    let held = lab.memory_kb();
    visitor.post("/api/jobs", r#"{"do":"identify"}"#).with_origin(&lab).send(&lab);
    println!("identified in {:.1} s", wait(&lab, &visitor).as_secs_f64());
    let started = Instant::now();
    visitor.post("/api/jobs", r#"{"do":"diagnose","model":1}"#).with_origin(&lab).send(&lab);
    println!("a diagnosis starts in {:.0} ms", started.elapsed().as_secs_f64() * 1e3);
    visitor.post("/api/cancel", "{}").with_origin(&lab).send(&lab);
    wait(&lab, &visitor);
    let [_, while_fitting] = lab.memory_kb();

    // As who comes back to it: the folder is read, and then the page is opened.
    drop(lab);
    let lab = Lab::start(folder.path());
    println!("read again, with a model, in {:.1} s", wait(&lab, &lab.visitor()).as_secs_f64());
    let mut browser = Browser::start("bench");
    browser.open(&lab.address);
    browser.wait_until("a plot", "return performance.getEntriesByName('time drawn').length > 0", Value::Null);
    let [start, took] = drawn(&browser)[0];
    println!("opened: first plot {:.0} ms after the address", start + took);
    for (what, [start, end]) in answers(&browser) {
        println!("  {what}: asked for after {start:.0} ms, there after {end:.0} ms");
    }
    browser.settle();
    let (mut first, mut whole) = (Vec::new(), Vec::new());
    for zoom in 0..ZOOMS {
        let before = drawn(&browser).len();
        browser.click(if zoom < ZOOMS / 2 { "#zoom-in" } else { "#zoom-out" });
        let more = "return performance.getEntriesByName('time drawn').length > arguments[0]";
        browser.wait_until("a zoom", more, json!(before));
        browser.settle();
        let all = drawn(&browser);
        first.push(all[before][1]);
        whole.push(all[all.len() - 1][1]);
    }
    println!(
        "zoom: drawn after {:.0} ms, with all points after {:.0} ms (medians of {ZOOMS})",
        median(first),
        median(whole)
    );
    let [_, while_looking] = lab.memory_kb();
    let highest = while_fitting.max(while_looking);
    println!(
        "memory of the server: {} MB with the flights, {} MB at most while it fitted, {} MB while one looked; {:.2} times the files",
        held[0] >> 10,
        while_fitting >> 10,
        while_looking >> 10,
        highest as f64 * 1024.0 / bytes as f64
    );
}
