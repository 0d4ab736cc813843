//! What the map does not know: obstacles seen by the range finders, for a short time.
//!
//! The beams of both bumpers (an XTB's: six each, parallel and 7 cm apart) put obstacles where they hit and take them
//! away where they pass. An obstacle counts once it was seen twice, and fades when it is not seen any more. What the map or
//! the known pose of another truck explains is no obstacle of this layer.
//!
//! The published fit (§4.5) reads farther things too near, by 13 cm of the data sheet's 64. An obstacle goes
//! where the data sheet has it: if the fit is right after all, that shows in time as the truck comes nearer,
//! while an obstacle too near would close ways that are free. Sensors that may fold back (nearer than 14 cm) keep
//! their obstacle until the truck has backed off, as the first level's rule does.
//!
//! What is seen is only the face of a thing: it goes on behind and beside the beams. So the layer also
//! keeps where beams got through and where the truck itself has stood; [`ObstacleLayer::unseen_around`] is
//! what is left around the obstacles. An obstacle beside the body, where no beam can see it, is kept for longer.
//!
//! Time alone takes nothing away: an obstacle that has faded is no obstacle any more, but stays a doubt until a
//! beam has got through or the truck has stood there; [`ObstacleLayer::unobserved`] has these too.

mod beams;
mod clearing;
mod free_cells;
mod obstacle_cells;
mod sight;
mod swept;
#[cfg(test)]
mod tests;
mod thin_obstacles;

pub(crate) use beams::SURE_WITHIN_M;
pub use obstacle_cells::UnmappedObstacle;
pub(crate) use sight::LEG_HALF_WIDTH_M;
pub use sight::Sight;
pub(crate) use swept::CELL_M as SWEPT_CELL_M;

use crate::MapPose;
use crate::geometry::{Car, Cell, Grid};
use beams::{Beam, BeamReading, Extent, Foldback, beams, extent};
use free_cells::FreeCells;
use obstacle_cells::{CellGrid, ObservedCells};
use swept::Swept;
use thin_obstacles::{BROAD_M, ThinObstacles};
use xtb_control::infrared::BumperRanges;
use xtb_control::units::Stamp;
use xtb_control::vehicle::SLOTS;

/// So far beside a hit something that is known explains it, in m; chosen, not measured.
const EXPLAINED_M: f64 = 0.12;
/// With an unsure pose it explains more, but never more than this, in m: 9 cm of standard deviation; chosen,
/// not measured.
const MOST_EXPLAINED_M: f64 = 0.30;
/// What was seen so little inside the body may stand right beside it, in m: about the pose's error (2.6 cm
/// p95 with fixes, docs/navigation.md).
const GRAZES_M: f64 = 0.03;
/// An obstacle as near as this to others belongs to the same thing, in m: two beams, 7 cm apart, on a side
/// that is aslant by up to 60°.
const JOINS_M: f64 = 0.15;
/// Obstacles as near as this to its sides are kept, in m; chosen, not measured.
const BESIDE_BODY_M: f64 = 0.4;

/// What one scan of the bumpers saw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BumperScan {
    /// Where the truck was.
    pub pose: MapPose,
    /// How sure that is: standard deviation in m.
    pub sigma_m: f64,
    /// Front bumper in cm, left to right.
    pub front_cm: BumperRanges,
    /// Rear bumper in cm, left to right with the truck pointing up.
    pub rear_cm: BumperRanges,
}

/// Obstacles of one truck; see the module's documentation.
#[derive(Debug, Clone)]
pub struct ObstacleLayer {
    car: Car,
    sight: Sight,
    occupied: ObservedCells,
    /// Where nothing stood.
    free: FreeCells,
    thin: ThinObstacles,
    /// Where nothing thin stood, while something thin is near.
    swept: Swept,
    foldback: [Foldback; 2 * SLOTS],
    fades_ms: u64,
    fades_beside_ms: u64,
}

