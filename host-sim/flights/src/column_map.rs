//! Which column of a file is which, as its owner says: `columns.toml` beside the flight, or the vehicle file.
//!
//! ```toml
//! [columns]                                     # ours = theirs
//! t = { column = "stamp", scale = 1e-6 }        # value = scale * theirs + offset
//! p = "-gyro_roll"                              # with the other sign
//! payload_kg = { column = "grams", scale = 1e-3 } # a further column, for formulas of users
//!
//! [frames]
//! world = "enu"                                 # ned, enu or nwu; of x y z, vx vy vz and the attitude
//! body = "flu"                                  # frd or flu; of p q r, ax ay az and the attitude
//! quaternion = "world-to-body"                  # body-to-world or world-to-body
//!
//! [motors]
//! order = [4, 1, 2, 3]                          # their numbers of front-left, front-right, rear-right, rear-left
//! ```
//!
//! In the vehicle file the order is `log_order` of `[motors]`; the rest is the same. Of the two, the file beside the flight
//! is taken, whole: it is nearer to the data. Columns that are not named are found by their usual names.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use model::{
    BodyFrame, LogColumn, LogColumns, LogFrames, QuaternionTurn, Vehicle, WorldFrame, frames, user_effects,
};
use nalgebra::{Matrix3, Vector3, Vector4};
use serde::Deserialize;

use crate::columns::{COLUMNS, Column};
use crate::error::FlightError;
use crate::flight::Flight;
use crate::names::{bare, is_other_name};

/// Name of the file.
pub const MAP_FILE: &str = "columns.toml";

/// Which column of a file is which.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColumnMap {
    /// For columns by their name, where their values are from.
    pub(crate) sources: BTreeMap<String, Source>,
    pub(crate) frames: LogFrames,
    pub(crate) motor_order: Option<[usize; 4]>,
    pub(crate) origin: Origin,
    /// Further columns that are read besides ours.
    pub(crate) further: Vec<String>,
}

/// Where a map stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Origin {
    #[default]
    Beside,
    Vehicle,
}

