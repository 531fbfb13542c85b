//! Flight files that are not as they should be: one clear line each; and whatever bytes come, no panic.

#[path = "../../diagnosis/tests/common/flown.rs"]
mod flown;

use std::path::Path;

use flights::{Column, Flight};
use flown::{NONE, fly, truth};
use proptest::prelude::*;

fn good() -> String {
    fly(&truth(), 1, 3.0, &NONE).to_csv()
}

fn parse(text: &str) -> Result<Flight, String> {
    Flight::parse(text.as_bytes(), Path::new("f.csv")).map_err(|e| e.to_string())
}

/// The line a broken file gives; checks that it is one line that starts with the file.
fn refusal(text: &str) -> String {
    let message = parse(text).expect_err("must be refused");
    assert!(message.starts_with("f.csv: ") && message.lines().count() == 1, "{message}");
    message
}

/// Multiplies a column of a good file.
fn scaled(column: &str, factor: f64) -> String {
    let text = good();
    let mut lines = text.lines();
    let header = lines.next().unwrap();
    let index = header.split(',').position(|c| c == column).unwrap();
    let mut result = format!("{header}\n");
    for line in lines {
        let mut fields: Vec<String> = line.split(',').map(str::to_owned).collect();
        fields[index] = (fields[index].parse::<f64>().unwrap() * factor).to_string();
        result.push_str(&(fields.join(",") + "\n"));
    }
    result
}

#[test]
fn a_good_file_round_trips_exactly() {
    let flight = fly(&truth(), 1, 3.0, &NONE);
    let mut again = parse(&flight.to_csv()).unwrap();
    again.name.clone_from(&flight.name);
    assert_eq!(again, flight);
    assert_eq!(again.to_csv(), flight.to_csv());
}

#[test]
fn columns_are_found_by_name_and_unknown_ones_left_alone() {
    let text = good();
    let reordered: String = text
        .lines()
        .enumerate()
        .map(|(k, line)| {
            let fields: Vec<&str> = line.split(',').collect();
            let extra = if k == 0 { "comment" } else { "take-off" };
            format!("{extra},{},{},{extra}\r\n", fields[14], fields[..14].join(","))
        })
        .collect();
    let (flight, original) = (parse(&reordered).unwrap(), parse(&text).unwrap());
    assert_eq!(flight, original);
    // Quotes take the other way through the reader.
    let quoted = reordered.replace("take-off", "\"take, off\"");
    assert_eq!(parse(&quoted).unwrap(), original);
}

#[test]
fn empty_fields_are_missing_values() {
    let text = good().replacen("\n0.01,", "\n0.01,,", 1);
    assert!(refusal(&text).contains("row 3: has 16 fields, the header has 15"));
    let mut lines: Vec<String> = good().lines().map(str::to_owned).collect();
    let mut fields: Vec<&str> = lines[5].split(',').collect();
    fields[3] = "";
    fields[7] = "NaN";
    lines[5] = fields.join(",");
    let flight = parse(&lines.join("\n")).unwrap();
    assert!(flight.column(Column::Z).unwrap()[4].is_nan() && flight.column(Column::P).unwrap()[4].is_nan());
}

#[test]
fn what_is_wrong_is_said_with_row_and_column() {
    assert!(refusal("").contains("is empty"));
    assert!(refusal("\n\n  \n").contains("is empty"));
    assert!(refusal(&good().replacen("theta", "tetha", 1)).contains("column \"theta\" is missing"));
    assert!(refusal(&good().replacen(",theta", ",phi", 1)).contains("column \"phi\" is there twice"));
    let two: String = good().lines().take(2).map(|l| format!("{l}\n")).collect();
    assert!(refusal(&two).contains("fewer than two samples (1)"));
    let header: String = good().lines().take(1).map(|l| format!("{l}\n")).collect();
    assert!(
        refusal(&header).contains("fewer than two samples (0)") || refusal(&header).contains("no values")
    );
    let mut lines: Vec<String> = good().lines().map(str::to_owned).collect();
    lines.swap(40, 41);
    assert!(refusal(&lines.join("\n")).contains("row 42: time goes from 0.4 s to 0.39 s"));
    let mut lines: Vec<String> = good().lines().map(str::to_owned).collect();
    lines[9] = lines[9].replacen(',', ",1.2.3,", 1);
    let fields: Vec<&str> = lines[9].split(',').collect();
    lines[9] = [&fields[..2], &fields[3..]].concat().join(",");
    assert!(refusal(&lines.join("\n")).contains("row 10: column \"x\" has \"1.2.3\", which is not a number"));
}

