//! Straight ways joined by turns on the spot: how to get about where unknown thin things have been met.
//!
//! In a bend the inner side and the tail pass over floor that no beam gets to ([`unseen`](super::unseen)). On a
//! straight way the swinging beams have looked at more than the body takes, and a turn on the spot takes no more
//! than a disc:
//!
//! ```text
//!    ──────swing──────► fan ───0.57 m───► turn        fan:  to the left, to the right, back: ±20°
//!        ± 29 cm seen       ± 38 cm seen   │          turn: short arcs to and fro, 15° each,
//!                                          ▼                a disc of 38 cm
//! ```
//! The fan stands on floor that the swing has shown, and shows at its 57 cm the floor that the turn takes:
//! 0.19 m cos 20° + 0.6 m sin 20° = 38 cm to either side. The truck looks the same ahead and astern, so it
//! never turns by more than 90° before a straight way; it begins and ends with one, along its own axis.

use super::job::Search;
use super::{MARGIN_M, RADIUS_FACTOR};
use crate::MapPose;
use crate::path::{Path, Piece, wrap_rad};
use crate::space::{GridSpace, Space};
use std::f64::consts::{FRAC_PI_2, PI};

/// Longest arc of a turn on the spot, in m.
const ARC_M: f64 = 0.12;
/// From the fan to the turn, in m.
const FAN_BEFORE_M: f64 = 0.57;
/// Arc of the fan to either side, in m: 20°.
const FAN_M: f64 = 0.16;
/// A turn of less than this needs no fan: the swing has seen as much.
const FAN_FROM_RAD: f64 = 0.35;
/// Straight before a turn, in m: room for swing and fan.
const STRAIGHT_M: f64 = 0.8;
/// The first and the last straight way, in m.
const AXES_M: [f64; 6] = [0.8, 1.0, 1.3, 1.7, 2.2, 3.0];
/// Between places where it may turn, in m.
const APART_M: f64 = 0.5;
/// They lie so far around start and goal, in m, at most …
const AROUND_M: f64 = 2.0;
/// … and no more of them are looked at.
const MOST_PLACES: usize = 400;
/// Turns between the first and the last one.
const MOST_BETWEEN: u32 = 3;
/// Room around the middle of a turn, in m: the disc, and what the map and the pose may be off.
const TURN_ROOM_M: f64 = 0.38 + MARGIN_M;
/// Paths that are tried when a turn turns out to touch something.
const TRIES: u32 = 6;
/// As long takes one arc with its change of gear, and a fan, in s.
const ARC_S: f64 = 2.5;
const FAN_S: f64 = 8.0;
/// Rounds in which where a turn begins is fitted to where it has to end.
const FITS: u32 = 8;
/// It may miss by this, in m and rad.
const MISS_M: f64 = 0.01;

/// A place to turn at, and the best way to it so far.
#[derive(Debug, Clone, Copy)]
struct Place {
    at: [f64; 2],
    cost_s: f64,
    /// Direction in which it is come to.
    towards_rad: f64,
    before: Option<usize>,
}