/// Where the values of a column are from: scale * theirs + offset.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Name in the file.
    pub name: String,
    /// What it is multiplied by.
    pub scale: f64,
    /// What is added then.
    pub offset: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MapFile {
    #[serde(default)]
    columns: LogColumns,
    #[serde(default)]
    frames: LogFrames,
    #[serde(default)]
    motors: Option<Motors>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Motors {
    order: [usize; 4],
}

impl ColumnMap {
    /// The map of a flight of `vehicle`: that beside the flight, else that of the vehicle. With the further columns that formulas
    /// of users name.
    pub fn of_flight(flight: &Path, vehicle: &Vehicle) -> Result<Self, FlightError> {
        let map = match Self::read_beside(flight)? {
            Some(map) => map,
            None => Self::of_vehicle(vehicle, Path::new(&vehicle.name))?,
        };
        let is_in_file = |column: &&str| *column != user_effects::TIME_COLUMN;
        let further = user_effects::columns().into_iter().filter(is_in_file).map(str::to_owned).collect();
        Ok(Self { further, ..map })
    }

    /// The map beside a flight; the usual names where there is none.
    pub fn beside(flight: &Path) -> Result<Self, FlightError> {
        Ok(Self::read_beside(flight)?.unwrap_or_default())
    }

    /// The map of a vehicle file; `path` is for messages.
    pub fn of_vehicle(vehicle: &Vehicle, path: &Path) -> Result<Self, FlightError> {
        let map = Self::new(&vehicle.columns, vehicle.frames, vehicle.motors.log_order, "log_order", path)?;
        Ok(Self { origin: Origin::Vehicle, ..map })
    }

    /// The file of a flight's map.
    pub fn file_beside(flight: &Path) -> PathBuf {
        flight.with_file_name(MAP_FILE)
    }

    fn read_beside(flight: &Path) -> Result<Option<Self>, FlightError> {
        let path = Self::file_beside(flight);
        match std::fs::read_to_string(&path) {
            Ok(text) => Self::parse(&text, &path).map(Some),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            // Standard input and devices have no folder with a map in it.
            Err(_) if !flight.is_file() => Ok(None),
            Err(source) => Err(FlightError::Read { path, source }),
        }
    }

    /// Parses the text of a map; `path` is for messages.
    pub fn parse(text: &str, path: &Path) -> Result<Self, FlightError> {
        if let Some(what) = model::too_long(text, "a map of columns (columns.toml)") {
            return Err(FlightError::Map { path: path.into(), what });
        }
        // Names and values of the file are in the reasons: a line is a line whatever they hold.
        let file: MapFile = toml::from_str(text).map_err(|error| {
            let line = error.span().map_or(1, |span| text[..span.start].matches('\n').count() + 1);
            let what = one_line(&format!("line {line}: {}", error.message()));
            FlightError::Map { path: path.into(), what }
        })?;
        Self::new(&file.columns, file.frames, file.motors.map(|motors| motors.order), "order", path)
    }

    fn new(
        columns: &LogColumns,
        frames: LogFrames,
        motor_order: Option<[usize; 4]>,
        order_key: &str,
        path: &Path,
    ) -> Result<Self, FlightError> {
        let refuse = |what: String| FlightError::Map { path: path.into(), what: one_line(&what) };
        let mut sources = BTreeMap::new();
        for (own, entry) in columns {
            if !COLUMNS.contains(&own.as_str()) && (is_other_name(own) || !user_effects::can_be_column(own)) {
                return Err(refuse(format!(
                    "columns.{own}: is no column of a flight file; those are {}, and words that mean nothing else in formulas",
                    COLUMNS.join(", ")
                )));
            }
            let source = Source::of(entry);
            if !(source.scale.is_finite() && source.scale != 0.0 && source.offset.is_finite()) {
                return Err(refuse(format!(
                    "columns.{own}: scale and offset must be finite numbers, and the scale not zero"
                )));
            }
            sources.insert(own.clone(), source);
        }
        if let Some(order) = motor_order
            && (1..=4).any(|number| !order.contains(&number))
        {
            return Err(refuse(format!("motors.{order_key}: {order:?} does not have each of 1, 2, 3 and 4")));
        }
        Ok(Self { sources, frames, motor_order, ..Self::default() })
    }

    /// The further column that is read which a name in a header is.
    pub(crate) fn further_named(&self, name: &str) -> Option<&str> {
        self.further.iter().map(String::as_str).find(|own| *own == bare(name))
    }

    /// Whether it names a column of theirs.
    pub fn names(&self, theirs: &str) -> bool {
        self.sources.values().any(|source| source.name == theirs)
    }

    /// With these further columns read besides ours.
    pub(crate) fn with_further(&self, further: Vec<String>) -> Self {
        Self { further, ..self.clone() }
    }

    /// Whether it says anything.
    pub fn says_something(&self) -> bool {
        !(self.sources.is_empty() && self.frames.are_ours() && self.motor_order.is_none())
    }

    /// Turns what was read into our frames and motor order.
    pub(crate) fn apply(&self, flight: &mut Flight) {
        use Column::*;
        let (world, body) = (to_ned(self.frames.world), to_frd(self.frames.body));
        if self.frames.world != WorldFrame::Ned {
            turn(flight, [X, Y, Z], &world);
            turn(flight, [Vx, Vy, Vz], &world);
        }
        if self.frames.body != BodyFrame::Frd {
            turn(flight, [P, Q, R], &body);
            turn(flight, [Ax, Ay, Az], &body);
        }
        if !self.frames.are_ours() {
            self.turn_attitude(flight, &world, &body);
        }
        if let Some(order) = self.motor_order {
            reorder(flight, [Cmd1, Cmd2, Cmd3, Cmd4], order);
            reorder(flight, [Omega1, Omega2, Omega3, Omega4], order);
        }
    }

    fn turn_attitude(&self, flight: &mut Flight, world: &Matrix3<f64>, body: &Matrix3<f64>) {
        use Column::*;
        let ours = |inertial_to_body: Matrix3<f64>| body * inertial_to_body * world.transpose();
        if let [Some(phi), Some(theta), Some(psi)] = [Phi, Theta, Psi].map(|c| flight.column(c)) {
            let angles = (0..phi.len()).map(|k| Vector3::new(phi[k], theta[k], psi[k]));
            let turned: Vec<Vector3<f64>> =
                angles.map(|a| frames::euler_from_dcm(&ours(frames::dcm_from_euler(a)))).collect();
            put(flight, [Phi, Theta, Psi], |axis, k| turned[k][axis]);
        }
        if let [Some(w), Some(x), Some(y), Some(z)] = [Qw, Qx, Qy, Qz].map(|c| flight.column(c)) {
            let sign = if self.frames.quaternion == QuaternionTurn::WorldToBody { -1.0 } else { 1.0 };
            let quaternions = (0..w.len()).map(|k| Vector4::new(w[k], sign * x[k], sign * y[k], sign * z[k]));
            let turned: Vec<Vector3<f64>> = quaternions
                .map(|q| frames::euler_from_dcm(&ours(frames::dcm_from_quaternion(&q.normalize()))))
                .collect();
            if flight.column(Phi).is_none() {
                put(flight, [Phi, Theta, Psi], |axis, k| turned[k][axis]);
            }
            [Qw, Qx, Qy, Qz].into_iter().for_each(|column| flight.columns[column as usize] = None);
        }
    }
}

fn one_line(text: &str) -> String {
    text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}

impl Source {
    fn of(entry: &LogColumn) -> Self {
        let (name, scale, offset) = match entry {
            LogColumn::Name(name) => (name.clone(), 1.0, 0.0),
            LogColumn::Scaled(scaled) => (scaled.column.clone(), scaled.scale, scaled.offset),
        };
        match name.strip_prefix('-') {
            Some(bare) => Self { name: bare.trim().into(), scale: -scale, offset },
            None => Self { name, scale, offset },
        }
    }
}

fn to_ned(world: WorldFrame) -> Matrix3<f64> {
    match world {
        WorldFrame::Ned => Matrix3::identity(),
        WorldFrame::Enu => Matrix3::new(0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0),
        WorldFrame::Nwu => Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
    }
}

fn to_frd(body: BodyFrame) -> Matrix3<f64> {
    match body {
        BodyFrame::Frd => Matrix3::identity(),
        BodyFrame::Flu => Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0)),
    }
}

