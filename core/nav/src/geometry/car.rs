//! The car as planners see it: a rectangle around a reference point, and a smallest turning circle.

use crate::MapPose;
use thiserror::Error;
use xtb_control::VehicleConfig;
use xtb_control::config::{ConfigError, Value, validate};
use xtb_control::vehicle::{BumperFinders, Drivetrain, Gears};
use xtb_protocol::messages::About;

/// A factsheet that does not say what car its robot is.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NoCar {
    /// A parameter is missing, or no number.
    #[error("{0} is missing, or no number")]
    Missing(&'static str),
    /// A parameter is not within its range.
    #[error(transparent)]
    Invalid(#[from] ConfigError),
}

/// Body and steering of a car. Lengths in m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Car {
    /// From the reference point to the front.
    pub front_m: f64,
    /// From the reference point to the rear.
    pub rear_m: f64,
    /// From the middle to either side.
    pub half_width_m: f64,
    /// Smallest radius the reference point can be driven on.
    pub radius_m: f64,
    /// In which directions it drives by itself.
    pub gears: Gears,
}

impl Car {
    /// The car of a vehicle config; which point of it is the reference point follows from the axles that steer
    /// ([`Drivetrain`]).
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        Self {
            front_m: vehicle.front_m(),
            rear_m: vehicle.rear_m(),
            half_width_m: vehicle.geometry.body_width_m / 2.0,
            radius_m: vehicle.turning_radius_m(),
            gears: vehicle.range_finders.gears(),
        }
    }

    /// The car that a robot says it is.
    ///
    /// # Errors
    /// The parameter that is missing or impossible.
    pub fn of_about(about: &About) -> Result<Self, NoCar> {
        Self::vehicle_of(about).map(|vehicle| Self::of(&vehicle))
    }

    /// Body, axles, steering, and bumpers without range finders that a robot says it has; of all else an XTB's.
    ///
    /// # Errors
    /// As [`Self::of_about`].
    pub fn vehicle_of(about: &About) -> Result<VehicleConfig, NoCar> {
        let find = |name: &'static str| about.vehicle.iter().find(|parameter| parameter.name == name);
        let value = |name: &'static str| {
            find(name).and_then(|parameter| parameter.value.parse().ok()).ok_or(NoCar::Missing(name))
        };
        let mut vehicle = VehicleConfig::default();
        // An agent that does not name these two drives an XTB's: both axles steer, the body lies evenly about them.
        if find("drivetrain").is_some_and(|parameter| parameter.value == Drivetrain::FrontAxle.to_toml()) {
            vehicle.drivetrain = Drivetrain::FrontAxle;
        }
        if find("geometry.body_ahead_m").is_some() {
            vehicle.geometry.body_ahead_m = value("geometry.body_ahead_m")?;
        }
        // Nor does an older one have a bumper without range finders.
        let is_bare = |name| find(name).is_some_and(|parameter| parameter.value == "[]");
        if is_bare("range_finders.front") {
            vehicle.range_finders.front = BumperFinders(Vec::new());
        }
        if is_bare("range_finders.rear") {
            vehicle.range_finders.rear = BumperFinders(Vec::new());
        }
        vehicle.geometry.wheelbase_m = value("geometry.wheelbase_m")?;
        vehicle.geometry.body_length_m = value("geometry.body_length_m")?;
        vehicle.geometry.body_width_m = value("geometry.body_width_m")?;
        vehicle.steering.stop_deg = value("steering.stop_deg")?;
        validate(&vehicle.parameters())?;
        Ok(vehicle)
    }

    /// The same car with `margin_m` more on each side.
    #[must_use]
    pub fn grown(&self, margin_m: f64) -> Self {
        Self {
            front_m: self.front_m + margin_m,
            rear_m: self.rear_m + margin_m,
            half_width_m: self.half_width_m + margin_m,
            radius_m: self.radius_m,
            gears: self.gears,
        }
    }

    /// Farthest point of the body from the reference point.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        libm::hypot(self.front_m.max(self.rear_m), self.half_width_m)
    }

    /// Nearest point of the outline to the reference point.
    #[must_use]
    pub fn core_m(&self) -> f64 {
        self.front_m.min(self.rear_m).min(self.half_width_m)
    }

    /// Corners of the body, counter-clockwise from front left.
    #[must_use]
    pub fn corners(&self, pose: &MapPose) -> [[f64; 2]; 4] {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        [
            (self.front_m, self.half_width_m),
            (-self.rear_m, self.half_width_m),
            (-self.rear_m, -self.half_width_m),
            (self.front_m, -self.half_width_m),
        ]
        .map(|(ahead, left)| [pose.x_m + ahead * cos - left * sin, pose.y_m + ahead * sin + left * cos])
    }

    /// Points around the body, no farther apart than a quarter of its longest side.
    pub fn outline(&self, pose: &MapPose) -> impl Iterator<Item = [f64; 2]> {
        /// Of each side: 12.5 cm of an XTB's longest.
        const PARTS: u8 = 4;
        let corners = self.corners(pose);
        (0..4).flat_map(move |side| {
            let (from, to) = (corners[side], corners[(side + 1) % 4]);
            (0..PARTS).map(move |part| {
                let part = f64::from(part) / f64::from(PARTS);
                [from[0] + part * (to[0] - from[0]), from[1] + part * (to[1] - from[1])]
            })
        })
    }

    /// Points of the body that no cell of a map lies between.
    pub(crate) fn body_points(&self, pose: &MapPose) -> Vec<[f64; 2]> {
        /// The usual cell of a map, in m; finer maps have cells between.
        const STEP_M: f64 = 0.05;
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let steps = |from_m: f64, to_m: f64| {
            let steps = libm::ceil((to_m - from_m) / STEP_M).max(1.0);
            (0..=steps as u32).map(move |step| from_m + (to_m - from_m) * f64::from(step) / steps)
        };
        let half_m = self.half_width_m;
        let all = steps(-self.rear_m, self.front_m)
            .flat_map(|ahead_m| steps(-half_m, half_m).map(move |left_m| (ahead_m, left_m)));
        all.map(|(ahead, left)| [pose.x_m + ahead * cos - left * sin, pose.y_m + ahead * sin + left * cos])
            .collect()
    }

    /// How far a point is from the body of a car that stands at `pose`; 0 inside.
    #[must_use]
    pub fn distance_m(&self, pose: &MapPose, point: [f64; 2]) -> f64 {
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let (dx, dy) = (point[0] - pose.x_m, point[1] - pose.y_m);
        self.distance_from_m(dx * cos + dy * sin, dy * cos - dx * sin)
    }

    /// The same of a point that is so far ahead of the reference point, and so far to its left.
    pub(crate) fn distance_from_m(&self, ahead_m: f64, left_m: f64) -> f64 {
        let beyond_m = (ahead_m - self.front_m).max(-self.rear_m - ahead_m).max(0.0);
        let beside_m = (left_m.abs() - self.half_width_m).max(0.0);
        libm::hypot(beyond_m, beside_m)
    }

    /// Whether two cars overlap (separating axes; touching is not overlapping).
    #[must_use]
    pub fn overlaps(&self, pose: &MapPose, other: &Car, there: &MapPose) -> bool {
        let apart = libm::hypot(pose.x_m - there.x_m, pose.y_m - there.y_m);
        if apart >= self.reach_m() + other.reach_m() {
            return false;
        }
        let (a, b) = (self.corners(pose), other.corners(there));
        !separated(&a, &b, pose.yaw_rad) && !separated(&a, &b, there.yaw_rad)
    }
}

