//! Where another truck is expected when: what a search in space and time goes around.

use super::discretized_path::{DiscretizedPath, Walk};
use xtb_nav::geometry::rect::Rect;
use xtb_nav::geometry::rect::Stand;
use xtb_nav::{Car, MapPose};

/// Way in one tick of the plan's clock, in m: 0.25 s at 0.28 m/s, between the two speeds that trucks are
/// given.
pub(super) const TICK_WAY_M: f64 = 0.07;
/// No tick is this one: never.
pub(super) const NEVER: u32 = u32::MAX;
/// Where nobody is, in m: beyond any map.
const AWAY_M: f64 = 1.0e9;
/// Ticks in one block of the coarse look; chosen, not measured.
pub(super) const BLOCK: usize = 8;

/// One truck over time.
#[derive(Debug, Clone, Default)]
pub(super) struct Occupancy {
    /// Place at each tick; later it stands at the last one.
    ticks: Vec<Stand>,
    /// Places that it may be at up to a tick: what has been released to it.
    held: Vec<(Stand, u32)>,
    /// Circle around all of `held`: x, y, radius.
    held_circle: [f64; 3],
    /// Circles around each [`BLOCK`] ticks.
    circles: Vec<[f64; 3]>,
    /// From this tick on it is not there any more, as far as is known.
    gone: u32,
}

impl Occupancy {
    /// Something that stays at (or anywhere among) these places.
    pub(super) fn standing(stands: &[Stand]) -> Self {
        Self::build(Vec::new(), stands.iter().map(|stand| (*stand, NEVER)).collect(), NEVER)
    }

    /// A truck on a way, with its position on it at each tick; what it holds may be in use until it
    /// has passed.
    pub(super) fn driving(way: &DiscretizedPath, car: &Car, at_m: &[f64], held: usize) -> Self {
        let mut walk = Walk::new(&way.path);
        let mut ticks: Vec<Stand> = Vec::with_capacity(at_m.len() + 1);
        let mut before = None;
        for &way_m in at_m {
            let (pose, gear) = walk.to(way_m);
            let look = before
                .filter(|(from_m, _)| way_m > from_m + 1e-9)
                .map(|(_, pose)| Rect::looking(car, &pose, gear));
            ticks.push(Stand { body: Rect::body(car, &pose), look });
            before = Some((way_m, pose));
        }
        if let Some(last) = ticks.last().copied() {
            ticks.push(Stand { look: None, ..last });
        }
        let here = at_m.first().map_or(0, |&way_m| way.place(way_m));
        let until = |place: usize| {
            at_m.iter().take_while(|&&way_m| way_m < way.at_m(place) - 1e-9).count() as u32 + 1
        };
        let held =
            (here..=held).step_by(2).chain([held]).map(|place| (way.stands[place], until(place))).collect();
        Self::build(ticks, held, NEVER)
    }

    /// A truck that is going to leave its place some time after `gone`.
    pub(super) fn leaving(stands: &[Stand], gone: u32) -> Self {
        Self::build(Vec::new(), stands.iter().map(|stand| (*stand, gone)).collect(), gone)
    }

    /// Where this one is from one tick to another (and for good if that is [`NEVER`]), and nowhere else.
    pub(super) fn between(&self, from: u32, until: u32) -> Self {
        let away = MapPose { x_m: AWAY_M, y_m: AWAY_M, yaw_rad: 0.0 };
        let Some(last) = self.ticks.len().checked_sub(1) else { return Self::default() };
        let end = (until as usize).min(last.max(from as usize));
        let point =
            Car { front_m: 0.0, rear_m: 0.0, half_width_m: 0.0, radius_m: 1.0, gears: xtb_nav::Gears::BOTH };
        let mut ticks = vec![Stand::still(&point, &away); from as usize];
        ticks.extend((from as usize..=end).map(|tick| self.ticks[tick.min(last)]));
        Self::build(ticks, Vec::new(), until.saturating_add(1))
    }

    /// When two trucks on their ways come too near to each other first, and until when they are;
    /// [`NEVER`] = they stay so.
    pub(super) fn meets(&self, other: &Self, separation_m: f64) -> Option<(u32, u32)> {
        let end = self.ticks.len().max(other.ticks.len()) as u32;
        let from = (0..end).find(|&tick| self.meets_at(other, tick, separation_m))?;
        let apart = (from + 1..end).find(|&tick| !self.meets_at(other, tick, separation_m));
        Some((from, apart.map_or(NEVER, |tick| tick - 1)))
    }

    /// In how many ticks two trucks come too near to each other until both have arrived.
    pub(super) fn contact_ticks(&self, other: &Self, separation_m: f64) -> usize {
        let end = self.ticks.len().max(other.ticks.len()) as u32;
        (0..end).filter(|&tick| self.meets_at(other, tick, separation_m)).count()
    }

