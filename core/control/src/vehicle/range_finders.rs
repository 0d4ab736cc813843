//! The range finders of both bumpers as they are fitted: place, direction, width of the beam, and part.
//!
//! Obstacle rule, admitted speed, obstacle layer and blind rule follow from these; an XTB's are the default. The
//! converter has eight channels a bumper; its usual frame holds six of them, and a car with more asks its board for the
//! wide one (docs/io-board.md). In a direction without any the car does not drive by itself ([`Gears`](super::Gears)).
//!
//! ```text
//!              ╲  beam, turned_deg > 0          face of the bumper, ahead_m = 0
//!      ─────────●──────┬──────●─────────────    left_m > 0 to the left, seen from above with the car pointing up
//!                      │ ahead_m < 0: set back, so that the zone too near to measure lies on the car
//! ```

use super::{Infrared, Obstacle, RangeFinders};
use crate::config::{Allowed, Value};
use crate::range_curve::RangeCurve;
use serde::{Deserialize, Serialize};

/// Channels of the converter for each bumper.
pub const SLOTS: usize = 8;
/// Those of them that the board's usual frame holds, the leftmost ones.
pub const USUAL_SLOTS: usize = 6;

/// One range finder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RangeFinder {
    /// From the middle of the bumper to the left, in m (−1.5..=1.5).
    pub left_m: f64,
    /// From the face of the bumper outwards, in m (−0.3..=0); below 0 it is set back.
    #[serde(default)]
    pub ahead_m: f64,
    /// Its direction against straight ahead (of the rear bumper: straight back), + = to the car's left, in degrees
    /// (−60..=60).
    #[serde(default)]
    pub turned_deg: f64,
    /// Width of its beam at 80 cm, in m (0.01..=0.3).
    #[serde(default = "RangeFinder::usual_beam_m")]
    pub beam_m: f64,
    /// The part, which says what a voltage means.
    #[serde(default)]
    pub curve: RangeCurve,
}

impl RangeFinder {
    /// A GP2D12 that looks straight ahead from the face of the bumper.
    #[must_use]
    pub fn at(left_m: f64) -> Self {
        let (beam_m, curve) = (Self::usual_beam_m(), RangeCurve::default());
        Self { left_m, ahead_m: 0.0, turned_deg: 0.0, beam_m, curve }
    }

    /// As sellers of the GP2D12 quote it.
    fn usual_beam_m() -> f64 {
        0.06
    }

    /// How far ahead of the bumper's face lies what is so far along the beam, in cm; negative = on the car.
    #[must_use]
    pub fn from_face_cm(&self, range_cm: f64) -> f64 {
        range_cm * libm::cos(self.turned_deg.to_radians()) + self.ahead_m * 100.0
    }

    /// What of the way to an obstacle is left for stopping, in cm: from where the rule sees it first to where
    /// readings are wrong. `cos` is that of the bumper's tilt.
    pub(super) fn room_cm(&self, infrared: &Infrared, obstacle: &Obstacle, cos: f64) -> f64 {
        let sight_cm = self.from_face_cm(self.curve.sight_cm(infrared) * cos);
        obstacle.threshold_cm.min(sight_cm) - self.from_face_cm(self.curve.near_cm(infrared))
    }

    fn is_possible(&self) -> bool {
        (-1.5..=1.5).contains(&self.left_m)
            && (-0.3..=0.0).contains(&self.ahead_m)
            && (-60.0..=60.0).contains(&self.turned_deg)
            && (0.01..=0.3).contains(&self.beam_m)
    }

    /// As an inline table; what is usual is left out.
    fn to_toml(self) -> String {
        let usual = Self::at(self.left_m);
        let mut text = format!("{{ left_m = {:?}", self.left_m);
        for (name, value, default) in [
            ("ahead_m", self.ahead_m, usual.ahead_m),
            ("turned_deg", self.turned_deg, usual.turned_deg),
            ("beam_m", self.beam_m, usual.beam_m),
        ] {
            if value != default {
                text.push_str(&format!(", {name} = {value:?}"));
            }
        }
        if self.curve != usual.curve {
            text.push_str(&format!(", curve = \"{}\"", self.curve.word()));
        }
        text + " }"
    }
}

/// Those of one bumper, from left to right seen from above with the car pointing up: at most [`SLOTS`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct BumperFinders(pub Vec<RangeFinder>);

impl BumperFinders {
    /// What a table of them allows.
    pub const ALLOWED: Allowed = Allowed::List(
        "none to 8 from left to right, each with left_m -1.5..=1.5 m, ahead_m -0.3..=0 m (0), turned_deg -60..=60 (0), \
         beam_m 0.01..=0.3 m at 80 cm (0.06), curve gp2d12, gp2y0a21 or gp2y0a02 (gp2d12)",
    );

