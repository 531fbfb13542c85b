//! An autopilot that a simulator ticks and waits for.

use control::{Autopilot, Config, ConfigError, Flight};
use proto::{MAX_FRAME_LEN, Message};

use crate::{convert, digest};

const DIGEST_LEN: usize = 8;

/// No answer of [`Lockstep::answer_frame`] is longer, in bytes.
pub const MAX_ANSWER_LEN: usize = MAX_FRAME_LEN + DIGEST_LEN;

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

    /// One tick: the answer to readings. Anything else has none.
    #[inline]
    pub fn answer(&mut self, message: &Message) -> Option<proto::Outcome> {
        let Message::Readings(asked) = message else { return None };
        Some(convert::outcome(asked.tick, self.autopilot.tick(&convert::readings(asked))))
    }

    /// One tick over a narrow link: a frame with readings in; out, in `buffer`, the frame of the outcome and behind it the
    /// [`digest`](crate::digest()) of the whole tick (u64, little endian), internal terms included. Other bytes have no answer.
    pub fn answer_frame<'a>(
        &mut self,
        frame: &[u8],
        buffer: &'a mut [u8; MAX_ANSWER_LEN],
    ) -> Option<&'a [u8]> {
        let outcome = self.answer(&proto::decode(frame).ok()?)?;
        let length = proto::encode(&Message::Outcome(outcome), buffer).ok()?.len();
        let end = length + DIGEST_LEN;
        buffer.get_mut(length..end)?.copy_from_slice(&digest(self.flight()).to_le_bytes());
        buffer.get(..end)
    }

    /// What [`Lockstep::answer_frame`] answered, taken apart again.
    ///
    /// # Errors
    /// Bytes that are no such answer.
    pub fn read_answer(answer: &[u8]) -> Result<(proto::Outcome, u64), proto::Error> {
        let (frame, digest) = answer.split_last_chunk::<DIGEST_LEN>().ok_or(proto::Error::Malformed)?;
        match proto::decode(frame)? {
            Message::Outcome(outcome) => Ok((outcome, u64::from_le_bytes(*digest))),
            _ => Err(proto::Error::Malformed),
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
        let mut buffer = [0; MAX_ANSWER_LEN];
        let answer = one.answer_frame(frame, &mut buffer).unwrap();
        let outcome = other.answer(&readings).unwrap();
        assert_eq!(Lockstep::read_answer(answer), Ok((outcome, digest(other.flight()))));
        assert_eq!(Lockstep::read_answer(frame).unwrap_err(), proto::Error::Malformed);
        assert!(one.answer_frame(&frame[1..], &mut buffer).is_none());
        assert!(one.answer(&Message::Who).is_none());
    }
}
