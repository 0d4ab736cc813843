//! A path laid out for driving: pieces with the way at which they begin, and stretches of one gear.
//!
//! Everything is measured along the path in metres whichever gear ("way"); a stretch goes on beyond its
//! ends along its first and last arc, so that a truck that stands before or after them has a way too.

use crate::MapPose;
use crate::geometry::path::{STRAIGHT_PER_M, wrap_rad};
use crate::geometry::{Path, Piece};
use std::ops::Range;

/// The truck is looked for so far behind its last place, in m: more than it may be off
/// (`follower.deviation_m`, 0.12), since a fix may put it back that far, …
const BEHIND_M: f64 = 0.15;
/// … and so far ahead of it, twice that: never on a later turn of the path that comes by here again.
const AHEAD_M: f64 = 0.30;

/// A piece in its place.
#[derive(Debug, Clone, Copy)]
struct Leg {
    piece: Piece,
    start: MapPose,
    from_m: f64,
    to_m: f64,
    /// Integral of the curvature over the way before it.
    turned: f64,
}

/// Pieces of one gear between two stops.
#[derive(Debug, Clone)]
pub(super) struct Stretch {
    legs: Range<usize>,
    /// +1 ahead, −1 astern.
    pub(super) gear: f64,
    pub(super) from_m: f64,
    pub(super) to_m: f64,
}

/// Where a truck is beside the path.
#[derive(Debug, Clone, Copy)]
pub(super) struct Projection {
    pub(super) way_m: f64,
    /// The path's curvature there.
    pub(super) curvature_per_m: f64,
    /// The truck's place to the left of the path (seen along the yaw), in m.
    pub(super) cross_m: f64,
    /// The truck's yaw against the path's.
    pub(super) heading_rad: f64,
    /// From the path's point to the truck, whichever way.
    pub(super) off_m: f64,
}

/// A path laid out for driving.
#[derive(Debug, Clone)]
pub(super) struct IndexedPath {
    legs: Vec<Leg>,
    stretches: Vec<Stretch>,
    start: MapPose,
    end: MapPose,
}

impl IndexedPath {
    pub(super) fn new(path: &Path) -> Self {
        let mut legs: Vec<Leg> = Vec::with_capacity(path.pieces.len());
        let mut stretches: Vec<Stretch> = Vec::new();
        let (mut start, mut from_m, mut turned) = (path.start, 0.0, 0.0);
        for piece in path.pieces.iter().filter(|piece| piece.length_m != 0.0) {
            let to_m = from_m + piece.length_m.abs();
            legs.push(Leg { piece: *piece, start, from_m, to_m, turned });
            let (index, gear) = (legs.len(), piece.gear());
            match stretches.last_mut() {
                Some(last) if last.gear == gear => (last.legs.end, last.to_m) = (index, to_m),
                _ => stretches.push(Stretch { legs: index - 1..index, gear, from_m, to_m }),
            }
            turned += piece.curvature_per_m * piece.length_m.abs();
            (start, from_m) = (piece.end(&start), to_m);
        }
        Self { legs, stretches, start: path.start, end: start }
    }

    /// Where it ends.
    pub(super) fn end(&self) -> &MapPose {
        &self.end
    }

    pub(super) fn length_m(&self) -> f64 {
        self.legs.last().map_or(0.0, |leg| leg.to_m)
    }

    /// The stretch of this number; one of no length beyond the last, and for a path without any.
    pub(super) fn stretch(&self, index: usize) -> Stretch {
        let end_m = self.length_m();
        let none = Stretch { legs: self.legs.len()..self.legs.len(), gear: 1.0, from_m: end_m, to_m: end_m };
        self.stretches.get(index).cloned().unwrap_or(none)
    }

    pub(super) fn is_last(&self, index: usize) -> bool {
        index + 1 >= self.stretches.len()
    }

