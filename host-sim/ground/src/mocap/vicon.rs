//! Vicon Tracker's UDP object stream as a tracker.

use std::io;
use std::net::{IpAddr, SocketAddr, UdpSocket};
use std::time::{Duration, Instant};

use super::frames::{Frames, rotation_from_xyz};
use super::gate::Gate;
use super::receiver::{DATAGRAM, MocapError, MocapReceiver, Sighting, TrackerEvent, at_least, received};
use super::vicon_stream::Block;

/// Vicon Tracker's UDP object stream.
#[derive(Debug)]
pub struct Vicon {
    socket: UdpSocket,
    frames: Frames,
    /// The object's name; absent: the only one.
    object: Option<String>,
    gate: Gate,
    buffer: Vec<u8>,
}

impl Vicon {
    /// Listens on `address` ([`PORT`](super::vicon_stream::PORT) is Tracker's) for the object of
    /// that name, or for the only one. Only `tracker` is heard; absent: whoever is heard first.
    ///
    /// # Errors
    /// [`MocapError::Bind`].
    pub fn listen(
        address: SocketAddr,
        tracker: Option<IpAddr>,
        object: Option<String>,
        frames: Frames,
    ) -> Result<Self, MocapError> {
        let bind = |source| MocapError::Bind { address: address.to_string(), source };
        let socket = UdpSocket::bind(address).map_err(bind)?;
        Ok(Self { socket, frames, object, gate: Gate::new(tracker), buffer: vec![0; DATAGRAM] })
    }

    /// Where it listens.
    ///
    /// # Errors
    /// What the system says.
    pub fn address(&self) -> io::Result<SocketAddr> {
        self.socket.local_addr()
    }

    /// What a datagram says of the craft.
    fn judge(&mut self, length: usize, source: SocketAddr) -> TrackerEvent {
        if let Err(why) = self.gate.admits(source) {
            return TrackerEvent::Refused(why.to_string());
        }
        let datagram = self.buffer.get(..length).unwrap_or_default();
        let block = match Block::parse(datagram) {
            Ok(block) => block,
            Err(error) => return TrackerEvent::Refused(error.to_string()),
        };
        let Block { frame, objects } = &block;
        let named = |name: &str| objects.iter().find(|object| object.name == name);
        let object = match (&self.object, objects.as_slice()) {
            (Some(name), _) => named(name),
            (None, [only]) => Some(only),
            (None, []) => None,
            (None, several) => {
                let names: Vec<&str> = several.iter().map(|object| object.name.as_str()).collect();
                return TrackerEvent::Refused(format!(
                    "the tracker streams {} objects: name the craft's ({})",
                    several.len(),
                    names.join(", ")
                ));
            }
        };
        // A block without the craft may belong to a frame whose next block has it.
        let Some(object) = object else { return TrackerEvent::Nothing };
        let position_m = object.translation_mm.map(|mm| mm * 1e-3);
        let pose = match self.frames.pose(position_m, &rotation_from_xyz(object.rotation_rad)) {
            _ if !object.is_seen() => None,
            Some(pose) => Some(pose),
            None => return TrackerEvent::Refused(format!("frame {frame} has a pose that is no number")),
        };
        match (self.gate.judge(source, *frame, pose, Instant::now()), pose) {
            (Err(why), _) => TrackerEvent::Refused(why.to_string()),
            (Ok(()), None) => TrackerEvent::NotSeen { frame: *frame },
            (Ok(()), Some(pose)) => TrackerEvent::Seen(Sighting { frame: *frame, pose, age: Duration::ZERO }),
        }
    }
}

impl MocapReceiver for Vicon {
    fn next(&mut self, patience: Duration) -> Result<TrackerEvent, MocapError> {
        self.socket.set_read_timeout(at_least(patience))?;
        match received(self.socket.recv_from(&mut self.buffer))? {
            Some((length, source)) => Ok(self.judge(length, source)),
            None => Ok(TrackerEvent::Nothing),
        }
    }

