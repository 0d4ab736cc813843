//! A path cut into steps of 5 cm: what orders and releases count in.

use xtb_nav::geometry::rect::{LOOK_OUT_M, Rect, Stand};
use xtb_nav::{Car, MapPose, Path};

/// Way between two places, in m: the usual cell of a map; chosen, not measured.
pub(super) const STEP_M: f64 = 0.05;

/// Side of the cells by which two ways are known to be apart, in m: more than two XTBs and a look-out reach. Two
/// trucks that reach farther are looked at place by place.
pub(super) const CELL_M: f64 = 2.0;
/// No cell is farther from the map's origin.
const FARTHEST: i32 = 1 << 20;
/// What two of them keep from each other at most, in m: thrice the largest separation, and a place.
const KEEP_M: f64 = 0.3;

/// A path and the truck at each of its places. Place 0 is the start, the last one the end.
#[derive(Debug, Clone)]
pub(super) struct DiscretizedPath {
    /// The path.
    pub(super) path: Path,
    /// Its length, in m.
    pub(super) length_m: f64,
    /// The truck at each place.
    pub(super) stands: Vec<Stand>,
    /// Gear in which each place is reached; that of the first is the next one's.
    pub(super) gears: Vec<f64>,
    /// The cells through which it leads, sorted.
    cells: Vec<(i32, i32)>,
}

impl DiscretizedPath {
    pub(super) fn new(path: Path, car: &Car) -> Self {
        let length_m = path.length_m();
        let last = libm::ceil(length_m / STEP_M - 1e-9).max(0.0) as usize;
        let mut walk = Walk::new(&path);
        let poses: Vec<(MapPose, f64)> =
            (0..=last).map(|place| walk.to((place as f64 * STEP_M).min(length_m))).collect();
        let mut stands = Vec::with_capacity(poses.len());
        let mut gears = Vec::with_capacity(poses.len());
        for (place, (pose, gear)) in poses.iter().enumerate() {
            let before = place.checked_sub(1).map(|before| &poses[before].0);
            let gear = if place == 0 { path.pieces.first().map_or(1.0, xtb_nav::Piece::gear) } else { *gear };
            stands.push(Stand {
                body: Rect::body(car, pose),
                look: before.map(|pose| Rect::looking(car, pose, gear)),
            });
            gears.push(gear);
        }
        let mut cells: Vec<(i32, i32)> =
            stands.iter().map(|stand| cell_of(stand.body.x_m, stand.body.y_m)).collect();
        cells.sort_unstable();
        cells.dedup();
        Self { path, length_m, stands, gears, cells }
    }

    /// The cells through which it leads, sorted.
    pub(super) fn cells(&self) -> &[(i32, i32)] {
        &self.cells
    }

    /// Whether it comes so near to a place anywhere; a yes may be wrong.
    pub(super) fn may_pass(&self, [x_m, y_m]: [f64; 2], near_m: f64) -> bool {
        near_m > CELL_M || self.is_around(cell_of(x_m, y_m))
    }

    /// Whether it leads through this cell or one beside it.
    fn is_around(&self, (x, y): (i32, i32)) -> bool {
        (x - 1..=x + 1).any(|x| {
            let from = self.cells.partition_point(|cell| *cell < (x, y - 1));
            self.cells.get(from).is_some_and(|cell| *cell <= (x, y + 1))
        })
    }

    /// Whether the two ways come near each other anywhere; a yes may be wrong.
    pub(super) fn may_meet(&self, other: &Self) -> bool {
        let reach_m = |way: &Self| way.stands[0].body.reach_m();
        if reach_m(self) + reach_m(other) + LOOK_OUT_M + KEEP_M > CELL_M {
            return true;
        }
        self.cells.iter().any(|cell| other.is_around(*cell))
    }

    /// Number of the last place.
    pub(super) fn last(&self) -> usize {
        self.stands.len() - 1
    }

    /// Way to a place, in m.
    pub(super) fn at_m(&self, place: usize) -> f64 {
        (place as f64 * STEP_M).min(self.length_m)
    }

    /// The last place at or before `way_m`.
    pub(super) fn place(&self, way_m: f64) -> usize {
        if way_m >= self.length_m - 1e-6 {
            return self.last();
        }
        (libm::floor(way_m / STEP_M + 1e-6).max(0.0) as usize).min(self.last())
    }

    /// The path up to a place.
    pub(super) fn up_to(&self, place: usize) -> Path {
        self.path.head(self.at_m(place))
    }
}

/// The cell in which a place is.
pub(super) fn cell_of(x_m: f64, y_m: f64) -> (i32, i32) {
    let along = |v: f64| (libm::floor(v / CELL_M) as i32).clamp(-FARTHEST, FARTHEST);
    (along(x_m), along(y_m))
}

/// Goes along a path once, from its start on.
pub(super) struct Walk<'a> {
    path: &'a Path,
    piece: usize,
    from: MapPose,
    before_m: f64,
}

impl<'a> Walk<'a> {
    pub(super) fn new(path: &'a Path) -> Self {
        Self { path, piece: 0, from: path.start, before_m: 0.0 }
    }

    /// Pose at `way_m`, which may not shrink, and the gear in which it was reached.
    pub(super) fn to(&mut self, way_m: f64) -> (MapPose, f64) {
        while let Some(piece) = self.path.pieces.get(self.piece) {
            let length = piece.length_m.abs();
            let along = way_m - self.before_m;
            if along <= length + 1e-12 || self.piece + 1 == self.path.pieces.len() {
                return (piece.after(&self.from, along.min(length) * piece.gear()), piece.gear());
            }
            self.from = piece.end(&self.from);
            self.before_m += length;
            self.piece += 1;
        }
        (self.from, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::Piece;

    fn there_and_back() -> Path {
        let mut path = Path::standing(MapPose { x_m: 1.0, y_m: 0.0, yaw_rad: 0.0 });
        path.push(Piece { length_m: 0.52, curvature_per_m: 0.0 });
        path.push(Piece { length_m: -0.3, curvature_per_m: 2.0 });
        path
    }

    #[test]
    fn places_lie_on_the_path_and_the_last_one_is_its_end() {
        let path = there_and_back();
        let way = DiscretizedPath::new(path.clone(), &Car::of(&VehicleConfig::default()));
        assert_eq!(way.last(), 17);
        assert!((way.at_m(17) - 0.82).abs() < 1e-12);
        for place in 0..=way.last() {
            let (pose, _) = path.at(way.at_m(place));
            let body = way.stands[place].body;
            assert!(libm::hypot(body.x_m - pose.x_m, body.y_m - pose.y_m) < 1e-9, "place {place}");
        }
        assert_eq!((way.gears[10], way.gears[11]), (1.0, -1.0));
        assert_eq!((way.place(0.31), way.place(0.82)), (6, 17));
    }

    #[test]
    fn the_head_of_a_way_ends_at_its_place() {
        let way = DiscretizedPath::new(there_and_back(), &Car::of(&VehicleConfig::default()));
        let head = way.up_to(12);
        assert_eq!(head.pieces.len(), 2);
        assert!((head.length_m() - 0.6).abs() < 1e-9);
        let whole = DiscretizedPath::new(way.path.clone(), &Car::of(&VehicleConfig::default()));
        assert_eq!(
            whole.stands[..12],
            DiscretizedPath::new(head, &Car::of(&VehicleConfig::default())).stands[..12]
        );
    }
}