impl ObstacleLayer {
    /// Side of a cell where there is no map, in m: the usual one of a map.
    pub const RESOLUTION_M: f64 = 0.05;
    /// How long an obstacle that is not seen again counts, unless it is set: the default of
    /// `navigation.unknown.fades_s`.
    pub const FADES_MS: u64 = 60_000;
    /// Most obstacles; beyond, the one that was not seen for longest goes. 2.6 m² of things at 5 cm: a bound
    /// for time and memory; chosen, not measured.
    pub const MOST_OBSTACLES: usize = 1024;
    /// How long an obstacle beside the body counts that is not seen again, unless it is set: the default of
    /// `navigation.unknown.fades_beside_s`.
    pub const FADES_BESIDE_MS: u64 = 60_000;
    /// How long an obstacle that has faded stays a doubt: ten minutes (docs/navigation.md), as time alone
    /// takes nothing away; chosen, not measured.
    pub const DOUBTFUL_MS: u64 = 600_000;
    /// Around something thin, in m, more of its kind is to be expected: the legs of a table and its chairs;
    /// chosen, not measured by itself.
    pub const THIN_NEAR_M: f64 = 3.0;
    /// Most cells that are known to be free: 10 m² at 5 cm; an XTB passes over 8 m² in a minute at 0.35 m/s,
    /// and older ones fade.
    const MOST_FREE: usize = 4096;

    /// A layer without obstacles whose cells are those of the map, or of [`ObstacleLayer::RESOLUTION_M`].
    #[must_use]
    pub fn new(car: Car, map: Option<&Grid>) -> Self {
        let (resolution_m, origin_m) =
            map.map_or((Self::RESOLUTION_M, [0.0; 2]), |map| (map.resolution_m(), map.origin_m()));
        let grid = CellGrid { resolution_m, origin_m };
        Self {
            car,
            sight: Sight::default(),
            occupied: ObservedCells::new(grid, Self::MOST_OBSTACLES, Self::DOUBTFUL_MS),
            free: FreeCells::new(grid, Self::MOST_FREE),
            thin: ThinObstacles::default(),
            swept: Swept::default(),
            foldback: [Foldback::default(); 2 * SLOTS],
            fades_ms: Self::FADES_MS,
            fades_beside_ms: Self::FADES_BESIDE_MS,
        }
    }

    /// With other range finders than an XTB's.
    #[must_use]
    pub fn seeing(self, sight: Sight) -> Self {
        Self { sight, ..self }
    }

    /// What the range finders look at.
    #[must_use]
    pub fn sight(&self) -> &Sight {
        &self.sight
    }

    /// With other times for obstacles that are not seen again.
    #[must_use]
    pub fn fading(self, fades_ms: u64, fades_beside_ms: u64) -> Self {
        Self { fades_ms, fades_beside_ms, ..self }
    }

    /// A scan at `now`; `others` are trucks whose poses are known. A pose that is not finite sees nothing.
    pub fn see(&mut self, now: Stamp, scan: &BumperScan, map: Option<&Grid>, others: &[(MapPose, Car)]) {
        let MapPose { x_m, y_m, yaw_rad } = scan.pose;
        if ![x_m, y_m, yaw_rad, scan.sigma_m].iter().all(|v| v.is_finite()) {
            return;
        }
        self.occupied.fade(now);
        self.free.begin(now, self.fades_ms);
        self.swept.fade(now, self.fades_ms);
        self.thin.fade(now, Self::DOUBTFUL_MS);
        let known_m = (EXPLAINED_M + 2.0 * scan.sigma_m).clamp(EXPLAINED_M, MOST_EXPLAINED_M);
        let beams = beams(&self.sight, &self.car, &scan.pose);
        let readings: [BeamReading; 2 * SLOTS] = std::array::from_fn(|i| {
            let range = if i < SLOTS { scan.front_cm[i] } else { scan.rear_cm[i - SLOTS] };
            beams[i].map_or(BeamReading::Unfitted, |beam| self.foldback[i].interpret(&beam, range))
        });
        let known = |point: [f64; 2]| {
            map.is_some_and(|map| is_near(map, point, known_m))
                || others.iter().any(|(pose, car)| car.distance_m(pose, point) <= known_m)
        };
        for (n, beam) in beams.iter().enumerate() {
            if let Some(beam) = beam {
                self.add_hit(now, beam, &readings, n, (known_m, &known));
            }
        }
        // What is seen beside another truck is most likely a corner of it, where it has not said yet that it is.
        let is_truck = |at| others.iter().any(|(there, other)| other.distance_m(there, at) <= BROAD_M);
        for (at, is_broad) in self.occupied.seen_now(now, BROAD_M) {
            match is_broad || is_truck(at) {
                true => self.thin.is_broad(at),
                false => self.thin.meet(now, at),
            }
        }
        let (car, pose) = (self.car, scan.pose);
        self.clear_seen(now, &pose, &beams, &readings);
        self.free.end();
        let inside = car.grown(-GRAZES_M);
        let beside = |point| is_beside(&car, &pose, point);
        self.occupied.hold(now.plus_ms(self.fades_ms), self.fades_beside_ms, beside);
        self.occupied.retain(|point, sure| {
            (if sure { inside } else { car }).distance_m(&pose, point) > 0.0
                && others.iter().all(|(there, other)| other.distance_m(there, point) > known_m)
        });
    }