    /// The one on this channel, 0..[`SLOTS`], if one is fitted there.
    #[must_use]
    pub fn get(&self, slot: usize) -> Option<&RangeFinder> {
        self.0.get(slot).filter(|_| slot < SLOTS)
    }
}

impl RangeFinders {
    /// Whether a bumper has more than [`USUAL_SLOTS`], so that only a wide scan of the board holds them all.
    #[must_use]
    pub fn need_wide_scan(&self) -> bool {
        self.front.0.len().max(self.rear.0.len()) > USUAL_SLOTS
    }
}

impl Default for BumperFinders {
    /// An XTB's: six, 7 cm apart (§2.2).
    fn default() -> Self {
        Self(
            (0..USUAL_SLOTS)
                .map(|i| RangeFinder::at((2.5 - i as f64) * crate::infrared::SPACING_M))
                .collect(),
        )
    }
}

impl Value for BumperFinders {
    fn to_toml(&self) -> String {
        let each: Vec<String> = self.0.iter().map(|finder| finder.to_toml()).collect();
        format!("[{}]", each.join(", "))
    }
    fn is_allowed(&self, _: &Allowed) -> bool {
        self.0.len() <= SLOTS
            && self.0.iter().all(RangeFinder::is_possible)
            && self.0.windows(2).all(|pair| pair[0].left_m > pair[1].left_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VehicleConfig;

    #[test]
    fn what_is_written_is_what_is_read() {
        let odd = RangeFinder {
            ahead_m: -0.1,
            turned_deg: 12.5,
            beam_m: 0.09,
            curve: RangeCurve::Gp2y0a02,
            ..RangeFinder::at(0.02)
        };
        let finders = BumperFinders(vec![RangeFinder::at(0.08), odd]);
        let value = finders.to_toml();
        assert_eq!(
            value,
            "[{ left_m = 0.08 }, { left_m = 0.02, ahead_m = -0.1, turned_deg = 12.5, beam_m = 0.09, curve = \"gp2y0a02\" }]"
        );
    }

    #[test]
    fn a_bumper_with_nine_range_finders_is_refused_and_so_is_a_wrong_order() {
        let at = |lefts: &[f64]| BumperFinders(lefts.iter().map(|left_m| RangeFinder::at(*left_m)).collect());
        for (finders, is_allowed) in [
            (at(&[]), true),
            (at(&[0.0]), true),
            (at(&[0.1, -0.1]), true),
            (at(&[-0.1, 0.1]), false),
            (at(&[0.1, 0.1]), false),
            (at(&[0.175, 0.125, 0.075, 0.025, -0.025, -0.075, -0.125, -0.175]), true),
            (at(&[0.18, 0.135, 0.09, 0.045, 0.0, -0.045, -0.09, -0.135, -0.18]), false),
            (at(&[f64::NAN]), false),
        ] {
            let mut config = VehicleConfig::default();
            config.range_finders.rear = finders;
            let error = config.validate().map_err(|error| error.to_string());
            assert_eq!(error.is_ok(), is_allowed, "{error:?}");
            assert!(
                error.is_ok() || error.as_ref().unwrap_err().starts_with("range_finders.rear = ["),
                "{error:?}"
            );
        }
    }

    #[test]
    fn one_beside_the_body_is_refused_with_both_names() {
        let mut config = VehicleConfig::default();
        config.range_finders.front = BumperFinders(vec![RangeFinder::at(0.0), RangeFinder::at(-0.21)]);
        let error = config.validate().unwrap_err().to_string();
        assert!(error.contains("range_finders.front") && error.contains("geometry.body_width_m"), "{error}");
    }

    #[test]
    fn turned_aside_it_leaves_less_room_to_stop_and_set_back_it_measures_nearer_things() {
        let (infrared, obstacle) = (Infrared::default(), Obstacle::default());
        let plain = RangeFinder::at(0.0);
        assert!((plain.room_cm(&infrared, &obstacle, 1.0) - (25.0 - 9.74)).abs() < 1e-12);
        let aside = RangeFinder { turned_deg: 60.0, curve: RangeCurve::Gp2d12, ..plain };
        // It sees no farther than 55.8 cm along its beam, 27.9 cm ahead: the rule's 25 cm still.
        assert!((aside.from_face_cm(50.0) - 25.0).abs() < 1e-9);
        assert!((aside.room_cm(&infrared, &obstacle, 0.5) - (0.5 * 27.915 - 0.5 * 9.74)).abs() < 0.1);
        let back = RangeFinder { ahead_m: -0.1, curve: RangeCurve::Gp2y0a02, ..plain };
        assert!((back.room_cm(&infrared, &obstacle, 1.0) - (25.0 - 10.0)).abs() < 0.1);
    }
}
