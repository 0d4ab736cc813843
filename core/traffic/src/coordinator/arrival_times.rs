//! A way and the plan's clock: where a truck is at each tick, and when it reaches each place.

use super::discretized_path::DiscretizedPath;
use super::field::Field;
use super::job::{JointJob, Member};
use super::occupancy::{NEVER, TICK_WAY_M};
use super::search::{keep_to, search};
use super::task::{Leg, Other, Stuck, Target, Task};
use xtb_nav::geometry::rect::{Rect, Stand};
use xtb_nav::{Path, Piece};

/// Positions tick by tick from where a truck is to the end of what is released to it.
pub(super) fn to_release(member: &Member) -> Vec<f64> {
    let end_m = member.way.at_m(member.held);
    let mut at_m = vec![member.done_m.min(end_m)];
    while let Some(&last) = at_m.last().filter(|&&last| last < end_m - 1e-9) {
        at_m.push((last + TICK_WAY_M).min(end_m));
    }
    at_m
}

/// What a search goes around, and where to.
pub(super) struct Around<'a> {
    pub(super) target: Option<Target>,
    pub(super) field: &'a Field,
    pub(super) others: &'a [Other<'a>],
    pub(super) soft: &'a [Rect],
    /// It stands so long at the end of what is released to it first, in ticks.
    pub(super) wait: u32,
    /// The rest of its way, if it keeps to that.
    pub(super) rest: Option<&'a [Piece]>,
}

/// A way from the end of what is released to a truck on, with its position on it at each tick. At most so many nodes
/// are expanded, and each counts one down in `left`.
pub(super) fn go_on(
    job: &JointJob,
    member: &Member,
    around: &Around<'_>,
    most: u32,
    left: &mut u32,
) -> Result<(DiscretizedPath, Vec<f64>), Stuck> {
    let (mut at_m, head) = (to_release(member), member.way.up_to(member.held));
    let &Around { target, field, others, soft, wait, rest } = around;
    if wait > 0 {
        let (still, tick) = (Stand { look: None, ..member.way.stands[member.held] }, at_m.len() as u32 - 1);
        let met = |other: &Other<'_>| other.line.next_hit(&still, tick, other.separation_m) <= tick + wait;
        if others.iter().any(met) {
            return Err(Stuck::Nowhere);
        }
        let end_m = at_m[at_m.len() - 1];
        at_m.extend(std::iter::repeat_n(end_m, wait as usize));
    }
    let (room, car, start) = (&*job.room, &member.car, head.end());
    let (gear, tick) = (member.way.gears[member.held], at_m.len() as u32 - 1);
    let task = Task { room, car, start, gear, tick, target, field, others, soft };
    let legs = match rest {
        Some(pieces) => keep_to(&task, pieces, left)?,
        None => search(&task, most, left)?,
    };
    Ok((DiscretizedPath::new(extend(head, &legs, &mut at_m), car), at_m))
}

/// Appends what the search found, and the positions at the ticks on it.
fn extend(mut head: Path, legs: &[Leg], at_m: &mut Vec<f64>) -> Path {
    for leg in legs {
        let base = at_m.last().copied().unwrap_or(0.0);
        while at_m.len() <= leg.depart as usize {
            at_m.push(base);
        }
        let length = leg.piece.length_m.abs();
        at_m.extend((1..=leg.ticks).map(|tick| base + length * f64::from(tick) / f64::from(leg.ticks)));
        head.push(leg.piece);
    }
    head
}

/// When each place is reached, in ticks.
pub(super) fn arrival_times(way: &DiscretizedPath, at_m: &[f64]) -> Vec<f64> {
    let mut tick = 0;
    let reached = |place: usize| {
        let way_m = way.at_m(place);
        while tick + 1 < at_m.len() && at_m[tick] < way_m - 1e-9 {
            tick += 1;
        }
        if at_m[tick] < way_m - 1e-6 {
            return f64::from(NEVER);
        }
        let before = at_m[tick.saturating_sub(1)];
        let part = if at_m[tick] > before {
            ((way_m - before) / (at_m[tick] - before)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        tick as f64 - 1.0 + part
    };
    (0..=way.last()).map(reached).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose, Piece};

    #[test]
    fn places_are_reached_when_the_legs_say_so() {
        let leg =
            |length_m, depart, ticks| Leg { piece: Piece { length_m, curvature_per_m: 0.0 }, depart, ticks };
        let mut at_m = vec![0.0];
        let start = Path::standing(MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        // Waits 3 ticks, 0.2 m in 4 ticks, waits until tick 10, 0.1 m back in 2 ticks.
        let path = extend(start, &[leg(0.2, 3, 4), leg(-0.1, 10, 2)], &mut at_m);
        assert_eq!(at_m.len(), 13);
        let way = DiscretizedPath::new(path, &Car::of(&VehicleConfig::default()));
        let ticks = arrival_times(&way, &at_m);
        assert_eq!(way.last(), 6);
        for (place, tick) in [(1, 4.0), (2, 5.0), (4, 7.0), (5, 11.0), (6, 12.0)] {
            assert!((ticks[place] - tick).abs() < 1e-6, "{place}: {}", ticks[place]);
        }
    }
}
