//! OptiTrack's NatNet: Motive 2 and 3 (protocol 3.0 to 4.1), decoded by crate `natnet`.
//!
//! The server is asked for its version and for the ids of its rigid bodies; then frames come by
//! multicast, or to the socket that asked (unicast, which wants to be told four times a second that
//! somebody still listens). A frame tells when the cameras exposed it and when it was sent, in
//! ticks of a clock whose pace the server says, so the tracker's latency is known (thesis 5.5 adds
//! it to the link's delay); the way through the network is not in it.
//!
//! Limits: IPv4, as NatNet; one server; rigid bodies only. A body that Motive does not see comes
//! with its tracking bit cleared.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};
use std::time::{Duration, Instant};

use natnet::net::{CommandClient, DataClient, RawCommandClient};
use natnet::{Decoder, FrameOfData, Message, ModelDef, ServerInfo, Version, command};

use super::frames::{Frames, rotation_from_xyzw};
use super::gate::Gate;
use super::receiver::{DATAGRAM, MocapError, MocapReceiver, Sighting, TrackerEvent, at_least, received};

/// The port that Motive takes commands on unless told otherwise.
pub const COMMAND_PORT: u16 = 1510;
/// How long a server may take to answer.
const PATIENCE: Duration = Duration::from_secs(2);
/// A unicast server stops sending when its client is silent.
const KEEPALIVE: Duration = Duration::from_millis(250);
/// A latency beyond this is a clock that means something else.
const OLDEST: Duration = Duration::from_secs(1);

/// Where frames come from.
enum FrameSource {
    Multicast(DataClient),
    Unicast { socket: RawCommandClient, told: Instant },
}

/// A Motive server.
pub struct OptiTrack {
    server: SocketAddrV4,
    source: FrameSource,
    decoder: Decoder,
    version: Version,
    ticks_per_s: u64,
    body: i32,
    frames: Frames,
    gate: Gate,
    buffer: Vec<u8>,
}

impl OptiTrack {
    /// Asks `server` (Motive's command port is [`COMMAND_PORT`]) over the local `interface` for the
    /// rigid body of that name, or for the only one.
    ///
    /// # Errors
    /// A server that does not answer, speaks an unknown version, or does not know the body.
    pub fn connect(
        server: SocketAddrV4,
        interface: Ipv4Addr,
        body: Option<&str>,
        frames: Frames,
    ) -> Result<Self, MocapError> {
        let problem = |problem: String| MocapError::Server { server: SocketAddr::V4(server), problem };
        let bind = |source| MocapError::Bind { address: interface.to_string(), source };
        let mut client = CommandClient::bind(interface, server).map_err(bind)?;
        let info = client.connect_handshake(PATIENCE).map_err(|error| {
            problem(format!("{error}; is Motive streaming (Broadcast Frame Data), and is this its address?"))
        })?;
        let version = info.protocol_version;
        let decoder = Decoder::new(version).map_err(|error| problem(error.to_string()))?;
        let request = command::request_modeldef().map_err(|error| problem(error.to_string()))?;
        let reply =
            client.exchange(&request, PATIENCE).map_err(|error| problem(format!("no model: {error}")))?;
        let model =
            ModelDef::parse(&reply, version).map_err(|error| problem(format!("its model: {error}")))?;
        let body = choose(&model, body).map_err(problem)?;
        let source = open_frame_source(client, interface, &info).map_err(bind)?;
        Ok(Self {
            server,
            source,
            decoder,
            version,
            ticks_per_s: info.high_res_clock_frequency,
            body,
            frames,
            gate: Gate::new(Some(server.ip().to_owned().into())),
            buffer: vec![0; DATAGRAM],
        })
    }

    fn judge(&mut self, length: usize, source: SocketAddr) -> TrackerEvent {
        // Whoever else is in the multicast group is not the server.
        if let Err(why) = self.gate.admits(source) {
            return TrackerEvent::Refused(why.to_string());
        }
        let datagram = self.buffer.get(..length).unwrap_or_default();
        let frame = match self.decoder.parse(datagram).map(natnet::DecodedMessage::into_message) {
            Ok(Message::FrameOfData(frame)) => frame,
            Ok(_) => return TrackerEvent::Nothing,
            Err(error) => return TrackerEvent::Refused(format!("a NatNet datagram: {error}")),
        };
        let number = frame.frame_number.cast_unsigned();
        let body = frame.rigid_bodies.iter().find(|body| body.id == self.body);
        let pose = match body.filter(|body| body.tracking_valid()) {
            None => None,
            Some(body) => {
                let rotation = rotation_from_xyzw(body.orientation.map(f64::from));
                let place = body.position.map(f64::from);
                match rotation.and_then(|rotation| self.frames.pose(place, &rotation)) {
                    Some(pose) => Some(pose),
                    None => {
                        return TrackerEvent::Refused(format!(
                            "frame {number} has a pose that is no number or no rotation"
                        ));
                    }
                }
            }
        };
        match (self.gate.judge(source, number, pose, Instant::now()), pose) {
            (Err(why), _) => TrackerEvent::Refused(why.to_string()),
            (Ok(()), None) => TrackerEvent::NotSeen { frame: number },
            (Ok(()), Some(pose)) => {
                TrackerEvent::Seen(Sighting { frame: number, pose, age: age(&frame, self.ticks_per_s) })
            }
        }
    }
}