    fn meets_at(&self, other: &Self, tick: u32, separation_m: f64) -> bool {
        let at = |line: &Self| line.ticks.get(tick as usize).or(line.ticks.last()).copied();
        at(self).is_some_and(|stand| other.hits(&stand, tick, separation_m))
            || at(other).is_some_and(|stand| self.hits(&stand, tick, separation_m))
    }

    fn build(ticks: Vec<Stand>, held: Vec<(Stand, u32)>, gone: u32) -> Self {
        let circles = ticks.chunks(BLOCK).map(|stands| circle(stands.iter())).collect();
        let held_circle = circle(held.iter().map(|(stand, _)| stand));
        Self { ticks, held, held_circle, circles, gone }
    }

    /// Whether it is so near to a point at any tick from this one on, or stays there.
    pub(super) fn is_near_after(&self, tick: usize, [x_m, y_m]: [f64; 2], near_m: f64) -> bool {
        let is_near = |stand: &Stand| libm::hypot(stand.body.x_m - x_m, stand.body.y_m - y_m) < near_m;
        self.ticks.iter().skip(tick).step_by(2).chain(self.ticks.last()).any(is_near)
    }

    /// Circles around each [`BLOCK`] ticks, and one around what it holds.
    pub(super) fn circles(&self) -> (&[[f64; 3]], Option<&[f64; 3]>) {
        (&self.circles, (!self.held.is_empty()).then_some(&self.held_circle))
    }

    /// Where it is at its ticks, one after the other: its whole way.
    pub(super) fn bodies(&self) -> impl Iterator<Item = Rect> {
        self.ticks.iter().step_by(2).chain(self.ticks.last()).map(|stand| stand.body)
    }

    /// After this tick nothing changes any more.
    pub(super) fn end(&self) -> u32 {
        let held =
            self.held.iter().map(|(_, until)| *until).filter(|&until| until != NEVER).max().unwrap_or(0);
        held.max(self.ticks.len() as u32) + 1
    }

    /// Whether a truck at `stand` comes too near at this tick.
    pub(super) fn hits(&self, stand: &Stand, tick: u32, separation_m: f64) -> bool {
        if tick >= self.gone {
            return false;
        }
        if near(&self.held_circle, stand, separation_m)
            && self.held.iter().any(|(there, until)| tick <= *until && there.conflicts(stand, separation_m))
        {
            return true;
        }
        let Some(last) = self.ticks.len().checked_sub(1) else { return false };
        let index = (tick as usize).min(last);
        near(&self.circles[index / BLOCK], stand, separation_m)
            && self.ticks[index].conflicts(stand, separation_m)
    }

    /// The last tick at which it is in the way of a truck that stays at `stand`; 0 = never, [`NEVER`] = it stays there.
    pub(super) fn last_hit(&self, stand: &Stand, separation_m: f64) -> u32 {
        let is_hit = |there: &Stand| there.conflicts(stand, separation_m);
        let mut last = 0;
        if near(&self.held_circle, stand, separation_m) {
            let held = self.held.iter().filter(|(there, _)| is_hit(there));
            last = held.map(|(_, until)| *until).max().unwrap_or(0);
        }
        for block in (0..self.circles.len()).rev() {
            if near(&self.circles[block], stand, separation_m) {
                let from = block * BLOCK;
                let stands = &self.ticks[from..self.ticks.len().min(from + BLOCK)];
                if let Some(at) = stands.iter().rposition(is_hit) {
                    let tick = from + at;
                    return if tick + 1 == self.ticks.len() { NEVER } else { last.max(tick as u32) };
                }
            }
        }
        last
    }

    /// The first tick of this block after `from` at which a truck that stays at `stand` is in the way.
    pub(super) fn next_hit_in(&self, block: usize, stand: &Stand, from: u32, separation_m: f64) -> u32 {
        if !near(&self.circles[block], stand, separation_m) {
            return NEVER;
        }
        let ticks = (block * BLOCK).max(from as usize + 1)..self.ticks.len().min((block + 1) * BLOCK);
        let hit = ticks.into_iter().find(|&tick| self.ticks[tick].conflicts(stand, separation_m));
        hit.map_or(NEVER, |tick| tick as u32)
    }

    /// The first tick after `from` at which a truck that stays at `stand` is in the way.
    pub(super) fn next_hit(&self, stand: &Stand, from: u32, separation_m: f64) -> u32 {
        let mut index = from as usize + 1;
        while index < self.ticks.len() {
            if near(&self.circles[index / BLOCK], stand, separation_m) {
                if self.ticks[index].conflicts(stand, separation_m) {
                    return index as u32;
                }
                index += 1;
            } else {
                index = (index / BLOCK + 1) * BLOCK;
            }
        }
        NEVER
    }
}

