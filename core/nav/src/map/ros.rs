//! The files of ROS's map_server: a YAML text that describes the map, and an image of it.
//!
//! Read as `nav2_map_server` reads them (documented keys, mode trinary, strict thresholds, the mean of
//! all channels), so that ROS and this fleet see the same floor. Rows of the image run from north to
//! south. Three keys are ours, and other programs skip them: `name`, `zones` and `places`.
//!
//! Nothing here opens a file: [`Description::image`] names the image, and whoever may open files hands
//! its bytes to [`Description::map`].

mod contents;
mod image;

pub use contents::{with_places, with_zones};

use super::{Map, MapError, Zone};
use crate::geometry::grid::GridError;
use crate::geometry::{Cell, Grid};
use serde::{Deserialize, Deserializer, Serialize};
use serde_saphyr::FlowSeq;
use thiserror::Error;
use xtb_protocol::keys::Name;
use xtb_protocol::messages::MapPlace;

/// Longest YAML text that is read, in bytes: the most zones with the most corners (200 of each) take 0.8 MiB.
pub const MAX_YAML_BYTES: usize = 1024 * 1024;
/// As ROS's map_saver writes them. 205 is unknown for every reader: (255 − 205) / 255 is just above
/// 0.196 (and below nav2's own default of 0.25, with which nav2 itself reads its unknown as free).
const FREE_THRESH: f64 = 0.196;
/// ROS's usual one.
const OCCUPIED_THRESH: f64 = 0.65;
/// Free floor in the image, as map_saver writes it.
const FREE: u8 = 254;
/// Something, as map_saver writes it.
const OCCUPIED: u8 = 0;
/// Unknown, as map_saver writes it.
const UNKNOWN: u8 = 205;

/// Why a map cannot be read from these files, or written to them.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum RosError {
    /// Not YAML, or not of a map's layout.
    #[error("the YAML: {0}")]
    Yaml(String),
    /// A key's value is not possible here.
    #[error("the YAML's {key}: {reason}")]
    Key {
        /// Which.
        key: &'static str,
        /// What is wrong with it.
        reason: String,
    },
    /// The image cannot be read.
    #[error("the image: {0}")]
    Image(String),
    /// Image and YAML make no grid.
    #[error("the image and the YAML's resolution and origin: {0}")]
    Grid(#[from] GridError),
    /// Name and zones make no map.
    #[error("the YAML's name and zones: {0}")]
    Map(#[from] MapError),
}

/// What the YAML says.
#[derive(Debug, Clone, PartialEq)]
pub struct Description {
    image: String,
    name: Option<String>,
    resolution_m: f64,
    origin_m: [f64; 2],
    thresholds: Thresholds,
    zones: Vec<Zone>,
    places: Vec<MapPlace>,
}

/// From which shade on a pixel is what.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Thresholds {
    negate: bool,
    free: f64,
    occupied: f64,
}

impl Thresholds {
    /// What a pixel of this brightness, 0 to 1, means.
    fn cell(self, shade: f64) -> Cell {
        let occupancy = if self.negate { shade } else { 1.0 - shade };
        if occupancy > self.occupied {
            Cell::Occupied
        } else if occupancy < self.free {
            Cell::Free
        } else {
            Cell::Unknown
        }
    }
}

#[derive(Deserialize)]
struct Layout {
    image: String,
    resolution: f64,
    origin: Vec<f64>,
    #[serde(deserialize_with = "number_or_bool")]
    negate: bool,
    occupied_thresh: f64,
    free_thresh: f64,
    mode: Option<String>,
    name: Option<String>,
    #[serde(default)]
    zones: Vec<Zone>,
    #[serde(default)]
    places: Vec<MapPlace>,
}

/// map_server takes both.
fn number_or_bool<'de, D: Deserializer<'de>>(deserializer: D) -> Result<bool, D::Error> {
    let text = String::deserialize(deserializer)?;
    match text.as_str() {
        "0" | "false" | "False" => Ok(false),
        "1" | "true" | "True" => Ok(true),
        _ => Err(serde::de::Error::custom(format!("negate is {text:?}; it is 0 or 1"))),
    }
}

impl Description {
    /// Reads the YAML.
    ///
    /// # Errors
    /// [`RosError::Yaml`] or [`RosError::Key`].
    pub fn from_yaml(text: &str) -> Result<Self, RosError> {
        if text.len() > MAX_YAML_BYTES {
            return Err(RosError::Yaml(format!("{} bytes, the limit is {MAX_YAML_BYTES}", text.len())));
        }
        let options = serde_saphyr::options! { with_snippet: false };
        let layout: Layout = serde_saphyr::from_str_with_options(text, options)
            .map_err(|error| RosError::Yaml(error.to_string().chars().take(400).collect()))?;
        let key = |key, reason: String| Err(RosError::Key { key, reason });
        match layout.mode.as_deref() {
            None | Some("trinary") => {}
            Some(mode @ ("scale" | "raw")) => {
                let reason =
                    format!("{mode:?} has values between free and occupied; only \"trinary\" is supported");
                return key("mode", reason);
            }
            Some(mode) => {
                let mode: String = mode.chars().take(40).collect();
                return key("mode", format!("{mode:?} is none of trinary, scale and raw"));
            }
        }
        let [x_m, y_m, yaw_rad] = layout.origin[..] else {
            return key("origin", format!("{} numbers, [x, y, yaw] are needed", layout.origin.len()));
        };
        if yaw_rad != 0.0 {
            let reason =
                format!("a yaw of {yaw_rad} rad: rotated maps are not supported; rotate the image and set 0");
            return key("origin", reason);
        }
        let (free, occupied) = (layout.free_thresh, layout.occupied_thresh);
        if !(0.0 <= free && free < occupied && occupied <= 1.0) {
            let reason = format!("{free} and occupied_thresh {occupied} must rise within 0 to 1");
            return key("free_thresh", reason);
        }
        Ok(Self {
            image: layout.image,
            name: layout.name,
            resolution_m: layout.resolution,
            origin_m: [x_m, y_m],
            thresholds: Thresholds { negate: layout.negate, free, occupied },
            zones: layout.zones,
            places: layout.places,
        })
    }

