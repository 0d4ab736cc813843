//! Who has to hear whom, where nobody coordinates: so that the rule of [`right_of_way`](super::right_of_way)
//! costs a robot what is near it, however large the fleet is.
//!
//! A robot tells what it does in the squares of the floor ([`FloorCell`]) that its body is in and that it drives
//! through within as much of its way as the rule counts; and it listens to its own square and the eight around
//! it (a larger body to more). These hold all that the rule looks at: 6 m of my way end at most 6 m from me.

use super::right_of_way::{MINE_M, Neighbour, NeighbourNow, RemainingPath, STOPS_S, THEIRS_M, WAYS_M};
use crate::MapPose;
use crate::geometry::{Car, Path};
use std::collections::BTreeSet;
use xtb_protocol::Name;
use xtb_protocol::keys::{CELL_M, FloorCell};
use xtb_protocol::messages::{NearState, NearWay, Track};

/// A robot tells what it does at most so many squares from its own, and is not believed from farther away. Its
/// way ends a side away, and it may stand beside that.
const TOLD_WITHIN: u32 = 2;
/// Along a way a square is looked for this often, in m; chosen, not measured.
const SAMPLE_M: f64 = 0.5;
/// It has left its square when it is this far outside, in m, so that it does not listen elsewhere at each step
/// along a border; chosen, not measured.
const LEFT_M: f64 = 0.25;

impl Neighbour {
    /// What it tells those near it.
    #[must_use]
    pub fn near_state(&self, robot: &Name) -> NearState {
        let way = self.way.as_ref().map(|way| NearWay {
            track: Track::from(&way.path),
            done_m: way.done_m,
            release_m: way.release_m,
        });
        NearState {
            robot: robot.clone(),
            x_m: self.pose.x_m,
            y_m: self.pose.y_m,
            yaw_rad: self.pose.yaw_rad,
            speed_mps: self.speed_mps,
            role: self.role,
            way,
            waits_for: self.waits_for.as_deref().and_then(|name| Name::new(name).ok()),
        }
    }

    /// What one near me told in this square; `None` if it cannot have told it there.
    #[must_use]
    pub fn told(said: &NearState, cell: FloorCell) -> Option<Self> {
        let way = said.way.as_ref().map(|way| RemainingPath {
            path: Path::from(&way.track),
            done_m: way.done_m,
            release_m: way.release_m,
        });
        FloorCell::at(said.x_m, said.y_m).is_within(TOLD_WITHIN, cell).then(|| Self {
            name: said.robot.to_string(),
            pose: MapPose { x_m: said.x_m, y_m: said.y_m, yaw_rad: said.yaw_rad },
            speed_mps: said.speed_mps,
            role: said.role,
            way,
            waits_for: said.waits_for.as_ref().map(ToString::to_string),
        })
    }

    /// The squares in which it tells what it does.
    #[must_use]
    pub fn cells(&self) -> BTreeSet<FloorCell> {
        let now = NeighbourNow { said: self, pose: self.pose, still_ms: 0, stood_ms: 0 };
        let own = FloorCell::at(self.pose.x_m, self.pose.y_m);
        let to_m = now.reaches_m().max(self.speed_mps.abs() * STOPS_S).min(THEIRS_M);
        let steps = libm::ceil(to_m / SAMPLE_M) as u32;
        let along = (0..=steps).map(|step| now.ahead((f64::from(step) * SAMPLE_M).min(to_m)));
        let cells = along.map(|pose| FloorCell::at(pose.x_m, pose.y_m));
        cells.filter(|cell| cell.is_within(TOLD_WITHIN, own)).collect()
    }
}

/// The squares that a robot listens to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Surroundings {
    /// So many on each side of its own.
    squares: i32,
    own: Option<FloorCell>,
}

impl Surroundings {
    /// Those of a robot with this body: in them it hears all that the rule looks at.
    #[must_use]
    pub fn of(car: &Car) -> Self {
        let looks_m = MINE_M + 2.0 * car.reach_m() + WAYS_M + SAMPLE_M / 2.0 + LEFT_M;
        Self { squares: libm::ceil(looks_m / CELL_M) as i32, own: None }
    }