    /// What one beam hits, if nothing that is known as near as this explains it.
    fn add_hit(
        &mut self,
        now: Stamp,
        beam: &Beam,
        readings: &[BeamReading; 2 * SLOTS],
        n: usize,
        (known_m, known): (f64, &dyn Fn([f64; 2]) -> bool),
    ) {
        match readings[n] {
            BeamReading::Folded(point) if !known(point) => {
                self.occupied.see_part(now, point, Extent::Unknown, self.fades_ms, JOINS_M)
            }
            BeamReading::Hit { from_m, to_m } => {
                let steps = libm::ceil((to_m - from_m) / known_m).max(1.0);
                let place = |step: u32| beam.at(from_m + f64::from(step) / steps * (to_m - from_m));
                if !(0..=steps as u32).any(|step| known(place(step))) {
                    let extent = extent(readings, n);
                    self.occupied.see_part(now, beam.at(to_m), extent, self.fades_ms, JOINS_M);
                }
            }
            BeamReading::Folded(_) | BeamReading::Free { .. } | BeamReading::Unfitted => {}
        }
    }

    /// Something was touched: these places are taken, as if it had always stood there.
    pub fn add_contact(&mut self, now: Stamp, places: &[[f64; 2]]) {
        for place in places {
            self.occupied.know(now, *place, self.fades_ms);
            self.thin.meet(now, *place);
        }
    }

    /// It was not there after all.
    pub fn remove_contact(&mut self, places: &[[f64; 2]]) {
        for place in places {
            self.occupied.remove(*place);
            self.thin.forget(*place);
        }
    }

    /// Forgets everything: the pose was set anew, all obstacles are in the wrong place.
    pub fn clear(&mut self) {
        self.occupied.clear();
        self.free.clear();
        self.thin.clear();
        self.swept.clear();
        self.foldback = [Foldback::default(); 2 * SLOTS];
    }

    /// Whether something has shown lately that nothing stands there.
    #[must_use]
    pub fn is_known_free(&self, point: [f64; 2]) -> bool {
        self.free.seen_at(point).is_some()
    }

    /// The same for something thin; only within [`ObstacleLayer::THIN_NEAR_M`] of something thin this is noted.
    #[must_use]
    pub fn is_swept(&self, point: [f64; 2]) -> bool {
        self.swept.holds(point)
    }

    /// What stands there now, rows from south to north.
    pub fn obstacles(&self, now: Stamp) -> impl Iterator<Item = UnmappedObstacle> {
        self.occupied.counting(now)
    }

    /// What stood there and nothing has shown to be gone since, though it was not seen for long.
    pub fn doubts(&self, now: Stamp) -> impl Iterator<Item = UnmappedObstacle> {
        self.occupied.doubtful(now)
    }

    /// Where something thin was met, like the leg of a table, in m. The place is remembered when its obstacle is
    /// gone: others of its kind stand around.
    pub fn thin_obstacles(&self) -> impl Iterator<Item = [f64; 2]> {
        self.thin.places()
    }

    /// Cells within `reach_m` of what stands there now that nothing has shown to be free since: as far as
    /// is known the thing goes on there. Middles in m, rows from south to north.
    #[must_use]
    pub fn unseen_around(&self, now: Stamp, reach_m: f64) -> Vec<[f64; 2]> {
        self.unseen(self.obstacles(now), reach_m)
    }

