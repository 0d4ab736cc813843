//! The way of one car in space and time, around the tracks of others: A* over steps.
//!
//! A node is a pose in a step; it leads on by six moves, by waiting, and by a Reeds–Shepp shot to the
//! goal. Two nodes are the same if square, sector and moment are: as long as a car can stand somewhere
//! only its first arrival counts (M. Phillips and M. Likhachev, *SIPP*, ICRA 2011). Other cars are walls,
//! cost something, or are ignored.

use super::analytic_expansion;
use super::closed::Closed;
use super::driver::Driver;
use super::instance::Instance;
use super::motion::{Spot, WAIT};
use super::query::{Query, Rank};
use super::table::{Table, Track};
use super::time_to_go::TimeToGo;
use crate::hybrid_a_star::{End, Expand, Tree};
use xtb_nav::Piece;

/// Cost of a step; the other costs are parts of it, chosen, not measured.
const STEP: u32 = 32;
/// Driving costs a little more than waiting, …
const DRIVE: u32 = 1;
/// … astern more than ahead, …
const ASTERN: u32 = 2;
/// … and a change of gear more.
const GEAR_CHANGE: u32 = 12;
/// Farther than this from the goal no shot is tried, in steps; chosen, not measured.
const SHOT_WITHIN: u32 = 12;
/// Nearer than this every node tries one, …
const SHOT_ALWAYS: u32 = 4;
/// … farther away one in so many; both chosen, not measured.
const SHOT_EVERY: u32 = 4;
/// A shot may be this much longer than the heuristic says, in steps; chosen, not measured.
const SHOT_DETOUR: u32 = 4;
/// Steps in each other's way that are counted when a goal is taken for good; chosen, not measured.
const MOST_CLASHES: u32 = 16;
/// Nodes after which a search computes when the others let it through, and begins anew, …
const BLIND_NODES: u32 = 200;
/// … unless that takes more than such a part of the time that it has; both chosen, not measured.
const WORTH: u32 = 4;

#[derive(Debug, Clone, Copy)]
struct Node {
    spot: Spot,
    piece: Piece,
    step: u32,
    /// Cost beyond the steps.
    extra: u32,
    to_go: u32,
    gear: i8,
    square: u32,
    /// The last stretch to the goal, if this is one; by number.
    last: Option<u32>,
}

/// The search's memory, kept from one search to the next.
#[derive(Debug)]
pub(crate) struct Search {
    tree: Tree<Node>,
    closed: Closed,
    /// Last stretches that came through.
    last: Vec<Vec<Piece>>,
    /// Steps of contact with soft cars from each step on, for who stands at the goal.
    at_goal: Vec<u32>,
    time_to_go: TimeToGo,
}

impl Search {
    pub(crate) fn new() -> Self {
        Self {
            tree: Tree::new(),
            closed: Closed::default(),
            last: Vec::new(),
            at_goal: Vec::new(),
            time_to_go: TimeToGo::default(),
        }
    }

    /// A track to the goal, or `None`: there is none, or the nodes are used up.
    pub(crate) fn run(&mut self, instance: &Instance, table: &Table<'_>, query: &Query<'_>) -> Option<Track> {
        let Self { tree, closed, last, at_goal, time_to_go } = self;
        closed.clear();
        last.clear();
        let (driver, clash) = (&instance.drivers[query.me], query.manner.clash_steps * STEP);
        let mut world = World {
            instance,
            table,
            query,
            driver,
            closed,
            last,
            at_goal,
            time_to_go: None,
            clash,
            goal_opens: 0,
        };
        world.goal_opens = world.goal_opens()?;
        let (spot, to_go) = (driver.start, u32::from(driver.to_goal.steps(&driver.start)?));
        let square = instance.lattice.square(spot.x, spot.y) as u32;
        let root = Node { spot, piece: WAIT, step: 0, extra: 0, to_go, gear: 0, square, last: None };
        tree.plant(root, world.estimate(&root));
        let most = query.manner.most_nodes;
        let price = time_to_go.measure(instance, table, query, world.goal_opens);
        let pays = price.is_some_and(|nodes| nodes <= most / WORTH);
        let blind = if pays { BLIND_NODES.min(most) } else { most };
        let mut found = tree.search(&mut world, &mut { blind });
        if found == Err(End::Budget) && most > blind {
            time_to_go.fill(instance, table, query, world.goal_opens);
            // Otherwise the others do not hold it up.
            if time_to_go.at(square as usize, 0) > to_go {
                world.time_to_go = Some(time_to_go);
                world.closed.clear();
                world.last.clear();
                tree.plant(root, world.estimate(&root));
            }
            found = tree.search(&mut world, &mut (most - blind));
        }
        let goal = found.ok()?;
        let chain = tree.chain(goal);
        let mut way: Vec<Piece> = chain[1..chain.len() - 1].iter().map(|node| node.piece).collect();
        way.extend(chain[chain.len() - 1].last.iter().flat_map(|&last| &world.last[last as usize]));
        Some(Track::new(driver.start, way))
    }
}

