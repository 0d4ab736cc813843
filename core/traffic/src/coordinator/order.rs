//! Passing order: who has to be how far before whom may go where, and how a fleet runs by it.
//!
//! Two ways conflict at some pairs of places (their bodies touch, or one stands in the other's
//! look-out). A plan takes the two trucks past all these pairs one after the other; which of them goes
//! first at each pair is all that is kept of it. Whoever is late delays the others, but nobody meets.

use super::discretized_path::{DiscretizedPath, STEP_M};
use super::occupancy::TICK_WAY_M;
use std::collections::BTreeMap;
use std::sync::Arc;
use xtb_nav::geometry::rect::Stand;

/// Which place of another truck must be reached before each own one is entered; only the stretch in which any must.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Needs {
    first: usize,
    places: Vec<u32>,
}

impl Needs {
    /// From what each own place needs; `None` = none needs anything.
    pub(super) fn of(all: &[u32]) -> Option<Self> {
        let first = all.iter().position(|&need| need > 0)?;
        let last = all.iter().rposition(|&need| need > 0)?;
        Some(Self { first, places: all[first..=last].to_vec() })
    }

    /// The place that the other one must have reached before this one enters its own.
    pub(super) fn at(&self, place: usize) -> usize {
        place
            .checked_sub(self.first)
            .and_then(|index| self.places.get(index))
            .map_or(0, |&need| need as usize)
    }
}

/// For (who waits, for whom) what it needs; a pair that is missing needs nothing of each other.
pub(super) type Order = BTreeMap<(u32, u32), Arc<Needs>>;

/// All that one needs of others.
pub(super) fn needs_of(order: &Order, id: u32) -> impl Iterator<Item = (u32, &Needs)> + Clone {
    order.range((id, 0)..=(id, u32::MAX)).map(|((_, other), needs)| (*other, &**needs))
}

/// Sets what one needs of another, by place.
pub(super) fn set_needs(order: &mut Order, pair: (u32, u32), all: &[u32]) {
    match Needs::of(all) {
        Some(needs) => drop(order.insert(pair, Arc::new(needs))),
        None => drop(order.remove(&pair)),
    }
}

/// Ticks that a change of gear takes, half a second: less than it takes (1.5 s by `CUSP_S` in xtb-nav's
/// `path_choice.rs`), but of the plan's clock only the passing order is kept. Chosen, not measured.
pub(super) const GEAR_TICKS: u32 = 2;

/// A way with the time at which each place is reached.
pub(super) struct Timed<'a> {
    pub(super) way: &'a DiscretizedPath,
    /// Where the truck is.
    pub(super) at: usize,
    /// Released up to here: nobody may be first there.
    pub(super) held: usize,
    /// In ticks; places up to `held` are not looked at.
    pub(super) ticks: &'a [f64],
}

impl Timed<'_> {
    fn tick(&self, place: usize) -> f64 {
        if place <= self.held { -1.0 } else { self.ticks[place] }
    }

    fn look(&self, place: usize) -> Stand {
        let stand = self.way.stands[place];
        // What brought it here is over.
        if place <= self.at { Stand { look: None, ..stand } } else { stand }
    }
}

/// What each of two trucks needs of the other.
pub(super) fn pair(a: &Timed<'_>, b: &Timed<'_>, separation_m: f64) -> (Vec<u32>, Vec<u32>) {
    let (mut a_needs, mut b_needs) = (vec![0_u32; a.way.stands.len()], vec![0_u32; b.way.stands.len()]);
    for (i, a_need) in a_needs.iter_mut().enumerate().skip(a.at) {
        let mine = a.look(i);
        let mut j = b.at;
        while j < b.way.stands.len() {
            let other = b.look(j);
            let skip = clear_places(&mine, &other, separation_m);
            if skip > 0 {
                j += skip;
                continue;
            }
            if i > a.held || j > b.held {
                let (first, second) = (a.tick(i), b.tick(j));
                let touches = mine.touches(&other, separation_m);
                if touches || mine.sees(&other, separation_m) {
                    if first < second || (!touches && first == second) {
                        // Out of the look-out it is already when it has arrived at i.
                        raise(&mut b_needs[j], i + usize::from(touches));
                    } else {
                        raise(a_need, j + 1);
                    }
                }
                if !touches && other.sees(&mine, separation_m) {
                    if second <= first {
                        raise(a_need, j);
                    } else {
                        raise(&mut b_needs[j], i + 1);
                    }
                }
            }
            j += 1;
        }
    }
    (a_needs, b_needs)
}

