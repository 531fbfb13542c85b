//! An autopilot that a simulator ticks and waits for.

use control::{Autopilot, Config, ConfigError, Flight};
use proto::{MAX_FRAME_LEN, Message};

use crate::{convert, digest};

/// What a recording begins with.
pub const RECORDING_MAGIC: [u8; 8] = *b"recorded";

/// An autopilot in the air, driven by [`proto::Readings`].
#[derive(Debug, Clone)]
pub struct Lockstep {
    autopilot: Autopilot,
}

impl Lockstep {
    /// A fresh autopilot of a craft in the air ([`Autopilot::in_flight`]).
    ///
    /// # Errors
    /// The first parameter that cannot be flown with, by name.
    pub fn new(config: &Config) -> Result<Self, ConfigError> {
        Ok(Self { autopilot: Autopilot::in_flight(config)? })
    }

    /// One tick: the answer to readings. Any other message has none.
    #[inline]
    pub fn answer(&mut self, message: &Message) -> Option<proto::Outcome> {
        let Message::Readings(asked) = message else { return None };
        Some(convert::outcome(asked.tick, self.autopilot.tick(&convert::readings(asked))))
    }

    /// One tick over a link: a frame with readings in; out, in `buffer`, the frame of the outcome.
    /// Other bytes get no answer.
    pub fn answer_frame<'a>(
        &mut self,
        frame: &[u8],
        buffer: &'a mut [u8; MAX_FRAME_LEN],
    ) -> Option<&'a [u8]> {
        let outcome = self.answer(&proto::decode(frame).ok()?)?;
        proto::encode(&Message::Outcome(outcome), buffer).ok()
    }

    /// Ticks through a recording ([`RECORDING_MAGIC`], then frames of readings, each behind its
    /// length as u16, little endian) until a length of 0, the end, or a frame that holds no
    /// readings. `each` hears the [`digest`](crate::digest()) of every whole tick.
    pub fn replay(&mut self, recording: &[u8], mut each: impl FnMut(u64)) {
        let Some(mut rest) = recording.strip_prefix(&RECORDING_MAGIC) else { return };
        while let Some((length, behind)) = rest.split_first_chunk() {
            let Some((frame, next)) = behind.split_at_checked(u16::from_le_bytes(*length).into()) else {
                return;
            };
            let Ok(message) = proto::decode(frame) else { return };
            if self.answer(&message).is_none() {
                return;
            }
            each(digest(self.flight()));
            rest = next;
        }
    }

    /// All of the last tick.
    pub fn flight(&self) -> &Flight {
        self.autopilot.flight()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_answered_like_a_message() {
        let mut one = Lockstep::new(&Config::thesis()).unwrap();
        let mut other = one.clone();
        let readings = Message::Readings(proto::Readings {
            tick: 5,
            time_us: 10_000,
            pose: Some(proto::Pose { position_m: [0.0, 0.0, -1.0], attitude_rad: [0.1, 0.0, 0.0] }),
            gyro_rad_s: Some([0.0; 3]),
            battery_v: 11.1,
            command: None,
            request: None,
            outputs_ready: true,
        });
        let mut frame = [0; MAX_FRAME_LEN];
        let frame = proto::encode(&readings, &mut frame).unwrap();
        let mut buffer = [0; MAX_FRAME_LEN];
        let answer = one.answer_frame(frame, &mut buffer).unwrap();
        let outcome = other.answer(&readings).unwrap();
        assert_eq!(proto::decode(answer), Ok(Message::Outcome(outcome)));
        assert!(one.answer_frame(&frame[1..], &mut buffer).is_none());
        assert!(one.answer(&Message::Who).is_none());
    }

    #[test]
    fn a_recording_is_ticked_through_to_its_end() {
        let mut frame = [0; MAX_FRAME_LEN];
        let mut recording = RECORDING_MAGIC.to_vec();
        let mut expected = Vec::new();
        let mut one = Lockstep::new(&Config::thesis()).unwrap();
        for tick in 0..5 {
            let readings = Message::Readings(proto::Readings {
                tick,
                time_us: tick * 10_000,
                pose: Some(proto::Pose {
                    position_m: [0.0, 0.0, -1.0 - 0.01 * tick as f32],
                    attitude_rad: [0.0; 3],
                }),
                gyro_rad_s: None,
                battery_v: 11.1,
                command: None,
                request: None,
                outputs_ready: true,
            });
            one.answer(&readings).unwrap();
            expected.push(digest(one.flight()));
            let frame = proto::encode(&readings, &mut frame).unwrap();
            recording.extend((frame.len() as u16).to_le_bytes());
            recording.extend(frame);
        }
        let replayed = |recording: &[u8]| {
            let mut digests = Vec::new();
            Lockstep::new(&Config::thesis()).unwrap().replay(recording, |digest| digests.push(digest));
            digests
        };
        assert_eq!(replayed(&recording), expected);
        assert_eq!(replayed(&[&recording[..], &[0; 100]].concat()), expected, "what follows is no tick");
        assert_eq!(replayed(&recording[..recording.len() - 1]), expected[..4], "cut short");
        assert_eq!(replayed(&recording[1..]), [0_u64; 0], "no recording");
    }
}
