//! Zones: polygons on the floor with a rule, as files write them and as planners ask for them.

use super::{canonical, polygon};
use serde::{Deserialize, Serialize};
use thiserror::Error;
use xtb_protocol::messages::{MAX_COORDINATE_M, MAX_ZONE_POINTS, is_map_name};

/// Largest |heading| in a file, in rad: a little more than a turn, as for every angle on the wire.
const MOST_RAD: f64 = 7.0;

/// What holds inside a zone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ZoneKind {
    /// No part of a robot may be inside (geofence).
    KeepOut,
    /// To be driven through within 90° of this heading only.
    OneWay {
        /// Counter-clockwise from +x.
        heading_rad: f64,
    },
}

/// Why a zone cannot be.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ZoneError {
    /// See [`is_map_name`].
    #[error("{0:?} cannot be a zone's name: 1 to 64 characters, no blank at either end")]
    Name(String),
    /// Too few corners or too many.
    #[error("zone {name:?}: {points} points; a zone has 3 to {MAX_ZONE_POINTS}")]
    Points {
        /// Which zone.
        name: String,
        /// How many it has.
        points: usize,
    },
    /// A corner is not finite or too far away.
    #[error("zone {name:?}: point {point} at ({x_m}, {y_m}) m is outside ± 1000 m")]
    Far {
        /// Which zone.
        name: String,
        /// Which corner, counted from 1.
        point: usize,
        /// East, in m.
        x_m: f64,
        /// North, in m.
        y_m: f64,
    },
    /// The outline crosses or touches itself.
    #[error(
        "zone {name:?}: the side from point {first} and the side from point {second} cross or touch; \
         list the corners in order, each once"
    )]
    Crossing {
        /// Which zone.
        name: String,
        /// One side's first corner, counted from 1.
        first: usize,
        /// The other's.
        second: usize,
    },
    /// A heading is missing, wrong, or has no meaning here.
    #[error("zone {name:?}: {reason}")]
    Heading {
        /// Which zone.
        name: String,
        /// What is wrong with it.
        reason: &'static str,
    },
}

/// A simple polygon on the floor, and its rule.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(try_from = "Layout", into = "Layout")]
pub struct Zone {
    name: String,
    kind: ZoneKind,
    points: Vec<[f64; 2]>,
}

/// A zone as world files and map files have it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
struct Layout {
    name: String,
    kind: KindName,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    heading_rad: Option<f64>,
    points: Vec<[f64; 2]>,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
enum KindName {
    KeepOut,
    OneWay,
}

impl Zone {
    /// A zone with these corners, in order; the last one is joined to the first.
    ///
    /// # Errors
    /// See [`ZoneError`].
    pub fn new(name: &str, kind: ZoneKind, points: Vec<[f64; 2]>) -> Result<Self, ZoneError> {
        if !is_map_name(name) {
            return Err(ZoneError::Name(name.chars().take(100).collect()));
        }
        let name = name.to_owned();
        if !(3..=MAX_ZONE_POINTS).contains(&points.len()) {
            return Err(ZoneError::Points { name, points: points.len() });
        }
        let near = |point: &[f64; 2]| point.iter().all(|v| v.abs() <= MAX_COORDINATE_M);
        if let Some(i) = points.iter().position(|point| !near(point)) {
            return Err(ZoneError::Far { name, point: i + 1, x_m: points[i][0], y_m: points[i][1] });
        }
        if let Some((first, second)) = polygon::crossing(&points) {
            return Err(ZoneError::Crossing { name, first: first + 1, second: second + 1 });
        }
        if let ZoneKind::OneWay { heading_rad } = kind
            && (heading_rad.is_nan() || heading_rad.abs() > MOST_RAD)
        {
            return Err(ZoneError::Heading { name, reason: "heading_rad is outside -7 to 7" });
        }
        Ok(Self { name, kind, points })
    }

    /// As people call it; no two zones of a map have the same.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its rule.
    #[must_use]
    pub fn kind(&self) -> ZoneKind {
        self.kind
    }

    /// Its corners in order, (x, y) in m.
    #[must_use]
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }

    /// Whether a point, in m, is inside or on the border.
    #[must_use]
    pub fn holds(&self, x_m: f64, y_m: f64) -> bool {
        polygon::holds(&self.points, [x_m, y_m])
    }