    /// The place of this stretch nearest to the truck, around the way where it was last.
    pub(super) fn nearest(&self, stretch: &Stretch, around_m: f64, pose: &MapPose) -> Projection {
        let around_m = around_m.clamp(stretch.from_m, stretch.to_m);
        let legs = &self.legs[stretch.legs.clone()];
        let first = legs.partition_point(|leg| leg.to_m < around_m - BEHIND_M);
        let window = legs.iter().enumerate().skip(first);
        let window = window.take_while(|(_, leg)| leg.from_m <= around_m + AHEAD_M);
        let mut best: Option<Projection> = None;
        for (index, leg) in window {
            let (low_m, high_m) = (around_m - BEHIND_M, around_m + AHEAD_M);
            let low_m = if index == 0 { low_m } else { low_m.max(leg.from_m) };
            let high_m = if index + 1 == legs.len() { high_m } else { high_m.min(leg.to_m) };
            let place = leg.place(around_m, low_m, high_m, pose);
            if best.is_none_or(|best| place.off_m < best.off_m) {
                best = Some(place);
            }
        }
        best.unwrap_or_else(|| beside(&self.start, 0.0, 0.0, pose))
    }

    /// Largest jump of the curvature at a joint of the stretch between two ways, in 1/m.
    pub(super) fn sharpest(&self, stretch: &Stretch, from_m: f64, to_m: f64) -> f64 {
        let legs = &self.legs[stretch.legs.clone()];
        let first = legs.partition_point(|leg| leg.to_m < from_m);
        let joints = legs.windows(2).skip(first).take_while(|pair| pair[1].from_m <= to_m);
        joints
            .map(|pair| (pair[1].piece.curvature_per_m - pair[0].piece.curvature_per_m).abs())
            .fold(0.0, f64::max)
    }

    /// Mean curvature of the stretch between two ways.
    pub(super) fn mean_curvature(&self, stretch: &Stretch, from_m: f64, to_m: f64) -> f64 {
        let legs = &self.legs[stretch.legs.clone()];
        let Some(last) = legs.len().checked_sub(1) else { return 0.0 };
        let leg_at = |way_m: f64| &legs[legs.partition_point(|leg| leg.to_m <= way_m).min(last)];
        let turned = |way_m: f64| {
            let leg = leg_at(way_m);
            leg.turned + leg.piece.curvature_per_m * (way_m - leg.from_m)
        };
        if to_m - from_m < 1e-4 {
            return leg_at(from_m).piece.curvature_per_m;
        }
        (turned(to_m) - turned(from_m)) / (to_m - from_m)
    }
}

impl Leg {
    /// The nearest place of this leg with a way between both; its arc goes on beyond its ends.
    fn place(&self, around_m: f64, low_m: f64, high_m: f64, pose: &MapPose) -> Projection {
        let (curvature, gear) = (self.piece.curvature_per_m, self.piece.gear());
        let (sin, cos) = libm::sincos(self.start.yaw_rad);
        let (dx, dy) = (pose.x_m - self.start.x_m, pose.y_m - self.start.y_m);
        let (ahead, left) = (dx * cos + dy * sin, dy * cos - dx * sin);
        let signed_m = if curvature.abs() < STRAIGHT_PER_M {
            ahead
        } else {
            // On a circle the foot is known up to whole turns: the one near the last place.
            let turned = libm::atan2(curvature * ahead, 1.0 - curvature * left);
            let expected = curvature * gear * (around_m - self.from_m);
            (expected + wrap_rad(turned - expected)) / curvature
        };
        let way_m = (self.from_m + signed_m * gear).clamp(low_m, high_m);
        let foot = self.piece.after(&self.start, (way_m - self.from_m) * gear);
        beside(&foot, way_m, curvature, pose)
    }
}