fn raise(need: &mut u32, place: usize) {
    *need = (*need).max(place as u32);
}

/// Whether anything that is left of the one way conflicts with anything that is left of the other.
pub(super) fn ways_meet(
    a: (&DiscretizedPath, usize),
    b: (&DiscretizedPath, usize),
    separation_m: f64,
) -> bool {
    let ((a, a_at), (b, b_at)) = (a, b);
    a.may_meet(b)
        && a.stands.iter().skip(a_at).any(|mine| {
            let mut j = b_at;
            while j < b.stands.len() {
                match clear_places(mine, &b.stands[j], separation_m) {
                    0 if mine.conflicts(&b.stands[j], separation_m) => return true,
                    skip => j += skip.max(1),
                }
            }
            false
        })
}

/// Farther apart than this two trucks at two places do not matter to each other, in m.
pub(super) fn matters_m(a: &Stand, b: &Stand, separation_m: f64) -> f64 {
    a.body.reach_m() + b.body.reach_m() + xtb_nav::geometry::rect::LOOK_OUT_M + STEP_M + 3.0 * separation_m
}

/// So many places further on the two are still too far apart to matter.
fn clear_places(a: &Stand, b: &Stand, separation_m: f64) -> usize {
    let apart = libm::hypot(a.body.x_m - b.body.x_m, a.body.y_m - b.body.y_m);
    let reach = matters_m(a, b, separation_m);
    if apart <= reach { 0 } else { (((apart - reach) / STEP_M) as usize).max(1) }
}

/// A truck on its way.
pub(super) struct Runner<'a> {
    pub(super) id: u32,
    pub(super) way: &'a DiscretizedPath,
    /// Driven so far, in m.
    pub(super) done_m: f64,
}

/// All that one truck needs of others, by its own places: at each few need anything.
struct NeedsByPlace {
    /// From where in `needs` those of each place are.
    from: Vec<u32>,
    needs: Vec<(u32, u32)>,
}

impl NeedsByPlace {
    /// From which other needs what, for places up to `last`.
    fn of<'a>(last: usize, all: impl Iterator<Item = (usize, &'a Needs)> + Clone) -> Self {
        let each = || {
            all.clone().flat_map(|(other, needs)| {
                let places = needs.places.iter().zip(needs.first..=last);
                places.filter(|(need, _)| **need > 0).map(move |(&need, place)| (place, other as u32, need))
            })
        };
        let mut from = vec![0_u32; last + 2];
        each().for_each(|(place, ..)| from[place + 1] += 1);
        (0..=last).for_each(|place| from[place + 1] += from[place]);
        let (mut next, mut needs) = (from.clone(), vec![(0, 0); from[last + 1] as usize]);
        for (place, other, need) in each() {
            needs[next[place] as usize] = (other, need);
            next[place] += 1;
        }
        Self { from, needs }
    }

    fn at(&self, place: usize) -> &[(u32, u32)] {
        &self.needs[self.from[place] as usize..self.from[place + 1] as usize]
    }
}