    /// The path of the image, as the YAML has it: relative to the YAML's own folder, or absolute.
    #[must_use]
    pub fn image(&self) -> &str {
        &self.image
    }

    /// How many cells map_saver has written as unknown that this YAML's `free_thresh` makes free: above 0.196 it does,
    /// as nav2's own default of 0.25.
    ///
    /// # Errors
    /// [`RosError::Image`].
    pub fn unknown_as_free(&self, image: &[u8]) -> Result<usize, RosError> {
        match self.thresholds.cell(f64::from(UNKNOWN) / 255.0) {
            Cell::Free => image::count(image, UNKNOWN),
            Cell::Occupied | Cell::Unknown => Ok(0),
        }
    }

    /// `free_thresh`.
    #[must_use]
    pub fn free_thresh(&self) -> f64 {
        self.thresholds.free
    }

    /// Its zones.
    #[must_use]
    pub fn zones(&self) -> &[Zone] {
        &self.zones
    }

    /// Its places.
    #[must_use]
    pub fn places(&self) -> &[MapPlace] {
        &self.places
    }

    /// The map, from the bytes of the image: PNG, or PGM and its relatives. `name` is for a YAML that
    /// has none, such as every one that ROS wrote.
    ///
    /// # Errors
    /// See [`RosError`].
    pub fn map(self, name: &str, image: &[u8]) -> Result<Map, RosError> {
        let (width, height, cells) = image::cells(image, self.thresholds)?;
        let grid = Grid::new(self.resolution_m, self.origin_m, width, height, cells)?;
        Ok(Map::new(self.name.as_deref().unwrap_or(name), grid, self.zones)?.with_places(self.places)?)
    }
}

#[derive(Serialize)]
struct Written<'a> {
    image: &'a str,
    mode: &'a str,
    resolution: f64,
    origin: FlowSeq<[f64; 3]>,
    negate: u8,
    occupied_thresh: f64,
    free_thresh: f64,
    name: &'a str,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    zones: Vec<WrittenZone<'a>>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    places: Vec<WrittenPlace<'a>>,
}

#[derive(Serialize)]
struct WrittenZone<'a> {
    name: &'a str,
    kind: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    heading_rad: Option<f64>,
    points: FlowSeq<&'a [[f64; 2]]>,
}

#[derive(Serialize)]
struct WrittenPlace<'a> {
    name: &'a str,
    kind: &'a str,
    x_m: f64,
    y_m: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    yaw_rad: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tags: Option<FlowSeq<Vec<&'a str>>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    points: Option<FlowSeq<&'a [[f64; 2]]>>,
}

impl<'a> From<&'a Zone> for WrittenZone<'a> {
    fn from(zone: &'a Zone) -> Self {
        let (kind, heading_rad) = match zone.kind() {
            super::ZoneKind::KeepOut => ("keep_out", None),
            super::ZoneKind::OneWay { heading_rad } => ("one_way", Some(heading_rad)),
        };
        Self { name: zone.name(), kind, heading_rad, points: FlowSeq(zone.points()) }
    }
}

impl<'a> From<&'a MapPlace> for WrittenPlace<'a> {
    fn from(place: &'a MapPlace) -> Self {
        Self {
            name: place.name.as_str(),
            kind: place.kind.as_str(),
            x_m: place.x_m,
            y_m: place.y_m,
            yaw_rad: place.yaw_rad,
            tags: (!place.tags.is_empty()).then(|| FlowSeq(place.tags.iter().map(Name::as_str).collect())),
            points: (!place.points.is_empty()).then_some(FlowSeq(place.points.as_slice())),
        }
    }
}

/// A map as files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// The text that describes it.
    pub yaml: String,
    /// The image, a binary PGM.
    pub image: Vec<u8>,
}

impl Files {
    /// A map as files; `image` is the path of the image as the YAML shall have it. Read again, they are
    /// the same map.
    ///
    /// # Errors
    /// [`RosError::Yaml`] or [`RosError::Image`], if the libraries that write them refuse.
    pub fn of(map: &Map, image: &str) -> Result<Self, RosError> {
        let [x_m, y_m] = map.grid().origin_m();
        let written = Written {
            image,
            mode: "trinary",
            resolution: map.grid().resolution_m(),
            origin: FlowSeq([x_m, y_m, 0.0]),
            negate: 0,
            occupied_thresh: OCCUPIED_THRESH,
            free_thresh: FREE_THRESH,
            name: map.name(),
            zones: map.zones().iter().map(WrittenZone::from).collect(),
            places: map.places().iter().map(WrittenPlace::from).collect(),
        };
        let yaml = serde_saphyr::to_string(&written).map_err(|error| RosError::Yaml(error.to_string()))?;
        Ok(Self { yaml, image: image::pgm(map.grid()) })
    }
}