    /// Whether another polygon, such as [`Car::corners`](crate::geometry::Car::corners), touches it.
    #[must_use]
    pub fn touches(&self, corners: &[[f64; 2]]) -> bool {
        polygon::touch(&self.points, corners)
    }

    /// Whether it may be driven through on this course (the direction of motion, counter-clockwise from
    /// +x); of a keep-out that is not the question.
    #[must_use]
    pub fn allows(&self, course_rad: f64) -> bool {
        match self.kind {
            ZoneKind::KeepOut => true,
            ZoneKind::OneWay { heading_rad } => libm::cos(course_rad - heading_rad) >= 0.0,
        }
    }

    /// Its canonical bytes, for the map's hash.
    pub(super) fn feed(&self, each: &mut dyn FnMut(&[u8])) {
        each(&(self.name.len() as u64).to_le_bytes());
        each(self.name.as_bytes());
        match self.kind {
            ZoneKind::KeepOut => each(&[0]),
            ZoneKind::OneWay { heading_rad } => {
                each(&[1]);
                each(&canonical(heading_rad));
            }
        }
        each(&(self.points.len() as u64).to_le_bytes());
        self.points.iter().flatten().for_each(|along| each(&canonical(*along)));
    }
}

impl TryFrom<Layout> for Zone {
    type Error = ZoneError;

    fn try_from(Layout { name, kind, heading_rad, points }: Layout) -> Result<Self, ZoneError> {
        let heading = |reason| Err(ZoneError::Heading { name: name.chars().take(100).collect(), reason });
        let kind = match (kind, heading_rad) {
            (KindName::KeepOut, None) => ZoneKind::KeepOut,
            (KindName::OneWay, Some(heading_rad)) => ZoneKind::OneWay { heading_rad },
            (KindName::KeepOut, Some(_)) => return heading("a keep_out has no heading_rad"),
            (KindName::OneWay, None) => return heading("a one_way needs heading_rad"),
        };
        Self::new(&name, kind, points)
    }
}

impl From<Zone> for Layout {
    fn from(Zone { name, kind, points }: Zone) -> Self {
        let (kind, heading_rad) = match kind {
            ZoneKind::KeepOut => (KindName::KeepOut, None),
            ZoneKind::OneWay { heading_rad } => (KindName::OneWay, Some(heading_rad)),
        };
        Self { name, kind, heading_rad, points }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]];

    fn refused(kind: ZoneKind, points: &[[f64; 2]]) -> String {
        Zone::new("z", kind, points.to_vec()).unwrap_err().to_string()
    }

    #[test]
    fn impossible_zones_are_refused_with_the_reason() {
        let keep_out = ZoneKind::KeepOut;
        assert_eq!(refused(keep_out, &SQUARE[..2]), "zone \"z\": 2 points; a zone has 3 to 200");
        let bow = [SQUARE[0], SQUARE[2], SQUARE[1], SQUARE[3]];
        assert!(refused(keep_out, &bow).contains("from point 1 and the side from point 3"));
        let closed = [SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[3], SQUARE[0]];
        assert!(refused(keep_out, &closed).contains("each once"));
        let far = [[0.0, 0.0], [2.0, 0.0], [2.0, f64::INFINITY]];
        assert!(refused(keep_out, &far).starts_with("zone \"z\": point 3"));
        let line = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        assert!(refused(keep_out, &line).contains("cross or touch"));
        let heading_rad = f64::NAN;
        assert!(refused(ZoneKind::OneWay { heading_rad }, &SQUARE).contains("heading_rad"));
        for name in ["", " a", "a\n", &"x".repeat(65)] {
            assert!(
                matches!(Zone::new(name, keep_out, SQUARE.to_vec()), Err(ZoneError::Name(_))),
                "{name:?}"
            );
        }
    }

    #[test]
    fn a_one_way_is_driven_within_90_deg_of_its_heading() {
        let zone = Zone::new("lane", ZoneKind::OneWay { heading_rad: 3.0 }, SQUARE.to_vec()).unwrap();
        assert!(zone.allows(3.0) && zone.allows(-2.0) && zone.allows(1.6));
        assert!(!zone.allows(0.0) && !zone.allows(1.3));
    }
}