/// Turns three columns as vectors.
fn turn(flight: &mut Flight, columns: [Column; 3], matrix: &Matrix3<f64>) {
    let [Some(a), Some(b), Some(c)] = columns.map(|column| flight.column(column)) else { return };
    let turned: Vec<Vector3<f64>> = (0..a.len()).map(|k| matrix * Vector3::new(a[k], b[k], c[k])).collect();
    put(flight, columns, |axis, k| turned[k][axis]);
}

fn put(flight: &mut Flight, columns: [Column; 3], value: impl Fn(usize, usize) -> f64) {
    for (axis, column) in columns.into_iter().enumerate() {
        let values = (0..flight.len()).map(|k| value(axis, k)).collect();
        flight.columns[column as usize] = Some(values);
    }
}

fn reorder(flight: &mut Flight, columns: [Column; 4], order: [usize; 4]) {
    let theirs = columns.map(|column| flight.columns[column as usize].take());
    for (column, number) in columns.into_iter().zip(order) {
        flight.columns[column as usize].clone_from(&theirs[number - 1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map(text: &str) -> ColumnMap {
        ColumnMap::parse(text, Path::new("columns.toml")).unwrap()
    }

    fn read(text: &str, map: &ColumnMap) -> Flight {
        Flight::parse_with(text.as_bytes(), Path::new("A.csv"), map).unwrap()
    }

    /// A craft that flies north-east and up, nose east and rolled right, told in NED and FRD and, by hand, in ENU and FLU.
    #[test]
    fn frames_are_turned_into_ours() {
        let (roll, yaw) = (0.3, std::f64::consts::FRAC_PI_2);
        let row = |t: f64, x: [f64; 3], angles: [f64; 3], rates: [f64; 3]| {
            let numbers: Vec<String> = [x, angles, rates].concat().iter().map(f64::to_string).collect();
            format!("{t},{},1,2,3,4,12,0,0,-9.81\n", numbers.join(","))
        };
        let header = "t,x,y,z,phi,theta,psi,p,q,r,cmd1,cmd2,cmd3,cmd4,vbat,ax,ay,az\n";
        let both = |x: [f64; 3], angles: [f64; 3], rates: [f64; 3]| {
            format!("{header}{}{}", row(0.0, x, angles, rates), row(0.01, x, angles, rates))
        };
        let ours = read(&both([1.0, 2.0, -3.0], [roll, 0.0, yaw], [0.1, 0.2, 0.3]), &ColumnMap::default());
        // East is the ENU's x, so a nose to the east has no yaw there; rolled right is rolled the same way about the nose.
        let theirs = both([2.0, 1.0, 3.0], [roll, 0.0, 0.0], [0.1, -0.2, -0.3]);
        let turned = read(&theirs, &map("[frames]\nworld = \"enu\"\nbody = \"flu\"\n"));
        for column in [Column::X, Column::Y, Column::Z, Column::Phi, Column::Theta, Column::Psi, Column::Q] {
            let (a, b) = (ours.required(column)[0], turned.required(column)[0]);
            assert!((a - b).abs() < 1e-12, "{column:?}: {a} and {b}");
        }
    }

    #[test]
    fn columns_are_taken_by_name_with_sign_scale_and_offset_and_motors_in_their_order() {
        let text = "stamp,n,e,d,roll,pitch,yaw,gx,gy,gz,m1,m2,m3,m4\n\
                    1000000,1,2,3,0.1,0.2,0.3,1,2,3,11,12,13,14\n1010000,1,2,3,0.1,0.2,0.3,1,2,3,11,12,13,14\n";
        let map = map(
            "[columns]\nt = { column = \"stamp\", scale = 1e-6, offset = -1.0 }\nx = \"n\"\ny = \"e\"\nz = \"d\"\n\
                       p = \"gx\"\nq = \"-gy\"\nr = \"gz\"\ncmd1 = \"m1\"\ncmd2 = \"m2\"\ncmd3 = \"m3\"\ncmd4 = \"m4\"\n\
                       [motors]\norder = [4, 1, 2, 3]\n",
        );
        let flight = read(text, &map);
        let first = |column| flight.required(column)[0];
        assert!(first(Column::T).abs() < 1e-12 && (flight.required(Column::T)[1] - 0.01).abs() < 1e-12);
        assert_eq!((first(Column::Y), first(Column::Q), first(Column::Theta)), (2.0, -2.0, 0.2));
        assert_eq!(
            [Column::Cmd1, Column::Cmd2, Column::Cmd3, Column::Cmd4].map(first),
            [14.0, 11.0, 12.0, 13.0]
        );
    }

    #[test]
    fn a_quaternion_that_turns_the_other_way_is_turned_round() {
        let text = |sign: f64| {
            let row = format!("1,2,3,0.9,{},0,0,0,0,0,1,1,1,1\n", 0.1 * sign);
            format!("t,x,y,z,qw,qx,qy,qz,p,q,r,cmd1,cmd2,cmd3,cmd4\n0,{row}0.01,{row}")
        };
        let ours = read(&text(1.0), &ColumnMap::default());
        let theirs = read(&text(-1.0), &map("[frames]\nquaternion = \"world-to-body\"\n"));
        assert!((ours.required(Column::Phi)[0] - theirs.required(Column::Phi)[0]).abs() < 1e-12);
        assert!(ours.required(Column::Phi)[0] > 0.2);
    }

    #[test]
    fn a_map_that_says_nothing_sensible_is_refused_by_field() {
        let said = |text: &str| ColumnMap::parse(text, Path::new("columns.toml")).unwrap_err().to_string();
        assert!(said("[columns]\nroll = \"a\"\n").contains("columns.roll: is no column of a flight file"));
        assert!(
            said("[columns]\nt = { column = \"a\", scale = 0 }\n").contains("columns.t: scale and offset")
        );
        assert!(
            said("[motors]\norder = [1, 2, 2, 4]\n")
                .contains("[1, 2, 2, 4] does not have each of 1, 2, 3 and 4")
        );
        assert!(said("[frames]\nworld = \"NED up\"\n").contains("line 2"));
    }
}