#[test]
fn wrong_units_are_recognised() {
    let degrees = 180.0 / std::f64::consts::PI;
    assert!(refusal(&scaled("phi", degrees)).contains("degrees"));
    assert!(refusal(&scaled("t", 1000.0)).contains("milliseconds"));
    assert!(refusal(&scaled("x", 1000.0)).contains("millimetres"));
    assert!(refusal(&scaled("p", degrees)).contains("degrees per second"));
    assert!(refusal(&scaled("vbat", 1000.0)).contains("millivolts"));
    let commands = parse(&scaled("cmd2", 0.001)).unwrap();
    let error = commands.check_against(&truth().vehicle, Path::new("f.csv")).unwrap_err().to_string();
    assert!(error.contains("cmd2") && error.contains("takes 1000 to 2000 us"), "{error}");
    assert!(parse(&good()).unwrap().check_against(&truth().vehicle, Path::new("f.csv")).is_ok());
}

/// What spreadsheets and other programs write: semicolons or tabs, decimal commas, other names, degrees and milliseconds.
#[test]
fn tables_of_other_programs_are_read_as_they_are() {
    let original = parse(&good()).unwrap();
    let german = good().replace('.', "\u{1}").replace(',', ";").replace('\u{1}', ",");
    assert_eq!(parse(&german).unwrap(), original);
    assert_eq!(parse(&good().replace(',', "\t")).unwrap(), original);
    let named = good().replacen("phi,theta,psi", "Roll,Pitch,Yaw", 1).replacen("t,", "Time [s],", 1);
    assert_eq!(parse(&named).unwrap(), original);
    let degrees = scaled("phi", 180.0 / std::f64::consts::PI).replacen("phi", "roll [deg]", 1);
    let flight = parse(&degrees).unwrap();
    let pairs = flight.required(Column::Phi).iter().zip(original.required(Column::Phi));
    assert!(pairs.into_iter().all(|(read, own)| (read - own).abs() < 1e-12));
    assert!(refusal(&good().replacen(",x,", ",x [furlong],", 1)).contains("is in a unit that is not known"));
}

#[test]
fn a_long_file_is_read_in_blocks_to_the_same_flight() {
    let short = good();
    let (header, rows) = short.split_once('\n').unwrap();
    let mut text = format!("{header}\n");
    for (k, row) in rows.lines().cycle().take(20_000).enumerate() {
        let (_, rest) = row.split_once(',').unwrap();
        text.push_str(&format!("{:.2},{rest}\n", k as f64 * 0.01));
    }
    assert!(text.len() > 4 << 20, "several blocks");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.csv");
    let compare = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let (read, parsed) = (Flight::read(&path), Flight::parse(text.as_bytes(), &path));
        match (read, parsed) {
            (Ok(a), Ok(b)) => assert_eq!(a, b),
            (a, b) => assert_eq!(a.map_err(|e| e.to_string()), b.map_err(|e| e.to_string())),
        }
    };
    compare(&text);
    compare(text.trim_end());
    compare(&format!("\u{feff}{text}\n\n"));
    // A fault and a quote far from the first block.
    compare(&text.replacen("\n150.00,", "\n150.00,oops", 1));
    compare(&text.replacen("\n150.00,", "\n\"150.00\",", 1));
}

#[test]
fn folders_and_missing_files_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let error = Flight::read(folder.path()).unwrap_err().to_string();
    assert!(error.contains("is a folder"), "{error}");
    let error = Flight::read(&folder.path().join("no.csv")).unwrap_err().to_string();
    assert!(error.contains("no.csv: cannot read"), "{error}");
}

proptest! {
    #[test]
    fn any_bytes_give_a_flight_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        let _ = Flight::parse(&bytes, Path::new("f.csv"));
    }

    #[test]
    fn a_damaged_file_gives_a_flight_or_one_line(
        cut in 0_usize..20_000,
        at in 0_usize..20_000,
        byte in any::<u8>(),
        drop in 0_usize..50,
    ) {
        let mut bytes = good().into_bytes();
        let length = bytes.len();
        bytes.truncate(cut.max(1) % length);
        if let Some(b) = bytes.get_mut(at % length) {
            *b = byte;
        }
        let from = (at / 2).min(bytes.len());
        bytes.drain(from..(from + drop).min(bytes.len()));
        if let Err(error) = Flight::parse(&bytes, Path::new("f.csv")) {
            prop_assert_eq!(error.to_string().lines().count(), 1, "{}", error);
        }
    }

    #[test]
    fn plain_and_quoted_reading_agree(values in proptest::collection::vec(-1000.0..1000.0_f64, 30)) {
        let header = "t,x,y,z,phi,theta,psi,p,q,r,cmd1,cmd2,cmd3,cmd4,vbat,note";
        let row = |t: f64, v: &[f64], note: &str| {
            let numbers: Vec<String> = v.iter().map(|x| format!("{:.5}", x * 1e-3)).collect();
            format!("{t},{},{note}\n", numbers.join(","))
        };
        let text = |note: &str| {
            format!("{header}\n{}{}", row(0.0, &values[..14], note), row(0.01, &values[15..29], note))
        };
        let plain = parse(&text("x")).unwrap();
        prop_assert_eq!(plain, parse(&text("\"x\"")).unwrap());
    }
}
