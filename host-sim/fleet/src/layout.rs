//! Which craft there are in a folder, and which files are theirs.
//!
//! A craft is a folder directly in the fleet's that holds a vehicle file, or the fleet's folder itself if it holds one. All flight
//! files and logs below a craft's folder are its flights. Names that begin with a dot are not looked at.

use std::path::{Path, PathBuf};

use diagnosis::workflow::Reading;
use flights::ColumnMap;
use model::{Model, Vehicle};

use crate::error::FleetError;
use crate::settings::{SETTINGS, Settings};

/// Name of a vehicle file.
const VEHICLE: &str = "vehicle.toml";
/// Name of a model file in a craft's folder that is taken for its reference.
const MODEL: &str = "model.toml";

/// How flights are taken: a fault is kept with the flight and ends nothing.
pub(crate) const READING: Reading = Reading { accept_faults: true, window_s: None, whole: false };

/// Ending of the folder beside an index in which a pass leaves its parts.
pub(crate) const PARTS: &str = "parts";

/// A craft and its files.
pub struct Craft {
    /// Name of its folder.
    pub name: String,
    /// The folder.
    pub(crate) folder: PathBuf,
    /// Its vehicle file's content.
    pub vehicle: Vehicle,
    /// The bytes of it: what was made of a flight depends on them.
    pub(crate) vehicle_bytes: Vec<u8>,
    /// A model file beside the vehicle file.
    pub(crate) model: Option<(PathBuf, Model)>,
    /// Flights and logs below its folder, in the order of their names.
    pub(crate) files: Vec<PathBuf>,
}

/// A folder with its craft.
pub struct Fleet {
    /// The folder.
    pub folder: PathBuf,
    /// Its craft in the order of their names.
    pub crafts: Vec<Craft>,
    /// What the user says of the flights.
    pub(crate) settings: Settings,
    /// Folders with flights whose craft nobody has described.
    pub unclaimed: Vec<String>,
}

impl Fleet {
    /// Looks through a folder; the index is no log.
    pub fn find(folder: &Path, index: &Path) -> Result<Self, FleetError> {
        let settings = Settings::read(&folder.join(SETTINGS))?;
        let name = |folder: &Path| folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let mut fleet = Self { folder: folder.into(), crafts: Vec::new(), settings, unclaimed: Vec::new() };
        if folder.join(VEHICLE).is_file() {
            let canonical = folder.canonicalize().unwrap_or_else(|_| folder.into());
            fleet.crafts.push(Craft::read(folder, name(&canonical), index)?);
            return Ok(fleet);
        }
        for path in entries(folder)? {
            if !path.is_dir() {
                continue;
            }
            if path.join(VEHICLE).is_file() {
                fleet.crafts.push(Craft::read(&path, name(&path), index)?);
            } else if !files_below(&path, index)?.is_empty() {
                fleet.unclaimed.push(name(&path));
            }
        }
        if fleet.crafts.is_empty() {
            return Err(FleetError::NoCraft { folder: folder.into(), unclaimed: fleet.unclaimed });
        }
        Ok(fleet)
    }

    /// What the settings say of flights that are neither in the folder nor among those that are kept, one sentence each.
    pub(crate) fn unmatched(&self, kept: impl Iterator<Item = String>) -> Vec<String> {
        let in_folder = self.crafts.iter().flat_map(|craft| &craft.files).map(|path| self.relative(path));
        let mut files: Vec<String> = in_folder.collect();
        files.extend(kept);
        self.settings.unmatched(&files)
    }

    /// A file's path in the fleet's folder, with slashes.
    pub(crate) fn relative(&self, path: &Path) -> String {
        let own = path.strip_prefix(&self.folder).unwrap_or(path);
        let parts: Vec<String> = own.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        parts.join("/")
    }
}

