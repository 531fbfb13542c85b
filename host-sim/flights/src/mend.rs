//! What undoes wrong axes, signs, units and orders of a flight, as its map of columns can say it.

use std::collections::BTreeMap;

use model::{BodyFrame, WorldFrame};

use crate::column_map::{ColumnMap, Source};
use crate::columns::{COLUMNS, Column};

/// What undoes a fault of a flight, in terms of the flight as it is read now.
#[derive(Debug, Clone, PartialEq)]
pub enum Mend {
    /// Columns that are others, scaled.
    Columns(Vec<MendedColumn>),
    /// Frames that the whole log is in.
    Frames(WorldFrame, BodyFrame),
    /// Numbers of the motors front-left, front-right, rear-right, rear-left.
    MotorOrder([usize; 4]),
}

/// A column that is scale * another + offset.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MendedColumn {
    /// The column.
    pub own: Column,
    /// What it is made of.
    pub from: Column,
    /// What that is multiplied by.
    pub scale: f64,
    /// What is added then.
    pub offset: f64,
}

impl MendedColumn {
    /// A column with a sign of another.
    pub const fn new(own: Column, from: Column, scale: f64, offset: f64) -> Self {
        Self { own, from, scale, offset }
    }
}

impl Mend {
    /// Columns that are others with signs: for each of `columns` which of them it is.
    pub fn axes(columns: [Column; 3], from: [usize; 3], sign: [f64; 3]) -> Self {
        let changed = (0..3).filter(|&i| from[i] != i || sign[i] != 1.0);
        Self::Columns(
            changed.map(|i| MendedColumn::new(columns[i], columns[from[i]], sign[i], 0.0)).collect(),
        )
    }

    /// Columns in another unit.
    pub fn scaled(columns: &[Column], scale: f64) -> Self {
        Self::Columns(columns.iter().map(|c| MendedColumn::new(*c, *c, scale, 0.0)).collect())
    }
}

/// Why a map cannot say a mend: the part of a sentence behind the file's name.
pub type CannotMend = String;

impl ColumnMap {
    /// The map that mends a flight as well. `sources` are those of the flight's columns under this map; columns that the flight
    /// does not have are left alone unless there is no other.
    pub fn mended(&self, mend: &Mend, sources: &BTreeMap<String, Source>) -> Result<Self, CannotMend> {
        let mut map = self.clone();
        match mend {
            Mend::Columns(columns) => {
                if !self.frames.are_ours() {
                    return Err("says something else already (under [frames])".into());
                }
                let mut found = 0;
                for column in columns {
                    let (own, from) = (COLUMNS[column.own as usize], COLUMNS[column.from as usize]);
                    let Some(source) = sources.get(from) else { continue };
                    if self.sources.contains_key(own) {
                        return Err(format!("says something else about {own} already (under [columns])"));
                    }
                    let scale = column.scale * source.scale;
                    let offset = column.scale * source.offset + column.offset;
                    map.sources.insert(own.into(), Source { name: source.name.clone(), scale, offset });
                    found += 1;
                }
                if found == 0 {
                    return Err(format!(
                        "cannot say it: the flight has no column {}",
                        columns.first().map_or("", |column| COLUMNS[column.from as usize])
                    ));
                }
            }
            Mend::Frames(..) if !self.frames.are_ours() => {
                return Err("says something else already (under [frames])".into());
            }
            Mend::Frames(world, body) => (map.frames.world, map.frames.body) = (*world, *body),
            Mend::MotorOrder(_) if self.motor_order.is_some() => {
                return Err("says something else already (the motors' order)".into());
            }
            Mend::MotorOrder(order) => map.motor_order = Some(*order),
        }
        Ok(map)
    }

    /// The lines that this map has beyond another one: `[columns] q = "-q"`.
    pub fn lines_beyond(&self, old: &Self) -> Vec<String> {
        let new = self.sources.iter().filter(|(own, source)| old.sources.get(*own) != Some(source));
        let mut lines: Vec<String> =
            new.map(|(own, source)| format!("[columns] {own} = {}", value_of(source))).collect();
        if self.frames != old.frames {
            let [world, body] = frame_names(self);
            lines.push(format!("[frames] world = \"{world}\", body = \"{body}\""));
        }
        if let (Some(order), true) = (self.motor_order, self.motor_order != old.motor_order) {
            lines.push(format!("[motors] order = {order:?}"));
        }
        lines
    }

