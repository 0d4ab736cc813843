//! Travel cost: how far it is from a robot to a point, whether it gets there, and where nobody may be sent.

mod flood_distances;

use flood_distances::FloodDistances;
use std::f64::consts::{PI, TAU};
use xtb_nav::geometry::reeds_shepp;
use xtb_nav::navigator::LEAST_MARGIN_M;
use xtb_nav::{Car, Cell, Gears, Map, MapPose};
use xtb_protocol::messages::{DispatchCode, Waypoint};
use xtb_traffic::coordinator::GridRoom;

/// Distances and places, for whoever knows the floor better than an open field.
pub trait TravelCost {
    /// A round of assignment begins: what takes long may be measured anew, within bounds.
    fn begin_round(&self) {}

    /// How far this car at `from` drives to `to`, in m, with its turning.
    fn distance_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64;

    /// About as much, at once: with ten thousand tasks and a thousand robots it is asked for a million
    /// times.
    fn estimate_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64;

    /// Whether this car may be sent there.
    ///
    /// # Errors
    /// [`DispatchCode::KeepOut`] or [`DispatchCode::GoalBlocked`], and in words.
    fn admits(&self, car: &Car, to: &Waypoint) -> Result<(), (DispatchCode, String)>;

    /// Whether traffic control could end a drive of this car there, of a point that is admitted: it keeps the whole body
    /// at [`LEAST_MARGIN_M`] from what is on the map at least.
    fn has_room(&self, _: &Car, _: &Waypoint) -> bool {
        true
    }

    /// Whether any way leads this car there from where it stands; `None` = this round has measured enough. Where
    /// that cannot be said, one does.
    fn is_reachable(&self, _car: &Car, _from: &MapPose, _to: &Waypoint) -> Option<bool> {
        Some(true)
    }
}

/// An open field: the car's shortest way (Reeds and Shepp's), and no place is refused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OpenTravelCost;

/// A robot that has not said what car it is: a point that turns nearly on the spot, so that nothing is ruled out
/// for it. Its own planner decides.
pub const ANY_CAR: Car =
    Car { front_m: 0.0, rear_m: 0.0, half_width_m: 0.0, radius_m: 0.1, gears: Gears::BOTH };

/// From so many turning radii on, one bend and a straight are as good as any way to a point.
const FAR_RADII: f64 = 4.0;

/// To a point that is far: a bend on the full lock towards it, then straight, ahead or astern.
fn far_m(radius_m: f64, from: &MapPose, to: &Waypoint) -> Option<f64> {
    let (along_m, across_m) = in_car_frame(from, to);
    if libm::hypot(along_m, across_m) < FAR_RADII * radius_m {
        return None;
    }
    let beside_m = across_m.abs() - radius_m; // from the middle of the turning circle on that side
    let straight_m = libm::sqrt(along_m * along_m + beside_m * beside_m - radius_m * radius_m);
    let bend = |along_m: f64| {
        let bend_rad = libm::atan2(beside_m, along_m) + libm::atan2(radius_m, straight_m);
        if bend_rad < 0.0 { bend_rad + TAU } else { bend_rad }
    };
    Some(straight_m + radius_m * bend(along_m).min(bend(-along_m)))
}

/// Where a point lies for a car: ahead, and to its left.
fn in_car_frame(from: &MapPose, to: &Waypoint) -> (f64, f64) {
    let (sin, cos) = libm::sincos(from.yaw_rad);
    let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
    (dx * cos + dy * sin, dy * cos - dx * sin)
}

impl TravelCost for OpenTravelCost {
    fn distance_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        let radius_m = car.radius_m;
        let pose = |yaw_rad| MapPose { x_m: to.x_m, y_m: to.y_m, yaw_rad };
        match to.yaw_rad {
            Some(yaw_rad) => reeds_shepp::distance_m(from, &pose(yaw_rad), radius_m),
            None => far_m(radius_m, from, to).unwrap_or_else(|| {
                let yaws = (0..16).map(|i| f64::from(i) * PI / 8.0);
                let ways = yaws.map(|yaw_rad| reeds_shepp::distance_m(from, &pose(yaw_rad), radius_m));
                ways.fold(f64::INFINITY, f64::min)
            }),
        }
    }

    fn estimate_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        let (along_m, across_m) = in_car_frame(from, to);
        let straight_m = libm::sqrt(along_m * along_m + across_m * across_m);
        // A point beside the car takes up to a quarter of a turn; ahead and astern are as good.
        let turn = if straight_m > 1e-6 { across_m.abs() / straight_m } else { 0.0 };
        straight_m + car.radius_m * turn
    }

    fn admits(&self, _: &Car, _: &Waypoint) -> Result<(), (DispatchCode, String)> {
        Ok(())
    }
}

/// How much farther a place counts that no way on the map leads to, in m: the map may be wrong.
const NO_WAY_M: f64 = 50.0;

/// The fleet's map: distances around its walls, places as the robots' planners would refuse them.
#[derive(Debug)]
pub struct MapTravelCost {
    map: Map,
    flood_distances: FloodDistances,
}

impl MapTravelCost {
    /// This map.
    #[must_use]
    pub fn new(map: Map) -> Self {
        Self { flood_distances: FloodDistances::new(GridRoom::of(&map)), map }
    }
}

impl TravelCost for MapTravelCost {
    fn begin_round(&self) {
        self.flood_distances.begin_round();
    }

    fn distance_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        let open_m = OpenTravelCost.distance_m(car, from, to);
        match self.flood_distances.distance_m(car.core_m(), from, to) {
            Some(way_m) if way_m.is_finite() => open_m.max(way_m),
            Some(_) => open_m + NO_WAY_M,
            None => open_m,
        }
    }

    fn estimate_m(&self, car: &Car, from: &MapPose, to: &Waypoint) -> f64 {
        OpenTravelCost.estimate_m(car, from, to)
    }

    /// Nothing may be nearer than half its width, whatever its yaw.
    fn admits(&self, car: &Car, to: &Waypoint) -> Result<(), (DispatchCode, String)> {
        let core_m = car.core_m();
        let (x_m, y_m) = (to.x_m, to.y_m);
        if let Some(zone) = self.map.keep_outs().find(|zone| zone.holds(x_m, y_m)) {
            return Err((
                DispatchCode::KeepOut,
                format!("({x_m:.2}, {y_m:.2}) is in keep-out zone {}", zone.name()),
            ));
        }
        let grid = self.map.grid();
        let step_m = grid.resolution_m();
        let reach = libm::floor(core_m / step_m) as i64;
        for (i, j) in (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| (i, j))) {
            let (dx, dy) = (i as f64 * step_m, j as f64 * step_m);
            if libm::hypot(dx, dy) > core_m {
                continue;
            }
            if grid.at(x_m + dx, y_m + dy) == Cell::Free {
                continue;
            }
            let what = format!("({x_m:.2}, {y_m:.2}) is occupied on the map, or outside it");
            return Err((DispatchCode::GoalBlocked, what));
        }
        Ok(())
    }

    fn has_room(&self, car: &Car, to: &Waypoint) -> bool {
        self.map.has_room(car, [to.x_m, to.y_m], to.yaw_rad, LEAST_MARGIN_M)
    }

    fn is_reachable(&self, car: &Car, from: &MapPose, to: &Waypoint) -> Option<bool> {
        let stands = Waypoint { x_m: from.x_m, y_m: from.y_m, yaw_rad: None };
        if self.admits(car, &stands).is_err() {
            return Some(true); // it stands where no robot can: its pose is not what it seems
        }
        Some(self.flood_distances.distance_m(car.core_m(), from, to)?.is_finite())
    }
}
