//! Damaged flight files and column maps: whatever stands in them, a flight or one clear line.

#[path = "common/fuzzing.rs"]
mod fuzzing;
#[path = "../../../tests/fuzz/harness/flight.rs"]
mod harness;

use fuzzing::{Base, Outcome, cut_before, fuzz, joined, take};

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

fn outcome(read: Result<(), String>) -> Outcome {
    match read {
        Ok(()) => Outcome::Flown,
        Err(text) => {
            assert!(text.len() < 2000 && !text.contains(char::is_control), "{text:?}");
            Outcome::Refused
        }
    }
}

fn read_flight(_: &str, bytes: &[u8]) -> Outcome {
    outcome(harness::flight(bytes))
}

fn read_map(_: &str, bytes: &[u8]) -> Outcome {
    outcome(harness::columns(bytes))
}

fn flight_files() -> Vec<Base> {
    let base = |name, separator| Base { name, records: flight_file(separator), seal: joined };
    vec![base("A.csv", ","), base("B.csv", ";"), base("C.csv", "\"")]
}

fn maps() -> Vec<Base> {
    vec![Base { name: "columns.toml", records: cut_before(MAP.as_bytes(), b"\n"), seal: joined }]
}

#[test]
fn damaged_flight_files_do_no_harm() {
    fuzz(100_000, flight_files(), read_flight);
}

#[test]
fn damaged_column_maps_do_no_harm() {
    fuzz(100_000, maps(), read_map);
}

/// Ten megabytes of a flight, whole, with every second line damaged, and of nothing: two seconds, and four times the memory.
#[test]
fn ten_megabytes_take_no_two_seconds_and_little_memory() {
    const LONG: usize = 10 << 20;
    let columns = "x,y,z,phi,theta,psi,p,q,r,cmd1,cmd2,cmd3,cmd4,vbat";
    let row = |k: usize| {
        format!("{:.2},1,2,-1.5,0.01,-0.02,3.1,0.1,-0.2,0.3,1600,1610,1620,1630,11.5\n", k as f64 * 0.01)
    };
    let rows: Vec<String> = (0..LONG / 72).map(row).collect();
    take("long.csv", format!("t,{columns}\n{}", rows.concat()).as_bytes(), read_flight);
    let damaged = |(k, row): (usize, &String)| if k % 2 == 0 { row.clone() } else { row.replace("1.5", "?") };
    let rows: String = rows.iter().enumerate().map(damaged).collect();
    take("damaged.csv", format!("t,{columns}\n{rows}").as_bytes(), read_flight);
    for byte in [0, b'\n', b',', b'1', 0xff] {
        take("nothing.csv", &vec![byte; LONG], read_flight);
        take("headed.csv", &[b"t,x\n", &vec![byte; LONG][..]].concat(), read_flight);
    }
}

/// The fuzz targets begin with what is damaged here. Run it after a format has changed: `cargo test -p flights corpus -- --ignored`.
#[test]
#[ignore = "writes corpora anew"]
fn the_corpus_is_written() {
    let corpus = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/fuzz/corpus");
    for (target, bases) in [("flight", flight_files()), ("columns", maps())] {
        for base in bases {
            std::fs::write(corpus.join(target).join(base.name), (base.seal)(&base.records)).unwrap();
        }
    }
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