    /// The text of `columns.toml` with this map: that of `old`, its comments and all, with what it does not say yet.
    pub fn written_into(&self, old: &str) -> Option<String> {
        let mut document: toml_edit::DocumentMut = old.parse().ok()?;
        let before = Self::parse(old, std::path::Path::new("")).ok()?;
        for (own, source) in &self.sources {
            if before.sources.get(own) != Some(source) {
                table(&mut document, "columns")?.insert(own, toml_edit::Item::Value(value_of(source)));
            }
        }
        if self.frames != before.frames {
            let [world, body] = frame_names(self);
            let frames = table(&mut document, "frames")?;
            frames.insert("world", toml_edit::value(world));
            frames.insert("body", toml_edit::value(body));
            if self.frames.quaternion == model::QuaternionTurn::WorldToBody {
                frames.insert("quaternion", toml_edit::value("world-to-body"));
            }
        }
        if let (Some(order), true) = (self.motor_order, self.motor_order != before.motor_order) {
            let order: toml_edit::Array = order.iter().map(|number| *number as i64).collect();
            table(&mut document, "motors")?.insert("order", toml_edit::value(order));
        }
        let text = document.to_string();
        let again = Self::parse(&text, std::path::Path::new("")).ok()?;
        let says_it = again.sources == self.sources
            && again.frames == self.frames
            && again.motor_order == self.motor_order;
        says_it.then_some(text)
    }
}

fn table<'a>(
    document: &'a mut toml_edit::DocumentMut,
    name: &str,
) -> Option<&'a mut dyn toml_edit::TableLike> {
    document.entry(name).or_insert_with(toml_edit::table).as_table_like_mut()
}

fn frame_names(map: &ColumnMap) -> [&'static str; 2] {
    let world = match map.frames.world {
        WorldFrame::Ned => "ned",
        WorldFrame::Enu => "enu",
        WorldFrame::Nwu => "nwu",
    };
    let body = match map.frames.body {
        BodyFrame::Frd => "frd",
        BodyFrame::Flu => "flu",
    };
    [world, body]
}

/// A source as it is written.
fn value_of(source: &Source) -> toml_edit::Value {
    let Source { name, scale, offset } = source;
    if *offset == 0.0 && scale.abs() == 1.0 {
        let sign = if *scale < 0.0 { "-" } else { "" };
        return format!("{sign}{name}").into();
    }
    let mut table = toml_edit::InlineTable::new();
    table.insert("column", name.as_str().into());
    table.insert("scale", (*scale).into());
    if *offset != 0.0 {
        table.insert("offset", (*offset).into());
    }
    table.into()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    fn map(text: &str) -> ColumnMap {
        ColumnMap::parse(text, Path::new("columns.toml")).unwrap()
    }

    fn sources(map: &ColumnMap, header: &str) -> BTreeMap<String, Source> {
        let names: Vec<String> = header.split(',').map(str::to_owned).collect();
        map.sources_in(&names, Path::new("A.csv")).unwrap()
    }

    const Q: Mend = Mend::Columns(Vec::new());

    #[test]
    fn a_mend_is_written_in_the_names_and_units_of_the_file_and_comments_stay() {
        let old = "# mine\n[columns]   # of the lab\nx = \"n\"\n";
        let before = map(old);
        let found = sources(&before, "t,n,y,z,roll rate [deg/s],Pitch Rate [deg/s],r");
        let wrong = Mend::axes([Column::P, Column::Q, Column::R], [1, 0, 2], [1.0, -1.0, 1.0]);
        let after = before.mended(&wrong, &found).unwrap();
        let text = after.written_into(old).unwrap();
        assert!(text.starts_with("# mine\n[columns]   # of the lab\nx = \"n\"\n"), "{text}");
        let read = map(&text);
        assert_eq!(read.sources["p"].name, "Pitch Rate [deg/s]");
        assert_eq!(read.sources["q"].name, "roll rate [deg/s]");
        assert!((read.sources["q"].scale + 1.0_f64.to_radians()).abs() < 1e-15);
        assert_eq!(after.lines_beyond(&before).len(), 2);
    }

    #[test]
    fn what_a_map_says_already_is_not_overruled() {
        let turned = Mend::axes([Column::P, Column::Q, Column::R], [0, 1, 2], [1.0, -1.0, 1.0]);
        let said = |text: &str, mend: &Mend| {
            let map = map(text);
            map.mended(mend, &sources(&map, "t,p,q,r,gy")).unwrap_err()
        };
        assert!(said("[columns]\nq = \"gy\"\n", &turned).contains("something else about q"));
        assert!(said("[frames]\nbody = \"flu\"\n", &turned).contains("under [frames]"));
        let order = Mend::MotorOrder([4, 1, 2, 3]);
        assert!(said("[motors]\norder = [1, 2, 3, 4]\n", &order).contains("motors' order"));
        assert!(said("", &Q).contains("cannot say it"));
    }

    #[test]
    fn frames_and_orders_are_written_where_there_was_no_file() {
        let frames = Mend::Frames(WorldFrame::Enu, BodyFrame::Flu);
        let found = BTreeMap::new();
        let both = ColumnMap::default().mended(&frames, &found).unwrap();
        let both = both.mended(&Mend::MotorOrder([4, 1, 2, 3]), &found).unwrap();
        let read = map(&both.written_into("").unwrap());
        assert_eq!((read.frames, read.motor_order), (both.frames, Some([4, 1, 2, 3])));
    }
}
