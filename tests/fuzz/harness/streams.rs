//! What comes over a line or a network: IMU frames, datagrams of trackers; and what the ground station has recorded.

use std::io::Cursor;
use std::path::Path;

use ground::mocap::vicon_stream::Block;
use ground::recording::recover;
use natnet::{Decoder, ModelDef, ServerInfo, Version};
use proto::imu_frame::{MAX_STUFFED_LEN, Parser, encode};

/// Bytes of the IMU board: each frame that is found can be sent and found again.
pub(crate) fn imu(bytes: &[u8]) -> Result<(), String> {
    let mut parser = Parser::default();
    let mut found = 0;
    for frame in bytes.iter().filter_map(|byte| parser.push(*byte)) {
        found += 1;
        let mut buffer = [0; MAX_STUFFED_LEN];
        let sent = encode(&frame, &mut buffer).expect("a frame fits");
        let mut again = Parser::default();
        assert_eq!(sent.iter().filter_map(|byte| again.push(*byte)).count(), 1);
    }
    if found > 0 { Ok(()) } else { Err("no frame".into()) }
}

/// A datagram of Vicon Tracker.
pub(crate) fn vicon(bytes: &[u8]) -> Result<(), String> {
    let block = Block::parse(bytes).map_err(|error| error.to_string())?;
    let again = Block::parse(&block.to_bytes()).expect("what was written is read");
    assert_eq!((again.frame, again.objects.len()), (block.frame, block.objects.len()));
    Ok(())
}

/// A datagram of Motive, whatever it is and whichever version its server speaks.
pub(crate) fn optitrack(bytes: &[u8]) -> Result<(), String> {
    let mut read = Err("no message of any version".to_owned());
    for (major, minor) in [(3, 0), (3, 1), (4, 0), (4, 1)] {
        let version = Version { major, minor, build: 0, revision: 0 };
        let decoder = Decoder::new(version).map_err(|error| error.to_string())?;
        read = decoder.parse(bytes).map(drop).map_err(|error| error.to_string()).or(read);
        let _ = ModelDef::parse(bytes, version);
    }
    let _ = ServerInfo::parse(bytes);
    read
}

/// A recording that was not finished: its log is one that others read, with as many messages as it says.
pub(crate) fn recording(bytes: &[u8]) -> Result<(), String> {
    let path = Path::new("a.mcap.part");
    let recovered =
        recover((bytes, path), (Cursor::new(Vec::new()), path)).map_err(|error| error.to_string())?;
    let (log, complete) = (recovered.log.into_inner(), recovered.completeness);
    let messages = mcap::MessageStream::new(&log).expect("a log").map(|message| message.expect("a message"));
    assert_eq!(messages.count() as u64, complete.messages);
    assert!(complete.damaged_bytes + complete.tail_bytes <= bytes.len() as u64);
    Ok(())
}
