//! What the dispatcher knows of the floor: how far it is, and where nobody may be sent.

use std::f64::consts::PI;
use xtb_control::VehicleConfig;
use xtb_nav::reeds_shepp;
use xtb_nav::{Car, Cell, Map, MapPose};
use xtb_protocol::messages::{DispatchCode, Waypoint};

/// Distances and places, for whoever knows the floor better than an open field.
pub trait Ground {
    /// How far a robot at `from` drives to `to`, in m, with its turning.
    fn distance_m(&self, from: &MapPose, to: &Waypoint) -> f64;

    /// About as much, at once: with ten thousand tasks and a thousand robots it is asked for a million
    /// times.
    fn rough_m(&self, from: &MapPose, to: &Waypoint) -> f64;

    /// Whether robots may be sent there.
    ///
    /// # Errors
    /// [`DispatchCode::KeepOut`] or [`DispatchCode::GoalBlocked`], and in words.
    fn admits(&self, to: &Waypoint) -> Result<(), (DispatchCode, String)>;
}

/// An open field: the car's shortest way (Reeds and Shepp's), and no place is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenGround {
    /// Smallest turning radius, in m.
    pub radius_m: f64,
}

impl OpenGround {
    /// For this vehicle.
    #[must_use]
    pub fn of(vehicle: &VehicleConfig) -> Self {
        Self { radius_m: Car::of(vehicle).radius_m }
    }
}

impl Ground for OpenGround {
    fn distance_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
        let pose = |yaw_rad| MapPose { x_m: to.x_m, y_m: to.y_m, yaw_rad };
        match to.yaw_rad {
            Some(yaw_rad) => reeds_shepp::distance_m(from, &pose(yaw_rad), self.radius_m),
            // Any yaw: the best of sixteen is at most a twentieth of a turn too long.
            None => (0..16)
                .map(|i| reeds_shepp::distance_m(from, &pose(f64::from(i) * PI / 8.0), self.radius_m))
                .fold(f64::INFINITY, f64::min),
        }
    }

    fn rough_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
        let (sin, cos) = libm::sincos(from.yaw_rad);
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let (along, across) = (dx * cos + dy * sin, dy * cos - dx * sin);
        let straight_m = libm::sqrt(along * along + across * across);
        // A point beside the car takes up to a quarter of a turn; ahead and astern are as good.
        let turn = if straight_m > 1e-6 { across.abs() / straight_m } else { 0.0 };
        straight_m + self.radius_m * turn
    }

    fn admits(&self, _: &Waypoint) -> Result<(), (DispatchCode, String)> {
        Ok(())
    }
}

/// The fleet's map: distances as on an open field, places as the robots' planners would refuse them.
#[derive(Debug, Clone)]
pub struct MapGround {
    open: OpenGround,
    map: Map,
    /// Half the car's width: nothing may be nearer, whatever its yaw.
    core_m: f64,
}

impl MapGround {
    /// This map, for this vehicle.
    #[must_use]
    pub fn new(map: Map, vehicle: &VehicleConfig) -> Self {
        Self { open: OpenGround::of(vehicle), map, core_m: Car::of(vehicle).core_m() }
    }
}

impl Ground for MapGround {
    fn distance_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
        self.open.distance_m(from, to)
    }

    fn rough_m(&self, from: &MapPose, to: &Waypoint) -> f64 {
        self.open.rough_m(from, to)
    }

    fn admits(&self, to: &Waypoint) -> Result<(), (DispatchCode, String)> {
        let (x_m, y_m) = (to.x_m, to.y_m);
        if let Some(zone) = self.map.keep_outs().find(|zone| zone.holds(x_m, y_m)) {
            return Err((DispatchCode::KeepOut, format!("({x_m}, {y_m}) lies in keep-out {}", zone.name())));
        }
        let grid = self.map.grid();
        let step_m = grid.resolution_m();
        let reach = libm::floor(self.core_m / step_m) as i64;
        for (i, j) in (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j))) {
            let (dx, dy) = (i as f64 * step_m, j as f64 * step_m);
            if libm::hypot(dx, dy) > self.core_m {
                continue;
            }
            if grid.at(x_m + dx, y_m + dy) == Cell::Free {
                continue;
            }
            let what = format!("({x_m}, {y_m}) is on top of something on the map, or off it");
            return Err((DispatchCode::GoalBlocked, what));
        }
        Ok(())
    }
}
