//! Where each channel has its column while a flight is prepared.

pub(crate) const POSITION: usize = 0;
pub(crate) const EULER: usize = 3;
pub(crate) const RATE: usize = 6;
pub(crate) const COMMAND: usize = 9;
pub(crate) const BATTERY: usize = 13;
pub(crate) const OPTIONAL: usize = 14;

#[cfg(test)]
mod tests {
    use flights::Column;

    use super::*;
    use crate::prepare::channels::Channels;
    use crate::testing::flight;

    /// Every column is told by its value; the groups follow one another in the order of the log.
    #[test]
    fn every_channel_is_where_its_place_says() {
        let mut flight = flight(3, |_, row| {
            row.position_ned_m = [1.0, 2.0, 3.0];
            row.euler_rad = [0.1, 0.2, 0.3];
            row.rate_rad_s = [4.0, 5.0, 6.0];
            row.command = [7.0, 8.0, 9.0, 10.0];
            row.battery_v = 11.0;
        });
        let optional = [
            (Column::Omega1, 21.0),
            (Column::Omega2, 22.0),
            (Column::Omega3, 23.0),
            (Column::Omega4, 24.0),
            (Column::Vx, 31.0),
            (Column::Vy, 32.0),
            (Column::Vz, 33.0),
        ];
        for (column, value) in optional {
            flight.replace(column, vec![value; 3]);
        }
        let channels = Channels::new(&flight, true, true);
        let at = |first: usize, count: usize| -> Vec<f64> {
            channels.columns[first..first + count].iter().map(|c| c[1]).collect()
        };
        assert_eq!(at(POSITION, 3), [1.0, 2.0, 3.0]);
        assert_eq!(at(EULER, 3), [0.1, 0.2, 0.3]);
        assert_eq!(at(RATE, 3), [4.0, 5.0, 6.0]);
        assert_eq!(at(COMMAND, 4), [7.0, 8.0, 9.0, 10.0]);
        assert_eq!(at(BATTERY, 1), [11.0]);
        assert_eq!(at(OPTIONAL, 4), [21.0, 22.0, 23.0, 24.0]);
        assert_eq!((channels.rotor, channels.imu), (Some(OPTIONAL), None));
        assert_eq!(at(channels.velocity.unwrap(), 3), [31.0, 32.0, 33.0]);
    }
}