/// Lets everybody go by the order at an even speed: the way of each at each tick until its end, or
/// `None` if they block each other for good (or take longer than `most_ticks`).
pub(super) fn run_ahead(runners: &[Runner<'_>], order: &Order, most_ticks: usize) -> Option<Vec<Vec<f64>>> {
    let index_of: BTreeMap<u32, usize> =
        runners.iter().enumerate().map(|(index, runner)| (runner.id, index)).collect();
    let needs: Vec<NeedsByPlace> = runners
        .iter()
        .map(|one| {
            let known =
                needs_of(order, one.id).filter_map(|(other, needs)| Some((*index_of.get(&other)?, needs)));
            NeedsByPlace::of(one.way.last(), known)
        })
        .collect();
    let mut ways: Vec<Vec<f64>> = runners.iter().map(|runner| vec![runner.done_m]).collect();
    let mut at: Vec<usize> = runners.iter().map(|runner| runner.way.place(runner.done_m)).collect();
    let mut cleared = at.clone();
    let mut pause = vec![0_u32; runners.len()];
    for _ in 0..most_ticks {
        let (mut moved, mut open) = (false, false);
        for (index, runner) in runners.iter().enumerate() {
            let way = runner.way;
            let here = ways[index][ways[index].len() - 1];
            if at[index] == way.last() {
                continue;
            }
            open = true;
            if pause[index] > 0 {
                pause[index] -= 1;
                moved = true;
                ways[index].push(here);
                continue;
            }
            let wanted = (here + TICK_WAY_M).min(way.length_m);
            let may = |place: usize| {
                needs[index].at(place).iter().all(|&(other, need)| need as usize <= at[other as usize])
            };
            while cleared[index] < way.last() && way.at_m(cleared[index]) < wanted && may(cleared[index] + 1)
            {
                cleared[index] += 1;
            }
            let there = wanted.min(way.at_m(cleared[index])).max(here);
            moved |= there > here;
            let place = way.place(there);
            if place > at[index] && place < way.last() && way.gears[place] != way.gears[place + 1] {
                pause[index] = GEAR_TICKS;
            }
            at[index] = place;
            ways[index].push(there);
        }
        if !open {
            return Some(ways);
        }
        if !moved {
            return None;
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;
    use xtb_nav::{Car, MapPose, Path, Piece};

    fn way(x_m: f64, y_m: f64, yaw_rad: f64, length_m: f64) -> DiscretizedPath {
        let mut path = Path::standing(MapPose { x_m, y_m, yaw_rad });
        path.push(Piece { length_m, curvature_per_m: 0.0 });
        DiscretizedPath::new(path, &Car::of(&VehicleConfig::default()))
    }

    fn ticks(way: &DiscretizedPath, from: f64) -> Vec<f64> {
        (0..=way.last()).map(|place| from + way.at_m(place) / TICK_WAY_M).collect()
    }

    /// East through the origin and north through the origin; the second starts `late` ticks later.
    fn crossing(late: f64) -> (DiscretizedPath, DiscretizedPath, Vec<u32>, Vec<u32>) {
        let (east, north) = (way(-2.0, 0.0, 0.0, 4.0), way(0.0, -2.0, std::f64::consts::FRAC_PI_2, 4.0));
        let (a, b) = (ticks(&east, 0.0), ticks(&north, late));
        let timed = |way, ticks| Timed { way, at: 0, held: 0, ticks };
        let (east_needs, north_needs) = pair(&timed(&east, &a), &timed(&north, &b), 0.05);
        (east, north, east_needs, north_needs)
    }

    #[test]
    fn whoever_comes_later_waits_until_the_other_has_left() {
        let (_, _, east_needs, north_needs) = crossing(30.0);
        assert!(east_needs.iter().all(|&need| need == 0));
        // North's front reaches the crossing's south side 0.27 + 2 · 0.05 before its body does.
        let first = north_needs.iter().position(|&need| need > 0).unwrap();
        assert!((15..=26).contains(&first), "{first}");
        assert!(north_needs[first] > 20);
        let (_, _, east_needs, north_needs) = crossing(-30.0);
        assert!(north_needs.iter().all(|&need| need == 0) && east_needs.iter().any(|&need| need > 0));
    }

    #[test]
    fn by_the_order_both_arrive_and_never_touch() {
        let (east, north, east_needs, north_needs) = crossing(20.0);
        let mut order = Order::new();
        set_needs(&mut order, (0, 1), &east_needs);
        set_needs(&mut order, (1, 0), &north_needs);
        assert_eq!(order.len(), 1, "who needs nothing takes no room");
        let runners = [Runner { id: 0, way: &east, done_m: 0.0 }, Runner { id: 1, way: &north, done_m: 0.0 }];
        let ways = run_ahead(&runners, &order, 1000).unwrap();
        for tick in 0..ways[0].len().max(ways[1].len()) {
            let at = |index: usize, way: &DiscretizedPath| {
                way.stands[way.place(*ways[index].get(tick).unwrap_or(&4.0))]
            };
            assert!(!at(0, &east).touches(&at(1, &north), 0.0), "tick {tick}");
        }
        assert!((ways[0][ways[0].len() - 1] - 4.0).abs() < 1e-9);
    }

    #[test]
    fn an_order_in_which_each_waits_for_the_other_is_seen() {
        let (east, north) = (way(-2.0, 0.0, 0.0, 4.0), way(0.0, -2.0, 1.57, 4.0));
        let mut order = Order::new();
        let after_30: Vec<u32> = (0..=80).map(|place| if place > 30 { 40 } else { 0 }).collect();
        set_needs(&mut order, (0, 1), &after_30);
        set_needs(&mut order, (1, 0), &after_30);
        let runners = [Runner { id: 0, way: &east, done_m: 0.0 }, Runner { id: 1, way: &north, done_m: 0.0 }];
        assert_eq!(run_ahead(&runners, &order, 1000), None);
    }
}