/// A truck beside this point of the path.
fn beside(foot: &MapPose, way_m: f64, curvature_per_m: f64, pose: &MapPose) -> Projection {
    let (sin, cos) = libm::sincos(foot.yaw_rad);
    let (dx, dy) = (pose.x_m - foot.x_m, pose.y_m - foot.y_m);
    Projection {
        way_m,
        curvature_per_m,
        cross_m: dy * cos - dx * sin,
        heading_rad: wrap_rad(pose.yaw_rad - foot.yaw_rad),
        off_m: libm::hypot(dx, dy),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const ORIGIN: MapPose = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 };

    /// Half a circle to the left of radius 0.5 m, 0.3 m straight on, the same straight back.
    fn track() -> IndexedPath {
        let mut path = Path::standing(ORIGIN);
        path.push(Piece { length_m: 0.5 * PI, curvature_per_m: 2.0 });
        path.push(Piece { length_m: 0.3, curvature_per_m: 0.0 });
        path.push(Piece { length_m: -0.3, curvature_per_m: 0.0 });
        IndexedPath::new(&path)
    }

    #[test]
    fn a_stretch_ends_where_the_gear_changes() {
        let track = track();
        let (first, second) = (track.stretch(0), track.stretch(1));
        assert!((first.to_m - 1.870_796_3).abs() < 1e-6 && first.gear == 1.0);
        assert_eq!((second.from_m, second.gear), (first.to_m, -1.0));
        assert!(track.is_last(1) && !track.is_last(0));
        assert_eq!(track.stretch(2).from_m, track.length_m());
    }

    #[test]
    fn a_pose_beside_an_arc_is_found_on_the_exact_arc() {
        let (track, way_m) = (track(), 0.8);
        let on = Piece { length_m: 1.0, curvature_per_m: 2.0 }.after(&ORIGIN, way_m);
        let (sin, cos) = libm::sincos(on.yaw_rad);
        let pose = MapPose { x_m: on.x_m - 0.03 * sin, y_m: on.y_m + 0.03 * cos, yaw_rad: on.yaw_rad - 0.1 };
        let place = track.nearest(&track.stretch(0), 0.75, &pose);
        assert!((place.way_m - way_m).abs() < 1e-12, "{place:?}");
        assert!((place.cross_m - 0.03).abs() < 1e-12 && (place.heading_rad + 0.1).abs() < 1e-12, "{place:?}");
    }

    #[test]
    fn a_truck_beyond_the_end_of_a_stretch_has_overshot_and_is_before_the_next_one() {
        let track = track();
        let past = MapPose { x_m: -0.32, y_m: 1.0, yaw_rad: PI };
        let end_m = track.stretch(0).to_m;
        assert!((track.nearest(&track.stretch(0), end_m, &past).way_m - end_m - 0.02).abs() < 1e-9);
        assert!((track.nearest(&track.stretch(1), end_m, &past).way_m - end_m + 0.02).abs() < 1e-9);
    }

    #[test]
    fn the_mean_curvature_is_the_turn_over_the_way() {
        let (track, joint_m) = (track(), 0.5 * PI);
        let first = track.stretch(0);
        assert!((track.mean_curvature(&first, joint_m - 0.03, joint_m + 0.01) - 1.5).abs() < 1e-9);
        assert_eq!(track.mean_curvature(&first, 0.2, 0.2), 2.0);
        assert_eq!(track.mean_curvature(&first, 9.0, 9.0), 0.0, "goes on as it ends");
        assert!((track.mean_curvature(&first, -0.5, -0.1) - 2.0).abs() < 1e-9, "and as it begins");
    }

    #[test]
    fn only_joints_between_the_two_ways_count_as_jumps() {
        let (track, joint_m) = (track(), 0.5 * PI);
        let first = track.stretch(0);
        assert_eq!(track.sharpest(&first, joint_m - 0.1, joint_m + 0.1), 2.0);
        assert_eq!(track.sharpest(&first, joint_m - 0.1, joint_m - 0.01), 0.0);
        assert_eq!(track.sharpest(&first, joint_m + 0.01, 9.0), 0.0, "the cusp is none");
    }

    #[test]
    fn a_path_without_pieces_is_a_place() {
        let track = IndexedPath::new(&Path::standing(ORIGIN));
        let place = track.nearest(&track.stretch(0), 0.0, &MapPose { y_m: 0.1, ..ORIGIN });
        assert_eq!((place.way_m, place.cross_m, place.off_m), (0.0, 0.1, 0.1));
        assert_eq!(track.mean_curvature(&track.stretch(0), 0.0, 0.1), 0.0);
    }
}
