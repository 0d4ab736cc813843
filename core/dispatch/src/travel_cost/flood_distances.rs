//! How far it is around the walls: a flood from each point that tasks begin at, kept for the next round.
//!
//! Floods take time, some 2 ms for a room of 12 × 14 m. So a round makes a bounded number of them, and what
//! they did not come to is measured as on an open field until the next one.

use std::collections::{BTreeMap, VecDeque};
use std::sync::{Mutex, MutexGuard, PoisonError};
use xtb_nav::MapPose;
use xtb_protocol::messages::Waypoint;
use xtb_traffic::coordinator::{Field, GridRoom};

/// Cells that the floods of one round may have, together; one flood is always made.
const ROUND_CELLS: usize = 300_000;
/// Cells that all floods that are kept may have, together; the oldest go first.
const KEPT_CELLS: usize = 4_000_000;
/// Steps to eight sides are at most so much longer than the straight way.
const ZIGZAG: f64 = 1.0824;

/// Points whose ways are the same, in cm, for cars that keep so far from everything, in mm.
type Place = (i64, i64, i64);

#[derive(Debug)]
pub(super) struct FloodDistances {
    room: GridRoom,
    kept: Mutex<Kept>,
}

#[derive(Debug)]
struct Kept {
    fields: BTreeMap<Place, Field>,
    oldest: VecDeque<Place>,
    /// Cells of each; 0 = there was none yet.
    cells: usize,
    /// Cells that this round may still flood.
    left: usize,
}

impl FloodDistances {
    pub(super) fn new(room: GridRoom) -> Self {
        let kept = Kept { fields: BTreeMap::new(), oldest: VecDeque::new(), cells: 0, left: ROUND_CELLS };
        Self { room, kept: Mutex::new(kept) }
    }

    pub(super) fn begin_round(&self) {
        self.kept().left = ROUND_CELLS;
    }

    /// At least so far it is around the walls for a car that keeps so far from everything, in m: infinite when there is no way, `None` when this round
    /// has measured enough.
    pub(super) fn distance_m(&self, core_m: f64, from: &MapPose, to: &Waypoint) -> Option<f64> {
        let place = ((to.x_m * 100.0) as i64, (to.y_m * 100.0) as i64, (core_m * 1000.0) as i64);
        let mut kept = self.kept();
        if !kept.fields.contains_key(&place) {
            self.measure(&mut kept, place, core_m, to)?;
        }
        let field = kept.fields.get(&place)?;
        Some(field.distance_m(from.x_m, from.y_m).map_or(f64::INFINITY, |way_m| way_m / ZIGZAG))
    }

    fn measure(&self, kept: &mut Kept, place: Place, core_m: f64, to: &Waypoint) -> Option<()> {
        if kept.left == 0 {
            return None;
        }
        // In the memory of the oldest one, where there are many: tasks that stay for long would lie in its gaps.
        let most = (KEPT_CELLS / kept.cells.max(1)).max(1);
        let oldest = if kept.oldest.len() < most { None } else { kept.oldest.pop_front() };
        let before = oldest.and_then(|place| kept.fields.remove(&place));
        let field = Field::in_place_of(before, &self.room, core_m, &[], [to.x_m, to.y_m]);
        kept.cells = field.cells();
        kept.left = kept.left.saturating_sub(kept.cells);
        kept.oldest.push_back(place);
        kept.fields.insert(place, field);
        Some(())
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