impl Craft {
    fn read(folder: &Path, name: String, index: &Path) -> Result<Self, FleetError> {
        let path = folder.join(VEHICLE);
        let vehicle_bytes =
            std::fs::read(&path).map_err(|why| FleetError::Read { path: path.clone(), why })?;
        let vehicle = Vehicle::read(&path).map_err(|why| FleetError::of_file(&path, &why))?;
        ColumnMap::of_vehicle(&vehicle, &path).map_err(|why| FleetError::of_file(&path, &why))?;
        let path = folder.join(MODEL);
        let model = match path.is_file() {
            true => Some((path.clone(), Model::read(&path).map_err(|why| FleetError::of_file(&path, &why))?)),
            false => None,
        };
        Ok(Self {
            name,
            folder: folder.into(),
            vehicle,
            vehicle_bytes,
            model,
            files: files_below(folder, index)?,
        })
    }
}

/// What lies in a folder, in the order of the names, without what is hidden.
fn entries(folder: &Path) -> Result<Vec<PathBuf>, FleetError> {
    let refused = |why| FleetError::Read { path: folder.into(), why };
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(refused)? {
        let path = entry.map_err(refused)?.path();
        let name = path.file_name().unwrap_or_default();
        if !name.to_string_lossy().starts_with('.') {
            all.push(path);
        }
    }
    all.sort();
    Ok(all)
}

/// Flight files and logs below a folder. Links to folders are not followed, so that none is gone round in.
fn files_below(folder: &Path, index: &Path) -> Result<Vec<PathBuf>, FleetError> {
    let mut files = Vec::new();
    for path in entries(folder)? {
        if path.is_dir() {
            let is_ours = path == index.with_extension(PARTS);
            if !path.is_symlink() && !is_ours {
                files.extend(files_below(&path, index)?);
            }
        } else if path != index && (is_flight_file(&path) || logs::format_of(&path).is_some()) {
            files.push(path);
        }
    }
    Ok(files)
}

/// Whether a file is a flight file by its name.
fn is_flight_file(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const ANY: &str = "t,x\n0,1\n";

    fn vehicle(folder: &Path) {
        std::fs::create_dir_all(folder).unwrap();
        std::fs::write(folder.join(VEHICLE), toml::to_string(&Vehicle::thesis()).unwrap()).unwrap();
    }

    #[test]
    fn each_folder_with_a_vehicle_file_is_a_craft_with_all_flights_below_it() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        for craft in ["b", "a"] {
            vehicle(&root.join(craft));
        }
        std::fs::create_dir_all(root.join("a/2026/battery-1")).unwrap();
        std::fs::create_dir_all(root.join("a/.hidden")).unwrap();
        std::fs::create_dir_all(root.join("nobody")).unwrap();
        for file in ["a/2.csv", "a/2026/battery-1/1.CSV", "a/.hidden/3.csv", "a/notes.txt", "nobody/4.csv"] {
            std::fs::write(root.join(file), ANY).unwrap();
        }
        let fleet = Fleet::find(root, Path::new("none")).unwrap();
        assert_eq!(fleet.crafts.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["a", "b"]);
        let files: Vec<String> = fleet.crafts[0].files.iter().map(|path| fleet.relative(path)).collect();
        assert_eq!(files, ["a/2.csv", "a/2026/battery-1/1.CSV"]);
        assert_eq!(fleet.unclaimed, ["nobody"]);
    }

    #[test]
    fn a_folder_with_a_vehicle_file_is_itself_the_craft() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path().join("lone");
        vehicle(&root);
        std::fs::write(root.join("1.csv"), ANY).unwrap();
        let fleet = Fleet::find(&root, &root.join("index.parquet")).unwrap();
        assert_eq!((fleet.crafts[0].name.as_str(), fleet.crafts[0].files.len()), ("lone", 1));
    }

    #[test]
    fn a_folder_without_craft_says_how_to_lay_it_out() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(folder.path().join("mine")).unwrap();
        std::fs::write(folder.path().join("mine/1.csv"), ANY).unwrap();
        let said = Fleet::find(folder.path(), Path::new("none")).err().unwrap().to_string();
        assert!(
            said.contains("no craft here") && said.contains("mine has flights and no vehicle.toml"),
            "{said}"
        );
    }
}