    /// The robot is here: the squares, if they are others than before.
    pub fn moved(&mut self, x_m: f64, y_m: f64) -> Option<BTreeSet<FloorCell>> {
        if self.own.is_some_and(|own| own.outside_m(x_m, y_m) < LEFT_M) {
            return None;
        }
        let own = FloorCell::at(x_m, y_m);
        self.own = Some(own);
        Some(own.around(self.squares).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::right_of_way::{NearRole, hold};
    use super::*;
    use crate::geometry::{Piece, distance_m};
    use proptest::prelude::*;
    use xtb_control::VehicleConfig;

    fn car() -> Car {
        Car::of(&VehicleConfig::default())
    }

    fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> MapPose {
        MapPose { x_m, y_m, yaw_rad }
    }

    fn going(pose: MapPose, pieces: &[(f64, f64)], done_m: f64) -> Neighbour {
        let piece = |&(length_m, curvature_per_m): &(f64, f64)| Piece { length_m, curvature_per_m };
        let path = Path { start: pose, pieces: pieces.iter().map(piece).collect() };
        let pose = path.at(done_m).0;
        let way = Some(RemainingPath { path, done_m, release_m: f64::MAX });
        Neighbour { name: "xtb-1".into(), pose, speed_mps: 0.2, role: NearRole::Alone, way, waits_for: None }
    }

    fn cell(column: i32, row: i32) -> FloorCell {
        FloorCell { column, row }
    }

    #[test]
    fn what_is_told_reads_back_in_the_squares_in_which_it_is_told() {
        let robot = Name::new("xtb-1").unwrap();
        let mut said = going(pose(1.0, 1.0, 0.0), &[(12.0, 0.0)], 2.0);
        said.waits_for = Some("xtb-7".into());
        let cells = said.cells();
        assert_eq!(cells, BTreeSet::from([cell(0, 0), cell(1, 0)]));
        for told in cells {
            assert_eq!(Neighbour::told(&said.near_state(&robot), told).as_ref(), Some(&said));
        }
        assert_eq!(Neighbour::told(&said.near_state(&robot), cell(3, 0)), None);
    }

    #[test]
    fn one_that_stands_tells_it_in_its_own_square_alone() {
        let parked = Neighbour {
            role: NearRole::Parked,
            speed_mps: 0.0,
            way: None,
            ..going(pose(-0.1, 0.1, 0.0), &[], 0.0)
        };
        assert_eq!(parked.cells(), BTreeSet::from([cell(-1, 0)]));
        // Nobody knows where this one goes: ahead.
        let by_hand = Neighbour { role: NearRole::Driven, speed_mps: 0.5, ..parked };
        assert_eq!(by_hand.cells(), BTreeSet::from([cell(-1, 0), cell(0, 0)]));
    }

    #[test]
    fn a_way_that_begins_far_from_the_robot_is_not_told_there() {
        let mut lost = going(pose(500.0, 0.0, 0.0), &[(3.0, 0.0)], 0.0);
        lost.pose = pose(0.5, 0.5, 0.0);
        assert_eq!(lost.cells(), BTreeSet::from([cell(0, 0)]));
    }

    #[test]
    fn along_a_border_nobody_listens_elsewhere_at_each_step() {
        let mut around = Surroundings::of(&car());
        assert_eq!(around.moved(7.9, 4.0).map(|cells| cells.len()), Some(9));
        assert_eq!(around.moved(8.1, 4.0), None);
        assert_eq!(around.moved(7.9, 4.0), None);
        let cells = around.moved(8.3, 4.0).unwrap();
        assert!(cells.contains(&cell(2, 0)) && !cells.contains(&cell(-1, 0)));
        assert_eq!(around.moved(7.9, 4.0), None);
    }

    #[test]
    fn a_larger_body_listens_farther() {
        let mut vehicle = VehicleConfig::default();
        for (times, cells) in [(1.0, 9), (1.5, 9), (6.0, 25)] {
            vehicle.geometry.body_length_m = 0.5 * times;
            let around = Surroundings::of(&Car::of(&vehicle)).moved(1.0, 1.0).unwrap();
            assert_eq!(around.len(), cells, "{times} times as long");
        }
    }

    proptest! {
        /// Whoever could hold me on my way is heard: told in a square that I listen to.
        #[test]
        fn nobody_that_matters_is_missed(
            mine in (-9.0..9.0_f64, -9.0..9.0_f64, -3.0..3.0_f64, -1.0..1.0_f64),
            theirs in (-16.0..16.0_f64, -16.0..16.0_f64, -3.0..3.0_f64, -1.0..1.0_f64, 0.0..5.0_f64),
            before in (-0.25..0.25_f64, -0.25..0.25_f64),
        ) {
            let (x_m, y_m, yaw_rad, bend) = mine;
            let path = Path {
                start: pose(x_m, y_m, yaw_rad),
                pieces: vec![Piece { length_m: 9.0, curvature_per_m: bend }],
            };
            let (their_x_m, their_y_m, their_yaw_rad, their_bend, done_m) = theirs;
            let start = pose(their_x_m, their_y_m, their_yaw_rad);
            let said = going(start, &[(14.0, their_bend)], done_m);
            let now = NeighbourNow { said: &said, pose: said.pose, still_ms: 0, stood_ms: 0 };
            let mut around = Surroundings::of(&car());
            // Where it was when it began to listen.
            let mut heard = around.moved(x_m + before.0, y_m + before.1).unwrap();
            if let Some(cells) = around.moved(x_m, y_m) {
                heard = cells;
            }
            let hears = said.cells().iter().any(|cell| heard.contains(cell));
            let holds = hold("xtb-2", &car(), &path, 0.0, &[now]).is_some();
            let apart_m = distance_m(&path.start, &said.pose);
            prop_assert!(hears || !holds, "{apart_m} m apart, {said:?}");
        }
    }
}