/// Whether one of the two axes at `yaw_rad` separates the corners.
fn separated(a: &[[f64; 2]; 4], b: &[[f64; 2]; 4], yaw_rad: f64) -> bool {
    let (sin, cos) = libm::sincos(yaw_rad);
    [[cos, sin], [-sin, cos]].into_iter().any(|axis| {
        let span = |corners: &[[f64; 2]; 4]| {
            corners
                .iter()
                .map(|p| p[0] * axis[0] + p[1] * axis[1])
                .fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((a_low, a_high), (b_low, b_high)) = (span(a), span(b));
        a_high <= b_low || b_high <= a_low
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::config::Parameter;
    use xtb_protocol::Name;
    use xtb_protocol::messages::{Limits, ParameterInfo};

    fn truck() -> Car {
        Car::of(&VehicleConfig::default())
    }

    #[test]
    fn the_outline_goes_once_round_the_body() {
        let car = truck();
        let pose = MapPose { x_m: 1.0, y_m: -2.0, yaw_rad: 0.7 };
        let points: Vec<[f64; 2]> = car.outline(&pose).collect();
        let inner = car.grown(-1e-9);
        for (one, next) in points.iter().zip(points.iter().cycle().skip(1)) {
            assert!(car.distance_m(&pose, *one) < 1e-9 && inner.distance_m(&pose, *one) > 0.0);
            assert!(libm::hypot(one[0] - next[0], one[1] - next[1]) < 0.126);
        }
    }

    #[test]
    fn the_turning_circle_comes_from_both_axles() {
        // 0.286 m / (2 tan 20°)
        assert!((truck().radius_m - 0.3929).abs() < 1e-4);
    }

    fn about(vehicle: Vec<ParameterInfo>) -> About {
        About {
            robot: Name::new("xtb-1").unwrap(),
            fleet: Name::new("lab").unwrap(),
            version: String::new(),
            epoch: 1,
            hardware: String::new(),
            start_pose: MapPose::default(),
            limits: Limits {
                max_rpm: 1.0,
                admitted_mps: 1.0,
                setpoint_lifetime_ms: 1,
                max_coordinate_m: 1.0,
            },
            capabilities: Vec::new(),
            vehicle_hash: String::new(),
            vehicle,
        }
    }

    #[test]
    fn a_factsheet_says_which_axles_steer_and_an_older_one_means_both() {
        let mut vehicle = VehicleConfig { drivetrain: Drivetrain::FrontAxle, ..VehicleConfig::default() };
        vehicle.geometry.body_ahead_m = 0.03;
        let info = |parameter: &Parameter| ParameterInfo {
            name: parameter.name.clone(),
            value: parameter.value.clone(),
            unit: String::new(),
            origin: String::new(),
        };
        let mut about = about(vehicle.parameters().iter().map(info).collect());
        assert_eq!(Car::of_about(&about), Ok(Car::of(&vehicle)));
        let mut bare = about.clone();
        bare.vehicle.iter_mut().find(|info| info.name == "range_finders.rear").unwrap().value = "[]".into();
        let gears = Gears { ahead: true, astern: false };
        assert_eq!(Car::of_about(&bare), Ok(Car { gears, ..Car::of(&vehicle) }));
        about.vehicle.retain(|info| !["drivetrain", "geometry.body_ahead_m"].contains(&info.name.as_str()));
        assert_eq!(Car::of_about(&about), Ok(truck()));
    }

    #[test]
    fn cars_side_by_side_touch_without_overlapping_and_overlap_a_little_nearer() {
        let (car, here) = (truck(), MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        let beside = |y_m| MapPose { x_m: 0.1, y_m, yaw_rad: 0.0 };
        assert!(!car.overlaps(&here, &car, &beside(0.4)));
        assert!(car.overlaps(&here, &car, &beside(0.399)));
    }

    #[test]
    fn a_corner_between_two_sides_is_seen() {
        let (car, here) = (truck(), MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        let turned = |x_m| MapPose { x_m, y_m: 0.0, yaw_rad: std::f64::consts::FRAC_PI_4 };
        let reach = (0.25 + 0.2) / std::f64::consts::SQRT_2; // of the turned car along x
        assert!(car.overlaps(&here, &car, &turned(0.25 + reach - 0.001)));
        assert!(!car.overlaps(&here, &car, &turned(0.25 + reach + 0.001)));
    }

    #[test]
    fn distance_is_to_the_outline() {
        let (car, here) = (truck(), MapPose { x_m: 1.0, y_m: 1.0, yaw_rad: std::f64::consts::FRAC_PI_2 });
        assert!((car.distance_m(&here, [1.0, 1.75]) - 0.5).abs() < 1e-12);
        assert!((car.distance_m(&here, [1.5, 1.0]) - 0.3).abs() < 1e-12);
        assert_eq!(car.distance_m(&here, [1.1, 1.1]), 0.0);
    }
}