fn near(circle: &[f64; 3], stand: &Stand, separation_m: f64) -> bool {
    let rect = stand.look.unwrap_or(stand.body);
    let (dx, dy) = (rect.x_m - circle[0], rect.y_m - circle[1]);
    let reach = rect.reach_m() + circle[2] + 3.0 * separation_m;
    dx * dx + dy * dy < reach * reach
}

/// A circle around all of them; an empty one is far away.
pub(super) fn circle<'a>(stands: impl Iterator<Item = &'a Stand> + Clone) -> [f64; 3] {
    let rects = || stands.clone().flat_map(|stand| [Some(stand.body), stand.look]).flatten();
    let count = rects().count() as f64;
    if count == 0.0 {
        return [1.0e9, 1.0e9, 0.0];
    }
    let (x, y) = rects().fold((0.0, 0.0), |(x, y), rect| (x + rect.x_m / count, y + rect.y_m / count));
    let radius =
        rects().map(|rect| libm::hypot(rect.x_m - x, rect.y_m - y) + rect.reach_m()).fold(0.0, f64::max);
    [x, y, radius]
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Path, Piece};

    fn car() -> Car {
        Car::of(&VehicleConfig::default())
    }

    /// 3 m to the east from the origin, 1 m of it released, two seconds late.
    fn eastward() -> Occupancy {
        let mut path = Path::standing(MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: 0.0 });
        path.push(Piece { length_m: 3.0, curvature_per_m: 0.0 });
        let at_m: Vec<f64> =
            (0..60).map(|tick| ((f64::from(tick) - 8.0).max(0.0) * TICK_WAY_M).min(3.0)).collect();
        Occupancy::driving(&DiscretizedPath::new(path, &car()), &car(), &at_m, 20)
    }

    fn at(x_m: f64) -> Stand {
        Stand::still(&car(), &MapPose { x_m, y_m: 0.0, yaw_rad: 1.57 })
    }

    #[test]
    fn what_is_released_is_taken_until_the_truck_has_passed() {
        let line = eastward();
        assert!(line.hits(&at(1.0), 0, 0.0));
        assert!(line.hits(&at(1.0), 15, 0.0));
        assert!(!line.hits(&at(1.0), 40, 0.0));
    }

    #[test]
    fn beyond_the_release_a_place_is_free_until_the_truck_comes_near() {
        let line = eastward();
        assert!(!line.hits(&at(2.2), 0, 0.0));
        let hit = line.next_hit(&at(2.2), 0, 0.0);
        assert!((20..40).contains(&hit), "{hit}");
        assert!(line.hits(&at(2.2), hit, 0.0) && !line.hits(&at(2.2), hit - 1, 0.0));
        assert_eq!(line.next_hit(&at(5.0), 0, 0.0), NEVER);
        assert!(line.hits(&at(3.0), 10_000, 0.0));
    }

    #[test]
    fn a_part_of_a_line_is_there_in_its_time_only() {
        let line = eastward();
        let tick = line.next_hit(&at(2.2), 0, 0.0);
        let part = line.between(tick, tick + 3);
        assert!(part.hits(&at(2.2), tick, 0.0) && !part.hits(&at(2.2), tick - 1, 0.0));
        assert!(line.hits(&at(2.2), tick + 4, 0.0) && !part.hits(&at(2.2), tick + 4, 0.0));
        // What it holds at the start is no part of it.
        assert!(!part.hits(&at(1.0), 0, 0.0));
        // At its end it stays.
        let end = line.between(70, NEVER);
        assert!(!end.hits(&at(3.0), 69, 0.0) && end.hits(&at(3.0), 10_000, 0.0));
    }

    #[test]
    fn two_lines_meet_from_one_tick_to_another_or_for_good() {
        let line = eastward();
        let tick = line.next_hit(&at(2.2), 0, 0.0);
        let across = |until: usize| {
            let mut ticks = vec![at(9.0); until];
            ticks.extend([at(2.2); 30]);
            Occupancy::build(ticks, Vec::new(), NEVER)
        };
        // It is there before: as soon as the other comes, and until that one has passed.
        let (from, until) = line.meets(&across(0), 0.0).unwrap();
        assert!(from == tick && (tick..60).contains(&until), "{from} to {until}");
        assert_eq!(line.contact_ticks(&across(0), 0.0) as u32, until - from + 1);
        assert_eq!(line.meets(&across(80), 0.0), None);
        let goal = Occupancy::standing(&[at(3.0)]);
        assert_eq!(line.meets(&goal, 0.0).map(|(_, until)| until), Some(NEVER));
    }

    #[test]
    fn one_that_is_leaving_is_gone_after_its_time() {
        let line = Occupancy::leaving(&[at(0.0)], 12);
        assert!(line.hits(&at(0.2), 11, 0.0) && !line.hits(&at(0.2), 12, 0.0));
    }
}
