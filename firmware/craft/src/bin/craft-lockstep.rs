//! An autopilot on any processor with an operating system that a simulator ticks over standard
//! input and output, in stuffed frames: readings in, outcomes out. Its first argument is a gains
//! image. A second is a recording: then the digests of its ticks come out instead. It is there to
//! compare processors with.
#![forbid(unsafe_code)]

use std::ffi::OsStr;
use std::io::{BufReader, BufWriter, Read, Write};
use std::process::ExitCode;

use craft::Lockstep;
use craft::image::decode;
use proto::{Deframer, MAX_FRAME_LEN, MAX_STREAM_LEN, enframe};

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let mut paths = std::env::args_os().skip(1);
    let path = paths.next().ok_or("usage: craft-lockstep IMAGE [RECORDING]")?;
    let (config, _) = decode(&read(&path)?).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut lockstep = Lockstep::new(&config)?;
    let (mut deframer, mut answer, mut stream) = (Deframer::new(), [0; MAX_FRAME_LEN], [0; MAX_STREAM_LEN]);
    let mut output = BufWriter::new(std::io::stdout().lock());
    if let Some(path) = paths.next() {
        let mut written = Ok(());
        lockstep.replay(&read(&path)?, |digest| {
            if let (Ok(()), Some(bytes)) = (&written, enframe(&digest.to_le_bytes(), &mut stream)) {
                written = output.write_all(bytes);
            }
        });
        written?;
        return Ok(output.flush()?);
    }
    for byte in BufReader::new(std::io::stdin().lock()).bytes() {
        let Some(frame) = deframer.push(byte?) else { continue };
        let answer = lockstep.answer_frame(frame, &mut answer);
        if let Some(bytes) = answer.and_then(|answer| enframe(answer, &mut stream)) {
            output.write_all(bytes)?;
            output.flush()?;
        }
    }
    Ok(())
}

fn read(path: &OsStr) -> Result<Vec<u8>, String> {
    std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))
}
