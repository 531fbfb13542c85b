//! An autopilot on any processor with an operating system that a simulator ticks over standard input and output: stuffed frames of
//! readings in, stuffed answers of `craft::Lockstep` out. Its argument is a gains image. It is there to compare processors with.
#![forbid(unsafe_code)]

use std::io::{BufReader, Read, Write};
use std::process::ExitCode;

use craft::image::decode;
use craft::{Lockstep, MAX_ANSWER_LEN};
use proto::{Deframer, MAX_STREAM_LEN, enframe};

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
    let path = std::env::args_os().nth(1).ok_or("usage: craft-lockstep IMAGE")?;
    let image = std::fs::read(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let (config, _) = decode(&image).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut lockstep = Lockstep::new(&config)?;
    let (mut deframer, mut answer, mut stream) = (Deframer::new(), [0; MAX_ANSWER_LEN], [0; MAX_STREAM_LEN]);
    let mut output = std::io::stdout().lock();
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