    fn describe(&self) -> String {
        let port = self.address().map_or_else(|_| "?".into(), |address| address.to_string());
        format!("Vicon Tracker's object stream on {port}")
    }
}

#[cfg(test)]
mod tests {
    use super::super::frames::Axes;
    use super::super::vicon_stream::Object;
    use super::*;

    const SOON: Duration = Duration::from_secs(5);

    fn object(name: &str, x_mm: f64) -> Object {
        Object { name: name.into(), translation_mm: [x_mm, 0.0, 1000.0], rotation_rad: [0.1, 0.0, 0.0] }
    }

    fn lab(name: Option<&str>) -> (Vicon, UdpSocket) {
        let here: SocketAddr = "127.0.0.1:0".parse().unwrap();
        let vicon = Vicon::listen(here, None, name.map(Into::into), Frames::with_axes(Axes::Z_UP)).unwrap();
        let tracker = UdpSocket::bind(here).unwrap();
        tracker.connect(vicon.address().unwrap()).unwrap();
        (vicon, tracker)
    }

    #[test]
    fn the_crafts_object_is_found_by_name_or_by_being_alone() {
        for (name, objects, x_m) in [
            (Some("quad"), vec![object("wand", 1.0), object("quad", 2500.0)], 2.5),
            (None, vec![object("anything", -300.0)], -0.3),
        ] {
            let (mut vicon, tracker) = lab(name);
            tracker.send(&Block { frame: 9, objects }.to_bytes()).unwrap();
            let TrackerEvent::Seen(seen) = vicon.next(SOON).unwrap() else { panic!("not seen") };
            assert_eq!(seen.frame, 9);
            assert_eq!(seen.pose.position_m, [x_m, 0.0, -1.0]);
            assert!((seen.pose.attitude_rad[0] - 0.1).abs() < 1e-6, "{seen:?}");
        }
        let (mut vicon, tracker) = lab(None);
        let objects = vec![object("wand", 1.0), object("quad", 2.0)];
        tracker.send(&Block { frame: 1, objects }.to_bytes()).unwrap();
        let TrackerEvent::Refused(why) = vicon.next(SOON).unwrap() else { panic!("not refused") };
        assert!(why.contains("wand, quad"), "{why}");
    }

    #[test]
    fn what_cannot_be_used_is_refused_and_the_next_frame_is_heard() {
        let (mut vicon, tracker) = lab(None);
        let hidden = Object { translation_mm: [0.0; 3], rotation_rad: [0.0; 3], ..object("quad", 0.0) };
        let broken = Object { translation_mm: [f64::NAN; 3], ..object("quad", 0.0) };
        let mut hear = |bytes: &[u8]| {
            tracker.send(bytes).unwrap();
            vicon.next(SOON).unwrap()
        };
        let block = |frame, object| Block { frame, objects: vec![object] }.to_bytes();
        assert!(matches!(hear(b"hello"), TrackerEvent::Refused(_)));
        assert!(matches!(hear(&block(5, object("quad", 1.0))), TrackerEvent::Seen(_)));
        assert!(matches!(hear(&block(5, object("quad", 1.0))), TrackerEvent::Refused(_)), "twice");
        assert!(matches!(hear(&block(4, object("quad", 1.0))), TrackerEvent::Refused(_)), "late");
        assert_eq!(hear(&block(6, hidden)), TrackerEvent::NotSeen { frame: 6 });
        assert!(matches!(hear(&block(7, broken)), TrackerEvent::Refused(_)));
        assert_eq!(hear(&Block { frame: 8, objects: Vec::new() }.to_bytes()), TrackerEvent::Nothing);
        assert!(matches!(hear(&block(9, object("quad", 1.0))), TrackerEvent::Seen(_)));
        assert_eq!(vicon.next(Duration::ZERO).unwrap(), TrackerEvent::Nothing);
    }
}
