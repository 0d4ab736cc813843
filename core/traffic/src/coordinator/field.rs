//! How far it is from anywhere to a goal for a point that keeps the truck's half width: what a search
//! hopes for.

use super::room::RoomGeometry;
use xtb_nav::geometry::rect::Rect;
use xtb_nav::planner::space::OneWay;

/// Side of a cell, in m: two of the usual cells of a map; chosen for the time, not measured.
const CELL_M: f64 = 0.1;
/// A cell's middle may be so much nearer to a thing than the truck that is in the cell, in m: half of its
/// diagonal is 7.1 cm.
const SLACK_M: f64 = 0.075;

/// To the next cell and to the one across a corner, in tenths of a millimetre.
const STRAIGHT: u32 = 1000;
const SLANTED: u32 = 1414;

/// Distances to one goal.
#[derive(Debug, Clone)]
pub struct Field {
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    /// In tenths of a millimetre; `u32::MAX` = cannot be reached.
    distance: Vec<u32>,
}

impl Field {
    /// Floods the floor from the goal around fixed things and standing bodies.
    #[must_use]
    pub fn new(room: &dyn RoomGeometry, half_width_m: f64, standing: &[Rect], goal_m: [f64; 2]) -> Self {
        Self::in_place_of(None, room, half_width_m, standing, goal_m)
    }

    /// The same, in the memory of another one that is no longer needed.
    #[must_use]
    pub fn in_place_of(
        before: Option<Self>,
        room: &dyn RoomGeometry,
        half_width_m: f64,
        standing: &[Rect],
        goal_m: [f64; 2],
    ) -> Self {
        let memory = before.map(|field| field.distance).unwrap_or_default();
        let (mut field, open) = Self::unknown(memory, room, half_width_m, standing);
        let goal = field.index(goal_m[0], goal_m[1]);
        field.flood(goal.into_iter(), &open, room.one_way());
        field
    }

    /// Floods it from everywhere off these places: how far it is out of the way.
    #[must_use]
    pub fn aside(room: &dyn RoomGeometry, half_width_m: f64, standing: &[Rect], taken: &[Rect]) -> Self {
        let (mut field, open) = Self::unknown(Vec::new(), room, half_width_m, standing);
        let mut free = open.clone();
        for rect in taken {
            field.close_near(&mut free, rect, half_width_m);
        }
        let sources: Vec<usize> = (0..free.len()).filter(|&index| free[index]).collect();
        field.flood(sources.into_iter(), &open, room.one_way());
        field
    }

    /// Without any distance yet, and where a truck's middle can be.
    fn unknown(
        mut distance: Vec<u32>,
        room: &dyn RoomGeometry,
        half_width_m: f64,
        standing: &[Rect],
    ) -> (Self, Vec<bool>) {
        let [low, high] = room.corners_m();
        let cells = |axis: usize| (libm::ceil((high[axis] - low[axis]) / CELL_M) as usize).clamp(1, 4000);
        let (width, height) = (cells(0), cells(1));
        distance.clear();
        distance.resize(width * height, u32::MAX);
        let field = Self { origin_m: low, width, height, distance };
        let keep = half_width_m - SLACK_M;
        let mut open: Vec<bool> = (0..width * height)
            .map(|index| {
                let [x, y] = field.middle(index);
                room.clearance_m(x, y) >= keep
            })
            .collect();
        standing.iter().for_each(|rect| field.close_near(&mut open, rect, keep));
        (field, open)
    }

    /// Closes the cells whose middles are nearer to a rectangle than that.
    fn close_near(&self, open: &mut [bool], rect: &Rect, keep_m: f64) {
        let reach_m = rect.reach_m() + keep_m;
        let place = |v: f64, axis: usize| libm::floor((v - self.origin_m[axis]) / CELL_M).max(0.0) as usize;
        let (left, low) = (place(rect.x_m - reach_m, 0), place(rect.y_m - reach_m, 1));
        let (right, high) = (place(rect.x_m + reach_m, 0), place(rect.y_m + reach_m, 1));
        for row in low..=high.min(self.height - 1) {
            let (from, to) = (row * self.width + left, row * self.width + right.min(self.width - 1));
            for (index, open) in open.iter_mut().enumerate().take(to + 1).skip(from) {
                let [x, y] = self.middle(index);
                *open &= rect.distance_m(x, y) >= keep_m;
            }
        }
    }

