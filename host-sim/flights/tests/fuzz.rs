//! Damaged flight files and column maps: whatever stands in them, a flight or one clear line.

#[path = "common/fuzzing.rs"]
mod fuzzing;

use std::path::Path;

use flights::{Column, ColumnMap, Flight, FlightError};
use fuzzing::{Base, Outcome, cut_before, fuzz, joined};

/// A third of a second with every column, a missing value, text and blank lines.
fn flight_file(separator: &str) -> Vec<Vec<u8>> {
    let header = "t,x,y,z,phi,theta,psi,p,q,r,cmd1,cmd2,cmd3,cmd4,vbat,omega1,omega2,omega3,omega4,ax,ay,az,vx,vy,vz,note\n";
    let mut text = header.to_owned();
    for row in 0..30 {
        let t = f64::from(row) * 0.01;
        let vbat = if row % 7 == 0 { String::new() } else { "11.5".into() };
        text += &format!(
            "{t:.2},{:.4},0.2,-1.5,0.01,-0.02,3.1{},0.1,-2e-1,0.3,0.4,0.5,0.6,0.7,{vbat},500,501,502,503,0.1,0.2,-9.81,{t},0,0,a\n",
            t * t,
            row % 10
        );
    }
    text += "\n";
    let text = match separator {
        "," => text,
        ";" => text.replace(',', ";").replace('.', ","),
        _ => text.replace(",a\n", ",\"a \"\"b\"\", c\"\n").replace('\n', "\r\n"),
    };
    cut_before(text.as_bytes(), b"\n")
}

fn one_line(error: &FlightError) -> Outcome {
    let text = error.to_string();
    assert!(text.len() < 2000 && !text.contains(char::is_control), "{text:?}");
    Outcome::Refused
}

fn read_flight(name: &str, bytes: &[u8]) -> Outcome {
    read_with(name, bytes, &ColumnMap::default())
}

fn read_with(name: &str, bytes: &[u8], map: &ColumnMap) -> Outcome {
    match Flight::parse_with(bytes, Path::new(name), map) {
        Ok(flight) => {
            let t = flight.column(Column::T).expect("a flight has times");
            assert!(t.windows(2).all(|pair| pair[0] < pair[1]));
            assert!(Flight::parse(flight.to_csv().as_bytes(), Path::new(name)).is_ok(), "is read again");
            Outcome::Flown
        }
        Err(error) => one_line(&error),
    }
}

#[test]
fn damaged_flight_files_do_no_harm() {
    let base = |name, separator| Base { name, records: flight_file(separator), seal: joined };
    fuzz(100_000, vec![base("A.csv", ","), base("B.csv", ";"), base("C.csv", "\"")], read_flight);
}

const MAP: &str = r#"[columns]
t = { column = "stamp", scale = 1e-6, offset = -1.0 }
x = "n"
y = "e"
z = "-d"
qw = "w"
qx = "i"
qy = "j"
qz = "k"
p = "-gx"
cmd1 = "m1"
[frames]
world = "enu"
body = "flu"
quaternion = "world-to-body"
[motors]
order = [4, 1, 2, 3]
"#;

/// The map of a file that has its columns.
fn read_map(name: &str, bytes: &[u8]) -> Outcome {
    const FLIGHT: &[u8] = b"stamp,n,e,d,w,i,j,k,gx,q,r,m1,cmd2,cmd3,cmd4\n\
        1000000,1,2,3,0.9,0.1,0,0.1,1,2,3,11,12,13,14\n1010000,1,2,3,0.9,0.1,0,0,1,2,3,11,12,13,14\n";
    let Ok(text) = std::str::from_utf8(bytes) else { return Outcome::Refused };
    match ColumnMap::parse(text, Path::new(name)) {
        Ok(map) if read_with("A.csv", FLIGHT, &map) == Outcome::Refused => Outcome::Read,
        Ok(_) => Outcome::Flown,
        Err(error) => one_line(&error),
    }
}

#[test]
fn damaged_column_maps_do_no_harm() {
    let records = cut_before(MAP.as_bytes(), b"\n");
    fuzz(100_000, vec![Base { name: "columns.toml", records, seal: joined }], read_map);
}