/// From exposure to sending, as far as the server says.
fn age(frame: &FrameOfData, ticks_per_s: u64) -> Duration {
    let timing = &frame.timing;
    let ticks =
        timing.transmit.checked_sub(timing.camera_mid_exposure).filter(|_| timing.camera_mid_exposure > 0);
    let age = ticks.filter(|_| ticks_per_s > 0).map(|ticks| ticks as f64 / ticks_per_s as f64);
    let age = age.and_then(|s| Duration::try_from_secs_f64(s).ok());
    age.filter(|age| *age < OLDEST).unwrap_or_default()
}

fn choose(model: &ModelDef, name: Option<&str>) -> Result<i32, String> {
    let bodies: Vec<(&str, i32)> = model.rigid_bodies().collect();
    let names = || bodies.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    match (name, bodies.as_slice()) {
        (Some(name), _) => bodies
            .iter()
            .find(|(known, _)| *known == name)
            .map(|(_, id)| *id)
            .ok_or_else(|| format!("has no rigid body {name:?}; it has: {}", names())),
        (None, [(_, id)]) => Ok(*id),
        (None, []) => Err("streams no rigid body: make one of the craft's markers in Motive".into()),
        (None, _) => Err(format!("streams several rigid bodies: name the craft's ({})", names())),
    }
}

fn open_frame_source(
    client: CommandClient,
    interface: Ipv4Addr,
    info: &ServerInfo,
) -> std::io::Result<FrameSource> {
    if info.connection.multicast {
        let data = DataClient::bind_multicast(interface, info.multicast_group(), info.connection.data_port)?;
        return Ok(FrameSource::Multicast(data));
    }
    let socket = client.into_raw();
    socket.send(&command::keepalive_datagram())?;
    Ok(FrameSource::Unicast { socket, told: Instant::now() })
}

impl MocapReceiver for OptiTrack {
    fn next(&mut self, patience: Duration) -> Result<TrackerEvent, MocapError> {
        let got = match &mut self.source {
            FrameSource::Multicast(data) => {
                data.set_read_timeout(at_least(patience))?;
                received(data.recv(&mut self.buffer))?
            }
            FrameSource::Unicast { socket, told } => {
                if told.elapsed() >= KEEPALIVE {
                    let _ = received(socket.send(&command::keepalive_datagram()))?;
                    *told = Instant::now();
                }
                socket.set_read_timeout(at_least(patience.min(KEEPALIVE)))?;
                received(socket.recv(&mut self.buffer))?
            }
        };
        match got {
            Some((length, source)) => Ok(self.judge(length, source)),
            None => Ok(TrackerEvent::Nothing),
        }
    }

    fn describe(&self) -> String {
        format!("NatNet {} of {}", self.version, self.server)
    }
}

impl std::fmt::Debug for OptiTrack {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("OptiTrack")
            .field("server", &self.server)
            .field("body", &self.body)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    //! Against the server that crate `natnet` brings for tests, over real sockets.

    use super::super::frames::Axes;
    use super::*;
    use natnet::modeldef::RigidBodyDef;
    use natnet::{
        ConnectionInfo, DataSet, MessageHeader, NAT_CONNECT, NAT_REQUEST_MODELDEF, PlannedBody,
        SyntheticServer,
    };
    use proptest::prelude::*;
    use std::net::UdpSocket;

    const VERSIONS: [Version; 4] =
        [Version::new(3, 0, 0, 0), Version::new(3, 1, 0, 0), Version::new(4, 0, 0, 0), Version::V4_1];

