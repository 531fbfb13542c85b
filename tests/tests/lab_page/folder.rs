//! A folder that is empty at first: flights are added on the page, and the vehicle is described in its form.

use model::Vehicle;
use serde_json::json;

use crate::browser::missing;
use crate::flights;
use crate::page::{identify, opened_empty};

/// Of a measured value, and of one that stays a guess.
#[test]
fn flights_are_added_and_the_vehicle_is_described() {
    if missing() {
        return;
    }
    let (from, folder) = (flights::small(), tempfile::tempdir().unwrap());
    let (_lab, browser) = opened_empty("folder", folder.path());
    browser.wait_for("#problem", "no flight file");

    // By the button, and dropped.
    let file = |name: &str| from.path().join(name);
    browser.attach("#files", &[file("A.csv"), file("B.csv"), file("C.csv"), file("D.csv")]);
    browser.wait_for(".flight[data-name='D.csv']", "");
    let text = std::fs::read_to_string(file("E.csv")).unwrap();
    let drop = "const [name, text] = arguments[0];
        const data = new DataTransfer();
        data.items.add(new File([text], name));
        const event = (kind) => new DragEvent(kind, { dataTransfer: data, bubbles: true, cancelable: true });
        document.body.dispatchEvent(event('dragover'));
        document.body.dispatchEvent(event('drop'));
        return true";
    browser.run(drop, json!(["E.csv", text]));
    browser.wait_for(".flight[data-name='E.csv']", "");
    assert_eq!(std::fs::read_to_string(folder.path().join("E.csv")).unwrap(), text);

    // One that is there already stays as it is, and the page says so.
    browser.run(drop, json!(["E.csv", "t\n0\n"]));
    browser.wait_for("#error", "E.csv: is in the folder already");
    assert_eq!(std::fs::read_to_string(folder.path().join("E.csv")).unwrap(), text);
    browser.click("#error .dismiss");

    browser.wait_for("#problem", "press Vehicle");
    browser.click("#vehicle-open");
    browser.wait_for("#vehicle .craft", "");
    browser.screenshot("vehicle");
    browser.fill("#vehicle input[name=mass]", "-1");
    browser.click("#vehicle-save");
    browser.wait_for("#vehicle [role=alert]", "mass = -1 is impossible");
    browser.fill("#vehicle input[name=mass]", "1.114");
    browser.fill("#vehicle input[name=name]", "tried \"here\"");
    browser.click("#vehicle-save");
    browser.wait_for_no("#vehicle");
    browser.wait_for_no("#problem");
    browser.wait_for("#vehicle-open", "not measured");
    browser.wait_for("#folder", "tried \"here\"");

    let vehicle = Vehicle::read(&folder.path().join("vehicle.toml")).unwrap();
    assert_eq!((vehicle.name.as_str(), vehicle.mass), ("tried \"here\"", 1.114));
    assert!(!vehicle.unmeasured.contains(&"mass".to_owned()), "{:?}", vehicle.unmeasured);
    assert!(vehicle.unmeasured.contains(&"rotor_radius".to_owned()), "{:?}", vehicle.unmeasured);
    identify(&browser);
    browser.finish(&["400 (Bad Request)"]);
}
