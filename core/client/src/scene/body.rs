//! What of a car is drawn, as its factsheet says: the body around its pose, and where its range finders' beams begin.

use serde::{Deserialize, Serialize};
use xtb_control::VehicleConfig;
use xtb_control::config::Value;
use xtb_control::vehicle::{BumperFinders, RangeFinder};
use xtb_nav::Car;
use xtb_protocol::messages::{About, Sensors};

/// A car as it is drawn. Lengths in m, from the pose.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CarBody {
    /// Bumper to bumper.
    pub length_m: f64,
    /// Tyre to tyre.
    pub width_m: f64,
    /// Ahead to the middle of the body.
    pub ahead_m: f64,
    /// Beams of the front bumper, by the converter's channels.
    pub front: Vec<Beam>,
    /// Beams of the rear bumper.
    pub rear: Vec<Beam>,
}

/// Where a range finder is, and where it looks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beam {
    /// Ahead, in m.
    pub ahead_m: f64,
    /// To the left, in m.
    pub left_m: f64,
    /// Its direction, counter-clockwise from straight ahead.
    pub yaw_rad: f64,
}

impl Beam {
    /// The point so far along it, ahead and to the left of the pose, in m.
    #[must_use]
    pub fn at_cm(&self, range_cm: f64) -> (f64, f64) {
        let (sin, cos) = self.yaw_rad.sin_cos();
        (self.ahead_m + range_cm / 100.0 * cos, self.left_m + range_cm / 100.0 * sin)
    }
}

impl Default for CarBody {
    /// An XTB's: drawn of a robot that has not said what car it is.
    fn default() -> Self {
        Self::of(&VehicleConfig::default())
    }
}

impl CarBody {
    /// Of a car with these settings.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        let (front_m, rear_m) = (vehicle.front_m(), vehicle.rear_m());
        let front = |finder: &RangeFinder| Beam {
            ahead_m: front_m + finder.ahead_m,
            left_m: finder.left_m,
            yaw_rad: finder.turned_deg.to_radians(),
        };
        let rear = |finder: &RangeFinder| Beam {
            ahead_m: -(rear_m + finder.ahead_m),
            left_m: finder.left_m,
            yaw_rad: std::f64::consts::PI - finder.turned_deg.to_radians(),
        };
        Self {
            length_m: front_m + rear_m,
            width_m: vehicle.geometry.body_width_m,
            ahead_m: vehicle.body_ahead_m(),
            front: vehicle.range_finders.front.0.iter().map(front).collect(),
            rear: vehicle.range_finders.rear.0.iter().map(rear).collect(),
        }
    }

    /// As a factsheet says, if it does.
    #[must_use]
    pub fn of_about(about: &About) -> Self {
        let Ok(mut vehicle) = Car::vehicle_of(about) else { return Self::default() };
        let fitted = |name: &str| {
            let info = about.vehicle.iter().find(|info| info.name == name)?;
            let Fitted { finders } = toml::from_str(&format!("finders = {}", info.value)).ok()?;
            finders.is_allowed(&BumperFinders::ALLOWED).then_some(finders)
        };
        // An agent that does not name them has an XTB's.
        if let Some(front) = fitted("range_finders.front") {
            vehicle.range_finders.front = front;
        }
        if let Some(rear) = fitted("range_finders.rear") {
            vehicle.range_finders.rear = rear;
        }
        Self::of(&vehicle)
    }

    /// What the range finders of the front bumper and of the rear one see: each beam and its reading in cm, `None` =
    /// nothing in range.
    pub fn seen<'a>(&'a self, sensors: &'a Sensors) -> [impl Iterator<Item = (&'a Beam, Option<f64>)>; 2] {
        let bumpers = [(&self.front, &sensors.ir_front_cm), (&self.rear, &sensors.ir_rear_cm)];
        bumpers.map(|(beams, readings)| beams.iter().zip(readings.iter().copied()))
    }
}

#[derive(Deserialize)]
struct Fitted {
    finders: BumperFinders,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake;
    use std::f64::consts::{FRAC_PI_2, PI};
    use xtb_control::vehicle::Drivetrain;
    use xtb_protocol::messages::ParameterInfo;

    /// A front-steered car with one range finder that is turned and set back.
    fn car() -> VehicleConfig {
        let mut vehicle = VehicleConfig { drivetrain: Drivetrain::FrontAxle, ..VehicleConfig::default() };
        vehicle.geometry.body_ahead_m = 0.02;
        let turned = RangeFinder { ahead_m: -0.1, turned_deg: 30.0, ..RangeFinder::at(0.05) };
        vehicle.range_finders.front = BumperFinders(vec![turned]);
        vehicle
    }

    fn about(vehicle: &VehicleConfig) -> About {
        let info = vehicle.parameters().into_iter().map(|parameter| ParameterInfo {
            name: parameter.name,
            value: parameter.value,
            unit: parameter.unit.to_owned(),
            origin: parameter.origin.to_string(),
        });
        About { vehicle: info.collect(), ..fake::about("xtb-1", "") }
    }

    #[test]
    fn a_factsheet_says_where_the_body_lies_and_the_beams_begin() {
        let vehicle = car();
        let body = CarBody::of_about(&about(&vehicle));
        assert_eq!(body, CarBody::of(&vehicle));
        let middle_m = vehicle.geometry.wheelbase_m / 2.0 + 0.02;
        assert!((body.ahead_m - middle_m).abs() < 1e-12, "{body:?}");
        let (ahead_m, left_m) = body.front[0].at_cm(20.0);
        let begins_m = middle_m + body.length_m / 2.0 - 0.1;
        assert!((ahead_m - begins_m - 0.2 * (PI / 6.0).cos()).abs() < 1e-9);
        assert!((left_m - 0.05 - 0.1).abs() < 1e-9);
        assert_eq!(body.rear.len(), 6, "an XTB's");
        let (behind_m, _) = body.rear[0].at_cm(50.0);
        assert!((behind_m - (middle_m - body.length_m / 2.0 - 0.5)).abs() < 1e-9);
        assert!(body.rear.iter().all(|beam| beam.yaw_rad.abs() > FRAC_PI_2));
    }

    #[test]
    fn a_factsheet_of_before_or_with_nonsense_is_drawn_as_an_xtb() {
        let mut about = about(&car());
        for (name, value) in [("range_finders.front", "[{ left_m = 9.0 }]"), ("range_finders.rear", "]")] {
            about.vehicle.iter_mut().find(|info| info.name == name).unwrap().value = value.to_owned();
        }
        assert_eq!(CarBody::of_about(&about).front.len(), 6);
        about.vehicle.clear();
        assert_eq!(CarBody::of_about(&about), CarBody::default());
    }
}