impl Search<'_> {
    /// The quickest such path that there is room for.
    pub(super) fn with_pivots(&self, space: &GridSpace) -> Option<Path> {
        let mut places = self.places_to_turn(space);
        (0..TRIES).find_map(|_| {
            let (turns, axis_m) = self.quickest(space, &mut places)?;
            let ats: Vec<[f64; 2]> = turns.iter().map(|&turn| places[turn].at).collect();
            let path = self.fitted(&ats, axis_m);
            let bad = path.as_ref().map_or(Some(path_end(&ats)), |path| first_hit(space, path));
            let Some([x_m, y_m]) = bad else { return path.filter(|path| self.blind(path).is_empty()) };
            let far_m = |turn: &usize| distance_m(places[*turn].at, [x_m, y_m]);
            let worst = turns.into_iter().min_by(|a, b| far_m(a).total_cmp(&far_m(b)))?;
            places.remove(worst);
            None
        })
    }

    fn places_to_turn(&self, space: &GridSpace) -> Vec<Place> {
        let (start, aim) = (&self.start, &self.aim);
        let low = |a: f64, b: f64| a.min(b) - AROUND_M;
        let (x_m, y_m) = (low(start.x_m, aim.x_m), low(start.y_m, aim.y_m));
        let columns = ((start.x_m - aim.x_m).abs() + 2.0 * AROUND_M) / APART_M;
        let rows = ((start.y_m - aim.y_m).abs() + 2.0 * AROUND_M) / APART_M;
        let around = (0..=columns as u32).flat_map(|column| {
            (0..=rows as u32).map(move |row| {
                [x_m + f64::from(column) * APART_M, y_m + f64::from(row) * APART_M]
            })
        });
        let axes = |pose: MapPose| {
            AXES_M.into_iter().flat_map(move |m| [m, -m]).map(move |m| {
                let there = straight(m).after(&pose, m);
                [there.x_m, there.y_m]
            })
        };
        let goal = aim.yaw_rad.map(|yaw_rad| MapPose { x_m: aim.x_m, y_m: aim.y_m, yaw_rad });
        let all = axes(*start).chain(goal.into_iter().flat_map(axes)).chain(around);
        let all = all.filter(|at| space.clearance_m(at[0], at[1]) >= TURN_ROOM_M);
        let place = |at| Place { at, cost_s: f64::MAX, towards_rad: 0.0, before: None };
        all.take(MOST_PLACES).map(place).collect()
    }

    /// The turns of the quickest path, and the straight way after the last one of a goal with a yaw.
    fn quickest(&self, space: &GridSpace, places: &mut [Place]) -> Option<(Vec<usize>, f64)> {
        for place in places.iter_mut() {
            let (m, left_m) = seen_from(&self.start, place.at);
            let is_first = left_m.abs() < MISS_M && m.abs() >= STRAIGHT_M - MISS_M;
            let is_free = is_first && space.drives(&self.start, &straight(m));
            place.cost_s = if is_free { m.abs() / self.cruise_mps } else { f64::MAX };
            (place.towards_rad, place.before) = (self.start.yaw_rad, None);
        }
        for _ in 0..=MOST_BETWEEN {
            let before = places.to_vec();
            for (from, here) in before.iter().enumerate().filter(|(_, here)| here.cost_s < f64::MAX) {
                for place in places.iter_mut() {
                    let (way_m, towards_rad) = (distance_m(here.at, place.at), direction(here.at, place.at));
                    let cost_s =
                        here.cost_s + turn_s(here.towards_rad, towards_rad) + way_m / self.cruise_mps;
                    if way_m >= STRAIGHT_M
                        && cost_s < place.cost_s
                        && self.is_free(space, here.at, place.at)
                    {
                        *place = Place { cost_s, towards_rad, before: Some(from), ..*place };
                    }
                }
            }
        }
        let goal = [self.aim.x_m, self.aim.y_m];
        let ends = places.iter().enumerate().filter(|(_, place)| place.cost_s < f64::MAX);
        let ends = ends.filter_map(|(index, place)| {
            let (m, turn_s) = match self.aim.yaw_rad {
                Some(yaw_rad) => {
                    let (m, left_m) =
                        seen_from(&MapPose { x_m: goal[0], y_m: goal[1], yaw_rad }, place.at);
                    (left_m.abs() < MISS_M).then_some((m, turn_s(place.towards_rad, yaw_rad)))?
                }
                None => {
                    let towards_rad = direction(place.at, goal);
                    (distance_m(place.at, goal), turn_s(place.towards_rad, towards_rad))
                }
            };
            let is_free = m.abs() >= STRAIGHT_M - MISS_M && self.is_free(space, place.at, goal);
            is_free.then_some((place.cost_s + turn_s + m.abs() / self.cruise_mps, index, m))
        });
        let (_, last, axis_m) = ends.min_by(|a, b| a.0.total_cmp(&b.0))?;
        let mut turns = vec![last];
        while let Some(before) = places[turns[turns.len() - 1]].before {
            turns.push(before);
            if turns.len() > places.len() {
                return None;
            }
        }
        turns.reverse();
        Some((turns, axis_m))
    }

    fn is_free(&self, space: &GridSpace, from: [f64; 2], to: [f64; 2]) -> bool {
        let (x_m, y_m, yaw_rad) = (from[0], from[1], direction(from, to));
        space.drives(&MapPose { x_m, y_m, yaw_rad }, &straight(distance_m(from, to)))
    }

    /// Through these turns to the goal; the last one ends on the goal's axis if it has one.
    fn fitted(&self, turns: &[[f64; 2]], axis_m: f64) -> Option<Path> {
        let goal = [self.aim.x_m, self.aim.y_m];
        let mut turns = turns.to_vec();
        let last = turns.len().checked_sub(1)?;
        let on_axis = self.aim.yaw_rad.map(|yaw_rad| {
            let there = straight(axis_m).after(&MapPose { x_m: goal[0], y_m: goal[1], yaw_rad }, axis_m);
            [there.x_m, there.y_m]
        });
        for _ in 0..FITS {
            let path = self.through(&turns);
            let (Some(on_axis), Some(yaw_rad)) = (on_axis, self.aim.yaw_rad) else { return Some(path) };
            let turned = path.end();
            let before_goal = path.pieces.last().map_or(0.0, |piece| piece.length_m);
            let (ahead_m, left_m) = seen_from(&turned, goal);
            let is_there = left_m.abs() <= MISS_M
                && ahead_m.abs() <= MISS_M
                && wrap_rad(turned.yaw_rad - yaw_rad).abs() <= MISS_M;
            if is_there {
                return Some(path);
            }
            let back = straight(-before_goal).after(&turned, -before_goal);
            turns[last] = [
                turns[last][0] + on_axis[0] - back.x_m,
                turns[last][1] + on_axis[1] - back.y_m,
            ];
        }
        None
    }

    fn through(&self, turns: &[[f64; 2]]) -> Path {
        let radius_m = self.car.radius_m * RADIUS_FACTOR;
        let goal = [self.aim.x_m, self.aim.y_m];
        let mut path = Path::standing(self.start);
        let mut pose = self.start;
        let (mut leg_m, _) = seen_from(&pose, turns[0]);
        for (index, _) in turns.iter().enumerate() {
            let stands = straight(leg_m).after(&pose, leg_m);
            let yaw_rad = self.aim.yaw_rad.filter(|_| index + 1 == turns.len());
            let target = turns.get(index + 1).copied().unwrap_or(goal);
            let (mut from, mut pieces) = (stands, Vec::new());
            let gear = yaw_rad.map_or_else(
                || {
                    let off_rad = wrap_rad(direction([stands.x_m, stands.y_m], target) - stands.yaw_rad);
                    if off_rad.abs() <= FRAC_PI_2 { 1.0 } else { -1.0 }
                },
                |yaw_rad| seen_from(&MapPose { yaw_rad, ..stands }, goal).0.signum(),
            );
            let mut turn_rad = 0.0;
            for _ in 0..FITS {
                let towards = direction([from.x_m, from.y_m], target);
                let wanted = yaw_rad.unwrap_or(if gear > 0.0 { towards } else { towards + PI });
                turn_rad = wrap_rad(wanted - stands.yaw_rad);
                pieces = on_the_spot(turn_rad, radius_m, leg_m.signum(), gear);
                from = pieces.iter().fold(stands, |pose, piece| piece.end(&pose));
            }
            for piece in leg(leg_m, radius_m, turn_rad).into_iter().chain(pieces) {
                path.push(piece);
            }
            pose = from;
            leg_m = seen_from(&pose, target).0;
        }
        path.push(straight(leg_m));
        path
    }
}

