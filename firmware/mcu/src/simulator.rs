//! What the emulated board and whoever simulates its surroundings say to each other, once a tick.
//!
//! QEMU's board has neither sensors nor motors. Over its second serial port a simulator stands in for
//! them: the board sends a [`Request`] when a tick reads its sensors, the simulator lets the plant fly
//! on to that time under these commands and answers with a [`Sample`]. While the board waits, its
//! clock stands still: how long a simulator takes on the machine that emulates is no matter of the
//! craft. All else takes its time in instructions: interrupts, packets, the tick.
//!
//! Both are stuffed like packets ([`proto::enframe`]), little endian, without a CRC: the line is a
//! socket of one machine.

/// From the board: what it does to its motors, and since when by its clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Request {
    /// The board's clock, us modulo 2^32.
    pub time_us: u32,
    /// Motor commands, command units.
    pub commands: [f32; 4],
}

/// To the board: what its sensors measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Gyro p, q, r, body FRD, rad/s.
    pub gyro_rad_s: [f32; 3],
    /// Battery voltage, V.
    pub battery_v: f32,
    /// Bytes that the ground has sent over the first serial port so far, modulo 2^32: the board
    /// waits for them too.
    pub link_bytes: u32,
}

/// Five words of four bytes.
const LEN: usize = 20;

fn words(bytes: &[u8]) -> Option<[[u8; 4]; 5]> {
    let (words, rest) = bytes.as_chunks::<4>();
    <[[u8; 4]; 5]>::try_from(words).ok().filter(|_| rest.is_empty())
}

fn bytes(words: [[u8; 4]; 5]) -> [u8; LEN] {
    let mut bytes = [0; LEN];
    bytes.as_chunks_mut::<4>().0.copy_from_slice(&words);
    bytes
}

impl Request {
    /// Its bytes.
    pub fn to_bytes(self) -> [u8; LEN] {
        let [a, b, c, d] = self.commands.map(f32::to_le_bytes);
        bytes([self.time_us.to_le_bytes(), a, b, c, d])
    }

    /// The request of these bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [time, a, b, c, d] = words(bytes)?;
        let commands = [a, b, c, d].map(f32::from_le_bytes);
        Some(Self { time_us: u32::from_le_bytes(time), commands })
    }
}

impl Sample {
    /// Its bytes.
    pub fn to_bytes(self) -> [u8; LEN] {
        let [p, q, r] = self.gyro_rad_s.map(f32::to_le_bytes);
        bytes([p, q, r, self.battery_v.to_le_bytes(), self.link_bytes.to_le_bytes()])
    }

    /// The sample of these bytes.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [p, q, r, battery, link] = words(bytes)?;
        let gyro_rad_s = [p, q, r].map(f32::from_le_bytes);
        Some(Self {
            gyro_rad_s,
            battery_v: f32::from_le_bytes(battery),
            link_bytes: u32::from_le_bytes(link),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_come_back_as_what_they_were() {
        let request = Request { time_us: 0x0403_0201, commands: [1.0, 2.0, -3.5, 1e6] };
        assert_eq!(request.to_bytes()[..8], [1, 2, 3, 4, 0, 0, 0x80, 0x3f]);
        assert_eq!(Request::from_bytes(&request.to_bytes()), Some(request));
        let sample = Sample { gyro_rad_s: [0.1, -0.2, 0.3], battery_v: 11.1, link_bytes: u32::MAX };
        assert_eq!(Sample::from_bytes(&sample.to_bytes()), Some(sample));
        for length in [0, 19, 21, 24] {
            assert_eq!(Sample::from_bytes(&[0; 24][..length]), None);
        }
    }
}