/// What one search looks at, and what it remembers.
struct World<'a> {
    instance: &'a Instance,
    table: &'a Table<'a>,
    query: &'a Query<'a>,
    driver: &'a Driver,
    closed: &'a mut Closed,
    last: &'a mut Vec<Vec<Piece>>,
    at_goal: &'a mut Vec<u32>,
    /// Around the others, if that was computed.
    time_to_go: Option<&'a TimeToGo>,
    /// Cost of a step of contact with a soft car.
    clash: u32,
    /// The step from which on the goal can be kept.
    goal_opens: u32,
}

impl Expand for World<'_> {
    type Node = Node;

    fn is_goal(&self, node: &Node) -> bool {
        node.last.is_some()
    }

    fn expand(&mut self, tree: &mut Tree<Node>, index: u32) {
        let node = *tree.node(index);
        let step = node.step as usize;
        let near = node.to_go <= SHOT_WITHIN;
        if near && (node.to_go <= SHOT_ALWAYS || tree.expanded.is_multiple_of(SHOT_EVERY)) {
            self.shoot(tree, index, &node);
        }
        if step + 2 >= self.instance.horizon {
            return;
        }
        let mut hindered = false;
        let driver = self.driver;
        for piece in &driver.moves {
            let spot = node.spot.after(piece, 1.0);
            if !self.instance.obstacles.inside(spot.x, spot.y) {
                continue;
            }
            let square = self.instance.lattice.square(spot.x, spot.y);
            let Some(to_go) = driver.to_goal.steps(&spot) else { continue };
            if node.step + 1 + u32::from(to_go) > self.query.manner.most_steps {
                continue;
            }
            let gear = if piece.length_m > 0.0 { 1 } else { -1 };
            let mut extra = node.extra + driving(gear, node.gear);
            let key = self.key(square, &spot, step + 1);
            let is_late = |closed: &Closed, extra: u32| {
                closed.get(&key).is_some_and(|&best| best <= (node.step + 1) * STEP + extra)
            };
            if is_late(self.closed, extra) || !self.may_drive(&node.spot, piece) {
                continue;
            }
            let Some(clashes) = self.clashes(&node.spot, piece, step) else {
                hindered = true;
                continue;
            };
            hindered |= clashes > 0;
            extra += clashes * self.clash;
            if clashes > 0 && is_late(self.closed, extra) {
                continue;
            }
            let (step, to_go, square) = (node.step + 1, u32::from(to_go), square as u32);
            self.closed.insert(key, step * STEP + extra);
            let next = Node { spot, piece: *piece, step, extra, to_go, gear, square, last: None };
            tree.push(index, next, self.estimate(&next));
        }
        if hindered || self.table.busy_later(node.square as usize, step) {
            self.wait(tree, index, &node);
        }
    }
}

/// What a step costs that is driven in this gear after that one.
fn driving(gear: i8, before: i8) -> u32 {
    DRIVE + if gear < 0 { ASTERN } else { 0 } + if gear * before < 0 { GEAR_CHANGE } else { 0 }
}

