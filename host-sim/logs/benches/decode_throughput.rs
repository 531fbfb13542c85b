//! Megabytes of logs decoded in a second of processor time: a blackbox log and a DataFlash text log, which take
//! the most work a byte, made here with the fields and rates of real ones.
//!
//! The aim is 200 MB. `QUADLAB_BENCH_LOG` names a log to decode instead.

use std::fmt::Write as _;
use std::path::Path;

use cpu_time::ProcessTime;

/// What is decoded in all, bytes.
const BYTES: usize = 200_000_000;

fn main() {
    let logs = match std::env::var_os("QUADLAB_BENCH_LOG") {
        Some(path) => vec![std::fs::read(path).expect("a log")],
        None => vec![blackbox(100_000), dataflash(20_000)],
    };
    let round: usize = logs.iter().map(Vec::len).sum();
    let rounds = BYTES.div_ceil(round);
    let start = ProcessTime::now();
    for _ in 0..rounds {
        for bytes in &logs {
            let log = logs::decode(bytes, Path::new("made")).expect("a good log");
            assert!(log.losses.damage.is_empty(), "{:?}", log.losses.damage);
        }
    }
    let cpu_s = start.elapsed().as_secs_f64();
    println!(r#"{{"work":"MB of logs","amount":{},"cpu_s":{cpu_s}}}"#, (rounds * round) as f64 * 1e-6);
}

/// Fields of Betaflight: name, predictor and encoding of differences, numbers written for a frame.
const FIELDS: [(&str, &str, &str); 31] = [
    ("loopIteration", "6", "9"),
    ("time", "2", "0"),
    ("axisP[0]", "1", "0"),
    ("axisP[1]", "1", "0"),
    ("axisP[2]", "1", "0"),
    ("axisI[0]", "1", "7"),
    ("axisI[1]", "1", "7"),
    ("axisI[2]", "1", "7"),
    ("axisD[0]", "1", "0"),
    ("axisD[1]", "1", "0"),
    ("rcCommand[0]", "1", "8"),
    ("rcCommand[1]", "1", "8"),
    ("rcCommand[2]", "1", "8"),
    ("rcCommand[3]", "1", "8"),
    ("setpoint[0]", "1", "8"),
    ("setpoint[1]", "1", "8"),
    ("setpoint[2]", "1", "8"),
    ("setpoint[3]", "1", "8"),
    ("vbatLatest", "1", "6"),
    ("amperageLatest", "1", "6"),
    ("rssi", "1", "6"),
    ("gyroADC[0]", "3", "0"),
    ("gyroADC[1]", "3", "0"),
    ("gyroADC[2]", "3", "0"),
    ("accSmooth[0]", "3", "0"),
    ("accSmooth[1]", "3", "0"),
    ("accSmooth[2]", "3", "0"),
    ("motor[0]", "3", "0"),
    ("motor[1]", "3", "0"),
    ("motor[2]", "3", "0"),
    ("motor[3]", "3", "0"),
];

/// A whole frame every 32, differences of one byte, some of two, in between.
fn blackbox(frames: u32) -> Vec<u8> {
    let list = |of: &dyn Fn(&(&'static str, &'static str, &'static str)) -> &'static str| {
        FIELDS.iter().map(of).collect::<Vec<_>>().join(",")
    };
    let (names, zeros, ones) = (list(&|field| field.0), list(&|_| "0"), list(&|_| "1"));
    let mut bytes = format!(
        "H Product:Blackbox flight data recorder by Nicholas Sherlock\nH Data version:2\nH I interval:32\nH P interval:1/1\n\
         H Field I name:{names}\nH Field I signed:{ones}\nH Field I predictor:{zeros}\nH Field I encoding:{zeros}\n\
         H Field P predictor:{}\nH Field P encoding:{}\nH Firmware revision:Betaflight 4.4.0 (abc) STM32F7X2\n",
        list(&|field| field.1),
        list(&|field| field.2),
    )
    .into_bytes();
    let mut noise = 1_u32;
    let mut next = move || {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (noise >> 24) as u8
    };
    for frame in 0..frames {
        if frame % 32 == 0 {
            bytes.push(b'I');
            for field in 0..FIELDS.len() {
                let value = [frame, frame * 500].get(field).copied().unwrap_or(100);
                let mut left = value << 1;
                while left > 0x7f {
                    bytes.push(left as u8 | 0x80);
                    left >>= 7;
                }
                bytes.push(left as u8);
            }
            continue;
        }
        bytes.extend([b'P', 0]);
        let mut differences = |count: usize, bytes: &mut Vec<u8>| {
            for _ in 0..count {
                let difference = next();
                // One in eight takes two bytes.
                if difference >= 0xe0 { bytes.extend([difference, 1]) } else { bytes.push(difference & 0x7f) }
            }
        };
        differences(3, &mut bytes);
        bytes.push(0x04);
        differences(2, &mut bytes);
        // Sticks move in one of the four.
        bytes.extend([0x01, 0x10, 0, 0]);
        differences(10, &mut bytes);
    }
    bytes.extend(b"E\xffEnd of log\0");
    bytes
}

/// What a copter logs at 400 Hz, as text.
fn dataflash(rows: u32) -> Vec<u8> {
    let mut text = String::from(
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
         FMT, 129, 30, IMU, QBffffffIIfBBHH, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz\n\
         FMT, 130, 27, ATT, QccccCCCCB, TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF\n\
         FMT, 131, 40, RATE, Qffffffffffff, TimeUS,RDes,R,ROut,PDes,P,POut,YDes,Y,YOut,ADes,A,AOut\n\
         FMT, 132, 40, RCOU, QHHHHHHHHHHHHHH, TimeUS,C1,C2,C3,C4,C5,C6,C7,C8,C9,C10,C11,C12,C13,C14\n",
    );
    for row in 0..rows {
        let (t, x) = (1_000_000 + row * 2500, f64::from(row) * 0.01);
        let (sin, cos) = x.sin_cos();
        let written = writeln!(
            text,
            "IMU, {t}, 0, {:.7}, {:.7}, {:.8}, {:.6}, {:.6}, {:.6}, 0, 0, {:.5}, 1, 1, 1000, 1000\n\
             ATT, {t}, {:.2}, {:.2}, 0, {:.2}, 90.5, {:.2}, 0.01, 0.02, 3\n\
             RATE, {t}, {:.6}, {:.6}, {:.8}, 0, {:.6}, {:.7}, 0, {:.6}, 0.01, {:.5}, {:.5}, 0.35\n\
             RCOU, {t}, 1501, 1502, {}, 1504, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0",
            sin,
            cos,
            sin * cos,
            cos * 0.3,
            sin * 0.2,
            -9.8 + sin,
            45.0 + x,
            sin * 5.0,
            cos * 5.0,
            sin * 3.0,
            90.0 + sin,
            sin * 20.0,
            cos * 20.0,
            sin * 0.1,
            cos * 10.0,
            sin * 0.2,
            cos,
            sin * 100.0,
            cos * 80.0,
            1500 + row % 100,
        );
        written.expect("strings grow");
    }
    text.into_bytes()
}