    /// Best first. No step is shorter than the range of distances in one bucket, and none longer than two of them:
    /// what is in a bucket when its turn comes stays as it is.
    fn flood(&mut self, from: impl Iterator<Item = usize>, open: &[bool], one_way: Option<&OneWay>) {
        let mut buckets: [Vec<(u32, usize)>; 3] = [from.map(|index| (0, index)).collect(), vec![], vec![]];
        buckets[0].iter().for_each(|&(_, index)| self.distance[index] = 0);
        let mut turn = 0;
        while buckets.iter().any(|bucket| !bucket.is_empty()) {
            for (distance, index) in std::mem::take(&mut buckets[turn % 3]) {
                if distance > self.distance[index] {
                    continue;
                }
                let (column, row) = ((index % self.width) as i64, (index / self.width) as i64);
                for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)] {
                    let (x, y) = (column + dx, row + dy);
                    if x < 0 || y < 0 || x >= self.width as i64 || y >= self.height as i64 {
                        continue;
                    }
                    let next = y as usize * self.width + x as usize;
                    let longer = distance + if dx != 0 && dy != 0 { SLANTED } else { STRAIGHT };
                    // It is driven the other way: from there to here.
                    let may = || {
                        one_way.is_none_or(|zones| zones.lets_through(self.middle(next), self.middle(index)))
                    };
                    if open[next] && longer < self.distance[next] && may() {
                        self.distance[next] = longer;
                        buckets[(longer / STRAIGHT) as usize % 3].push((longer, next));
                    }
                }
            }
            turn += 1;
        }
    }

    /// Distance to the goal, in m; `None` where there is no way.
    #[must_use]
    pub fn distance_m(&self, x_m: f64, y_m: f64) -> Option<f64> {
        let distance = self.distance[self.index(x_m, y_m)?];
        (distance != u32::MAX).then(|| f64::from(distance) * 1e-4)
    }

    /// How many cells it has: what it takes in time and memory.
    #[must_use]
    pub fn cells(&self) -> usize {
        self.distance.len()
    }

    fn index(&self, x_m: f64, y_m: f64) -> Option<usize> {
        let place = |v: f64, origin: f64| libm::floor((v - origin) / CELL_M) as i64;
        let (column, row) = (place(x_m, self.origin_m[0]), place(y_m, self.origin_m[1]));
        let inside = (0..self.width as i64).contains(&column) && (0..self.height as i64).contains(&row);
        inside.then(|| row as usize * self.width + column as usize)
    }

    fn middle(&self, index: usize) -> [f64; 2] {
        let (column, row) = ((index % self.width) as f64, (index / self.width) as f64);
        [self.origin_m[0] + (column + 0.5) * CELL_M, self.origin_m[1] + (row + 0.5) * CELL_M]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::coordinator::room::GridRoom;

    #[test]
    fn behind_a_wall_the_way_leads_through_its_gap() {
        let way_m = |wall_m: f64| {
            let room = GridRoom::with(4.0, 4.0, &[[2.0, 0.0, 0.05, wall_m]]);
            Field::new(&room, 0.2, &[], [1.0, 0.5]).distance_m(3.0, 0.5)
        };
        let around = way_m(3.0).unwrap();
        assert!((5.0..7.0).contains(&around), "{around}");
        assert_eq!(way_m(4.0), None);
    }

    #[test]
    fn in_the_memory_of_another_room_the_distances_are_those_of_its_own() {
        let wall = |side_m: f64, wall_m: f64| GridRoom::with(side_m, 4.0, &[[2.0, 0.0, 0.05, wall_m]]);
        let (wide, narrow) = (wall(8.0, 4.0), wall(4.0, 3.0));
        for (before, now) in [(&wide, &narrow), (&narrow, &wide)] {
            let other = Field::new(before, 0.2, &[], [3.0, 3.0]);
            let again = Field::in_place_of(Some(other), now, 0.2, &[], [1.0, 0.5]);
            assert_eq!(again.distance, Field::new(now, 0.2, &[], [1.0, 0.5]).distance);
        }
    }
}