impl World<'_> {
    fn estimate(&self, node: &Node) -> u64 {
        let around = self.time_to_go.map_or(0, |it| it.at(node.square as usize, node.step as usize));
        let to_go = node.to_go.max(around);
        let reach = node.step * STEP + to_go * STEP * self.query.manner.heuristic_weight / 100;
        ranked(node.extra + reach.max(self.goal_opens * STEP), node.to_go)
    }

    /// Stays for a step. Where nobody is near, waiting leads to the same state: it is kept all the same,
    /// because what comes next may be free only later.
    fn wait(&mut self, tree: &mut Tree<Node>, index: u32, node: &Node) {
        let step = node.step as usize;
        let Some(clashes) = self.clashes(&node.spot, &WAIT, step) else { return };
        let extra = node.extra + clashes * self.clash;
        let square = node.square as usize;
        let (now, then) = (self.key(square, &node.spot, step), self.key(square, &node.spot, step + 1));
        if now != then {
            let cost = (node.step + 1) * STEP + extra;
            if self.closed.get(&then).is_some_and(|&best| best <= cost) {
                return;
            }
            self.closed.insert(then, cost);
        }
        if node.step + 1 + node.to_go > self.query.manner.most_steps {
            return;
        }
        let next = Node { piece: WAIT, step: node.step + 1, extra, ..*node };
        tree.push(index, next, self.estimate(&next));
    }

    /// Tries to drive straight to the goal, now or so that it is reached when it becomes free.
    fn shoot(&mut self, tree: &mut Tree<Node>, index: u32, node: &Node) {
        let Instance { step: length, horizon, .. } = *self.instance;
        let most = (node.to_go + SHOT_DETOUR) as usize;
        for path in analytic_expansion::words(self.driver, &node.spot, length, most) {
            let mut pieces = analytic_expansion::cut(&path, length);
            let waits = (self.goal_opens as usize).saturating_sub(node.step as usize + pieces.len());
            pieces.splice(..0, std::iter::repeat_n(WAIT, waits));
            let arrival = node.step as usize + pieces.len();
            if arrival + 1 >= horizon {
                continue;
            }
            let (mut spot, mut step) = (node.spot, node.step as usize);
            let (mut extra, mut gear) = (node.extra, node.gear);
            let came_through = pieces.iter().all(|piece| {
                let drives = piece.length_m != 0.0;
                if drives && !self.may_drive(&spot, piece) {
                    return false;
                }
                let Some(clashes) = self.clashes(&spot, piece, step) else { return false };
                extra += clashes * self.clash;
                if drives {
                    let next = if piece.length_m > 0.0 { 1 } else { -1 };
                    extra += driving(next, gear);
                    gear = next;
                }
                (spot, step) = (spot.after(piece, 1.0), step + 1);
                true
            });
            if !came_through {
                continue;
            }
            let clashes = self.at_goal.get(arrival).copied().unwrap_or(0).min(MOST_CLASHES);
            let cost = arrival as u32 * STEP + extra + clashes * self.clash;
            let last = Some(self.last.len() as u32);
            self.last.push(pieces);
            // Behind all others that promise as much.
            tree.push(index, Node { last, ..*node }, ranked(cost, 0) | 1);
            return;
        }
    }

    /// Whether nothing that stays as it is forbids this piece.
    #[inline]
    fn may_drive(&self, spot: &Spot, piece: &Piece) -> bool {
        let (obstacles, driver) = (&self.instance.obstacles, self.driver);
        obstacles.clear(&driver.body, spot, piece, &driver.keep) && obstacles.allows(spot, piece)
    }

    #[inline]
    fn key(&self, square: usize, spot: &Spot, step: usize) -> u64 {
        let place = self.driver.to_goal.state(spot) as u64;
        place << 24 | u64::from(self.moment(square, spot, step))
    }

    /// Since when a car could have stood there: arriving at any time since is the same, because it could
    /// have come first and waited. Where it is in somebody's way each step is its own.
    fn moment(&self, square: usize, spot: &Spot, step: usize) -> u32 {
        let moment = self.table.moment(square, step);
        if moment & 1 == 0 {
            return moment;
        }
        let stands = |step: usize| self.clashes(spot, &WAIT, step) == Some(0);
        if !stands(step) {
            return moment;
        }
        let mut since = step;
        while since > 0 && stands(since - 1) {
            since -= 1;
        }
        2 * since as u32
    }

    /// Soft cars in the way of this piece; `None` if a hard one is.
    #[inline]
    fn clashes(&self, spot: &Spot, piece: &Piece, step: usize) -> Option<u32> {
        let (mut soft, mut hard) = (0, false);
        self.table.meets(self.query.me, (spot, piece), step, |other| {
            match self.query.ranks[other] {
                Rank::Ignored => {}
                Rank::Soft => soft += 1,
                Rank::Hard => hard = true,
            }
            !hard
        });
        let forbidden = || {
            self.query.constraints.iter().any(|constraint| {
                let now = constraint.step == step || constraint.stays && constraint.step < step;
                now && !self
                    .instance
                    .pass((self.query.me, spot, piece), (constraint.car, &constraint.spot, &constraint.piece))
            })
        };
        if hard || forbidden() { None } else { Some(soft) }
    }

    /// The first step from which on the goal can be kept for good; counts the clashes from each step on.
    /// `None` where it never can.
    fn goal_opens(&mut self) -> Option<u32> {
        let goal = Spot::new(&self.driver.goal);
        let constraints = self.query.constraints.iter().map(|constraint| constraint.step).max().unwrap_or(0);
        let last = self.table.steps().max(constraints).min(self.instance.horizon - 1);
        self.at_goal.clear();
        self.at_goal.resize(last + 1, 0);
        let mut later = 0;
        for step in (0..=last).rev() {
            let Some(now) = self.clashes(&goal, &WAIT, step) else {
                return (step < last).then_some(step as u32 + 1);
            };
            // Whom it meets where both stand for good it would meet for ever.
            later += if step == last { now * MOST_CLASHES } else { now };
            self.at_goal[step] = later;
        }
        Some(0)
    }
}

/// The least cost first, then what is nearest.
fn ranked(cost: u32, to_go: u32) -> u64 {
    u64::from(cost) << 32 | u64::from(to_go) << 1
}