    /// Answers the questions of one client, then streams bodies 4 and 7 to it; 4 is not tracked in
    /// each third frame.
    fn serve(version: Version, names: &'static [(&'static str, i32)]) -> SocketAddrV4 {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let SocketAddr::V4(address) = socket.local_addr().unwrap() else { panic!("IPv4") };
        std::thread::spawn(move || {
            let server = SyntheticServer::new(version, 1_000_000);
            let connection =
                ConnectionInfo { data_port: 1511, multicast: false, multicast_group: [239, 255, 42, 99] };
            let info = ServerInfo {
                application_name: "Motive".into(),
                server_version: Version::new(3, 1, 2, 1),
                protocol_version: version,
                high_res_clock_frequency: 1_000_000,
                connection,
            };
            let mut buffer = [0; 2048];
            let client = loop {
                let (length, from) = socket.recv_from(&mut buffer).unwrap();
                match MessageHeader::parse(&buffer[..length]).unwrap().message_id {
                    NAT_CONNECT => socket.send_to(&info.to_datagram().unwrap(), from).unwrap(),
                    NAT_REQUEST_MODELDEF => {
                        let model = model(names);
                        socket.send_to(&server.model_def_datagram(&model).unwrap(), from).unwrap()
                    }
                    _ => break from,
                };
            };
            for frame in 0..200 {
                let turn = std::f32::consts::FRAC_1_SQRT_2;
                let craft = PlannedBody::tracked(4, [1.0, 1.5, -0.25], [0.0, turn, 0.0, turn]);
                let craft = PlannedBody { tracking_valid: frame % 3 != 2, ..craft };
                let wand = PlannedBody::tracked(7, [9.0; 3], [0.0, 0.0, 0.0, 1.0]);
                let datagram = server.datagram(frame, f64::from(frame) * 0.01, &[wand, craft]).unwrap();
                let _ = socket.send_to(&datagram, client);
                std::thread::sleep(Duration::from_millis(2));
            }
        });
        address
    }

    fn model(names: &[(&str, i32)]) -> ModelDef {
        let bodies = names.iter().map(|(name, id)| {
            DataSet::RigidBody(RigidBodyDef {
                name: (*name).into(),
                id: *id,
                parent_id: -1,
                offset: [0.0; 3],
                tail: vec![0; 4],
            })
        });
        ModelDef { datasets: bodies.collect() }
    }

    const BOTH: &[(&str, i32)] = &[("wand", 7), ("quad", 4)];

    #[test]
    fn each_version_gives_the_crafts_pose_in_our_frames() {
        for version in VERSIONS {
            let frames = Frames::with_axes(Axes::Y_UP);
            let mut motive =
                OptiTrack::connect(serve(version, BOTH), Ipv4Addr::LOCALHOST, Some("quad"), frames).unwrap();
            assert!(motive.describe().contains(&version.to_string()), "{}", motive.describe());
            let mut heard = Vec::new();
            while heard.len() < 6 {
                heard.push(motive.next(Duration::from_secs(5)).unwrap());
            }
            let seen: Vec<&Sighting> = heard
                .iter()
                .filter_map(|h| if let TrackerEvent::Seen(s) = h { Some(s) } else { None })
                .collect();
            let lost = heard.iter().filter(|h| matches!(h, TrackerEvent::NotSeen { .. })).count();
            assert_eq!((seen.len(), lost), (4, 2), "{version}: {heard:?}");
            for sighting in seen {
                assert_eq!(sighting.pose.position_m, [1.0, -0.25, -1.5]);
                // A quarter turn to the left about the axis that points up.
                assert!((sighting.pose.attitude_rad[2] + std::f32::consts::FRAC_PI_2).abs() < 1e-5);
                assert!(sighting.age < Duration::from_millis(100));
            }
        }
    }

    #[test]
    fn a_body_that_is_not_there_is_named_with_those_that_are() {
        let connect = |names, body| {
            let server = serve(Version::V4_1, names);
            OptiTrack::connect(server, Ipv4Addr::LOCALHOST, body, Frames::with_axes(Axes::Y_UP))
        };
        let message = connect(BOTH, Some("kite")).unwrap_err().to_string();
        assert!(message.contains("kite") && message.contains("wand, quad"), "{message}");
        let message = connect(BOTH, None).unwrap_err().to_string();
        assert!(message.contains("wand, quad"), "{message}");
        assert_eq!(connect(&[("a", 3)], None).unwrap().body, 3);
    }

    #[test]
    fn latency_is_exposure_to_sending() {
        let server = SyntheticServer::new(Version::V4_1, 1_000_000);
        let mut frame = server.frame(1, 0.5, &[]);
        (frame.timing.camera_mid_exposure, frame.timing.transmit) = (500_000, 507_250);
        assert_eq!(age(&frame, 1_000_000), Duration::from_micros(7250));
        for (exposed, sent, pace) in [(0, 5, 1), (10, 5, 1), (5, 10, 0), (1, u64::MAX, 1)] {
            (frame.timing.camera_mid_exposure, frame.timing.transmit) = (exposed, sent);
            assert_eq!(age(&frame, pace), Duration::ZERO);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(512))]
        /// A good datagram with some bytes changed or cut off, in each version: no panic.
        #[test]
        fn no_damage_panics(which in 0usize..4, edits in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6), cut: usize) {
            let server = SyntheticServer::new(VERSIONS[which], 1_000_000);
            let craft = PlannedBody::tracked(4, [1.0, 1.5, -0.25], [0.0, 0.0, 0.0, 1.0]);
            let mut bytes = server.datagram(3, 0.03, &[craft]).unwrap();
            let length = bytes.len();
            for (at, value) in edits {
                bytes[at % length] = value;
            }
            let decoder = Decoder::new(VERSIONS[which]).unwrap();
            let _ = decoder.parse(&bytes);
            let _ = decoder.parse(&bytes[..cut % length]);
        }
    }
}