/// A straight way with a fan before its end, if a turn follows that needs one.
fn leg(leg_m: f64, radius_m: f64, turn_rad: f64) -> Vec<Piece> {
    let before_m = leg_m.abs() - FAN_BEFORE_M;
    if turn_rad.abs() < FAN_FROM_RAD || before_m <= 0.0 {
        return vec![straight(leg_m)];
    }
    let (gear, curvature_per_m) = (leg_m.signum(), turn_rad.signum() / radius_m);
    let arc = |m: f64| Piece { length_m: gear * m, curvature_per_m: gear * curvature_per_m };
    vec![
        straight(gear * before_m),
        arc(FAN_M),
        arc(-2.0 * FAN_M),
        arc(FAN_M),
        straight(gear * FAN_BEFORE_M),
    ]
}

/// Short arcs to and fro that turn the body, between a way in one gear and a way in another one.
fn on_the_spot(turn_rad: f64, radius_m: f64, gear: f64, gear_after: f64) -> Vec<Piece> {
    let way_m = turn_rad.abs() * radius_m;
    let least = libm::ceil(way_m / ARC_M) as u32;
    let parity = u32::from(gear != gear_after);
    let cusps = if way_m <= ARC_M { parity } else { least + (least + parity) % 2 };
    let arc_m = way_m / f64::from(cusps.max(1));
    (0..=cusps)
        .map(|index| {
            let gear = if index % 2 == 0 { gear } else { -gear };
            let half = cusps > 0 && (index == 0 || index == cusps);
            let length_m = gear * if half { arc_m / 2.0 } else { arc_m };
            Piece { length_m, curvature_per_m: gear * turn_rad.signum() / radius_m }
        })
        .collect()
}

/// About how long a turn from one direction to another takes; straight ways are driven in either gear.
fn turn_s(from_rad: f64, to_rad: f64) -> f64 {
    let turn_rad = wrap_rad(to_rad - from_rad).abs();
    let turn_rad = turn_rad.min(PI - turn_rad);
    let fan_s = if turn_rad < FAN_FROM_RAD { 0.0 } else { FAN_S };
    fan_s + ARC_S * turn_rad * 0.45 / ARC_M
}

/// Where a path first touches something.
fn first_hit(space: &GridSpace, path: &Path) -> Option<[f64; 2]> {
    let mut from = path.start;
    path.pieces.iter().find_map(|piece| {
        let here = from;
        from = piece.end(&from);
        (!space.drives(&here, piece)).then_some([from.x_m, from.y_m])
    })
}

fn path_end(turns: &[[f64; 2]]) -> [f64; 2] {
    turns.last().copied().unwrap_or_default()
}

fn straight(length_m: f64) -> Piece {
    Piece { length_m, curvature_per_m: 0.0 }
}

/// A point seen from a pose: so far ahead and to the left.
fn seen_from(pose: &MapPose, at: [f64; 2]) -> (f64, f64) {
    let (sin, cos) = libm::sincos(pose.yaw_rad);
    let (dx, dy) = (at[0] - pose.x_m, at[1] - pose.y_m);
    (dx * cos + dy * sin, dy * cos - dx * sin)
}

fn direction(from: [f64; 2], to: [f64; 2]) -> f64 {
    libm::atan2(to[1] - from[1], to[0] - from[0])
}

fn distance_m(a: [f64; 2], b: [f64; 2]) -> f64 {
    libm::hypot(a[0] - b[0], a[1] - b[1])
}
