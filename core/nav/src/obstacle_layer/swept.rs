//! Floor on which nothing thin stands: a beam has passed over it, or the body has stood there.
//!
//! A beam that gets through says of something broad that it is nowhere between its neighbours, but a leg of a
//! table stands between two beams, or in the strip between the outermost one and the side of the body. So this
//! is kept in smaller cells, and only for where a beam really sees a leg. It is kept while something thin is
//! near, and for one to two spans of time.

use super::beams::Beam;
use crate::MapPose;
use crate::geometry::Car;
use std::collections::BTreeMap;
use xtb_control::units::Stamp;

/// Side of a cell, in m: about as fine as a leg is thick.
pub(crate) const CELL_M: f64 = 0.025;
/// Cells on the side of a block: one block is one number of 64 bits.
const SIDE: i64 = 8;
/// Most blocks in a span: 82 m², 33 kB. More are not noted: that floor counts as not passed over.
const MOST_BLOCKS: usize = 2048;
/// Beside a beam a leg is seen for sure, in m: 5 mm of it, half of what
/// [`LEG_HALF_WIDTH_M`](super::LEG_HALF_WIDTH_M) counts, as only sure floor is noted; chosen, not measured.
const LEG_BESIDE_M: f64 = 0.005;

type Blocks = BTreeMap<(i64, i64), u64>;

#[derive(Debug, Clone, Default)]
pub(super) struct Swept {
    now: Blocks,
    before: Blocks,
    /// When the present span began.
    since: Stamp,
}

impl Swept {
    pub(super) fn clear(&mut self) {
        (self.now, self.before) = (Blocks::new(), Blocks::new());
    }

    /// Forgets what is older than two spans.
    pub(super) fn fade(&mut self, now: Stamp, span_ms: u64) {
        if now.since_ms(self.since) >= span_ms {
            (self.before, self.since) = (std::mem::take(&mut self.now), now);
        }
    }

    /// A beam got through up to there.
    pub(super) fn pass(&mut self, beam: &Beam, to_m: f64) {
        let beside_m = beam.half_width_m() + LEG_BESIDE_M;
        let corners = [0.0, to_m].map(|m| [beam.beside(m, -beside_m), beam.beside(m, beside_m)]);
        self.add(corners.as_flattened(), |at| {
            beam.off_m(at) <= beside_m && (0.0..=to_m).contains(&beam.along_m(at))
        });
    }

    /// The body stands there.
    pub(super) fn stand(&mut self, car: &Car, pose: &MapPose) {
        self.add(&car.corners(pose), |at| car.distance_m(pose, at) <= 0.0);
    }

    /// Whether a place is known to have nothing thin on it.
    pub(super) fn holds(&self, [x_m, y_m]: [f64; 2]) -> bool {
        let (block, bit) = place(cell(x_m), cell(y_m));
        [&self.now, &self.before].iter().any(|blocks| blocks.get(&block).is_some_and(|bits| bits & bit != 0))
    }

    /// Those cells around some corners whose middles are inside.
    fn add(&mut self, corners: &[[f64; 2]], is_inside: impl Fn([f64; 2]) -> bool) {
        let range = |axis: usize| {
            let axis = corners.iter().map(move |corner| corner[axis]);
            let (least_m, most_m) = (axis.clone().fold(f64::MAX, f64::min), axis.fold(f64::MIN, f64::max));
            cell(least_m)..=cell(most_m)
        };
        for row in range(1) {
            for column in range(0) {
                if !is_inside([(column as f64 + 0.5) * CELL_M, (row as f64 + 0.5) * CELL_M]) {
                    continue;
                }
                let (block, bit) = place(column, row);
                if self.now.len() < MOST_BLOCKS || self.now.contains_key(&block) {
                    *self.now.entry(block).or_default() |= bit;
                }
            }
        }
    }
}

fn cell(m: f64) -> i64 {
    libm::floor(m / CELL_M) as i64
}

/// Block, and bit in it.
fn place(column: i64, row: i64) -> ((i64, i64), u64) {
    let bit = row.rem_euclid(SIDE) * SIDE + column.rem_euclid(SIDE);
    ((row.div_euclid(SIDE), column.div_euclid(SIDE)), 1 << bit)
}

#[cfg(test)]
mod tests {
    use super::super::beams::beams;
    use super::super::sight::Sight;
    use super::*;
    use xtb_control::VehicleConfig;

    const HERE: MapPose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };

    fn car() -> Car {
        Car::of(&VehicleConfig::default())
    }

    #[test]
    fn between_two_beams_and_beside_the_outermost_one_a_leg_may_stand() {
        let mut swept = Swept::default();
        let beams = beams(&Sight::default(), &car(), &HERE);
        beams[..6].iter().flatten().for_each(|beam| swept.pass(beam, 0.4));
        let at = |left_m: f64| swept.holds([car().front_m + 0.2, left_m]);
        assert!(at(0.035) && at(-0.105) && at(0.175), "in a beam");
        assert!(
            !at(0.065) && !at(0.21),
            "two of them are 7 cm apart; beside the last one is the body's corner"
        );
        assert!(!swept.holds([car().front_m + 0.45, 0.035]), "beyond what was seen");
    }

    #[test]
    fn where_the_body_stands_nothing_does_and_beside_it_something_may() {
        let mut swept = Swept::default();
        let aslant = MapPose { yaw_rad: 0.5, ..HERE };
        swept.stand(&car(), &aslant);
        let (sin, cos) = libm::sincos(aslant.yaw_rad);
        let left = |m: f64| [-m * sin, m * cos];
        assert!(swept.holds(left(0.0)) && swept.holds(left(car().half_width_m - 0.02)));
        assert!(!swept.holds(left(car().half_width_m + 0.02)));
    }

    #[test]
    fn it_is_forgotten_after_two_spans() {
        let mut swept = Swept::default();
        swept.stand(&car(), &HERE);
        swept.fade(Stamp::from_ms(1_000), 1_000);
        assert!(swept.holds([0.0, 0.0]));
        swept.fade(Stamp::from_ms(2_000), 1_000);
        assert!(!swept.holds([0.0, 0.0]));
    }
}