    /// Where a thing may stand for all that is known, however long ago it was seen: obstacles and doubts within
    /// `near_m` of a place, and the cells within `reach_m` of them that nothing has shown to be free since.
    #[must_use]
    pub fn unobserved(&self, now: Stamp, reach_m: f64, place: [f64; 2], near_m: f64) -> Vec<[f64; 2]> {
        let all = || self.obstacles(now).chain(self.doubts(now));
        let near = || all().filter(|obstacle| obstacle.distance_m(place) <= near_m);
        let mut points: Vec<[f64; 2]> = near().map(|obstacle| [obstacle.x_m, obstacle.y_m]).collect();
        points.extend(self.unseen(near(), reach_m));
        points
    }

    fn unseen(&self, obstacles: impl Iterator<Item = UnmappedObstacle>, reach_m: f64) -> Vec<[f64; 2]> {
        let reach = libm::floor(reach_m / self.occupied.resolution_m()) as i64;
        let mut places = Vec::new();
        for obstacle in obstacles {
            let (row, column) = self.occupied.place([obstacle.x_m, obstacle.y_m]);
            for (up, right) in (-reach..=reach).flat_map(|up| (-reach..=reach).map(move |r| (up, r))) {
                let place = (row + up, column + right);
                let seen_free = || self.free.seen(place).is_some_and(|seen| seen >= obstacle.first);
                if (up, right) != (0, 0) && up * up + right * right <= reach * reach && !seen_free() {
                    places.push(place);
                }
            }
        }
        places.sort_unstable();
        places.dedup();
        places.into_iter().map(|place| self.occupied.middle(place)).collect()
    }

    /// Whether something stands within `radius_m` of a point.
    #[must_use]
    pub fn occupied_near(&self, now: Stamp, point: [f64; 2], radius_m: f64) -> bool {
        let half_m = self.occupied.resolution_m() / 2.0;
        self.obstacles(now).any(|obstacle| obstacle.distance_m(point) <= radius_m + half_m)
    }

    /// What stands nearest to a point: for `blocked near (x, y)`.
    #[must_use]
    pub fn nearest(&self, now: Stamp, point: [f64; 2]) -> Option<UnmappedObstacle> {
        self.obstacles(now).min_by(|a, b| a.distance_m(point).total_cmp(&b.distance_m(point)))
    }

    /// Draws everything that stands there onto a planner's grid.
    pub fn stamp_onto(&self, now: Stamp, grid: &mut Grid) {
        let resolution_m = self.occupied.resolution_m();
        // A hair less than the cell, so that a grid of the same cells gets one for one.
        let half_m = resolution_m * 0.499;
        for UnmappedObstacle { x_m, y_m, .. } in self.obstacles(now) {
            let (west, south) = grid.place(x_m - half_m, y_m - half_m);
            let (east, north) = grid.place(x_m + half_m, y_m + half_m);
            for row in south..=north {
                for column in west..=east {
                    grid.set(column, row, Cell::Occupied);
                }
            }
        }
    }

    /// The side whose range finders have seen something so near that their readings are worth nothing until it
    /// has backed off: +1 in front, −1 behind.
    #[must_use]
    pub fn folded(&self) -> Option<f64> {
        let folded = self.foldback.iter().position(Foldback::may_fold);
        folded.map(|sensor| if sensor < SLOTS { 1.0 } else { -1.0 })
    }

    /// How many obstacles had to go for newer ones.
    #[must_use]
    pub fn overflowed(&self) -> u64 {
        self.occupied.overflowed()
    }
}

/// Whether a point lies to the left or right of the body, where no beam gets to.
fn is_beside(car: &Car, pose: &MapPose, point: [f64; 2]) -> bool {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let (dx, dy) = (point[0] - pose.x_m, point[1] - pose.y_m);
    let (ahead_m, left_m) = (dx * cos + dy * sin, dy * cos - dx * sin);
    (-car.rear_m..=car.front_m).contains(&ahead_m) && left_m.abs() <= car.half_width_m + BESIDE_BODY_M
}

/// Whether a cell of the map that is not free lies within `radius_m` of a point.
fn is_near(map: &Grid, point: [f64; 2], radius_m: f64) -> bool {
    let reach = libm::ceil(radius_m / map.resolution_m()) as i64;
    let (column, row) = map.place(point[0], point[1]);
    (row - reach..=row + reach).any(|row| {
        (column - reach..=column + reach).any(|column| {
            let [x_m, y_m] = map.centre_m(column, row);
            map.cell(column, row) != Cell::Free && libm::hypot(x_m - point[0], y_m - point[1]) <= radius_m
        })
    })
}
