//! The way of one car in space and time, around the tracks of others: A* over steps.
//!
//! A node is a pose in a step; it leads on by six moves, by waiting, and by a Reeds–Shepp shot to the
//! goal. Two nodes are the same if square, sector and moment are: as long as a car can stand somewhere
//! only its first arrival counts (M. Phillips and M. Likhachev, *SIPP*, ICRA 2011). Other cars are walls,
//! cost something, or are ignored.

use super::closed::Closed;
use super::driver::Driver;
use super::motion::{Spot, WAIT};
use super::scene::Scene;
use super::shot;
use super::table::{Table, Track};
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use xtb_nav::Piece;

/// Cost of a step; the other costs are parts of it.
pub(crate) const STEP: u32 = 32;
/// Driving costs a little more than waiting, astern more than ahead, and a change of gear more.
const DRIVE: u32 = 1;
const ASTERN: u32 = 2;
const GEAR_CHANGE: u32 = 12;
/// Farther than this from the goal no shot is tried, in steps.
const SHOT_WITHIN: u32 = 12;
/// Nearer than this every node tries one, farther away one in [`SHOT_EVERY`].
const SHOT_ALWAYS: u32 = 4;
const SHOT_EVERY: usize = 4;
/// A shot may be this much longer than the compass says, in steps.
const SHOT_DETOUR: u32 = 4;
/// Steps in each other's way that are counted when a goal is taken for good.
const MOST_CLASHES: u32 = 16;

/// What another car is to the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Rank {
    /// Not there.
    Ignored,
    /// Each step of contact costs something.
    Soft,
    /// A wall.
    Hard,
}

/// A move of another car that must not be met, whatever that car's rank.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Ghost {
    pub(crate) car: usize,
    pub(crate) step: usize,
    pub(crate) spot: Spot,
    pub(crate) piece: Piece,
    /// It stands there for good.
    pub(crate) stays: bool,
}

/// What is asked for.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Query<'q> {
    pub(crate) me: usize,
    /// Of each car.
    pub(crate) ranks: &'q [Rank],
    pub(crate) ghosts: &'q [Ghost],
    /// Cost of a step of contact with a soft car.
    pub(crate) clash: u32,
    /// How much the compass is trusted, in percent; 100 finds the shortest way.
    pub(crate) greed: u32,
    /// Nodes after which it gives up.
    pub(crate) most_nodes: usize,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    spot: Spot,
    piece: Piece,
    step: u32,
    parent: u32,
    /// Cost beyond the steps.
    extra: u32,
    to_go: u32,
    gear: i8,
    square: u32,
}

/// A shot that came through.
#[derive(Debug)]
struct Shot {
    node: u32,
    waits: usize,
    pieces: Vec<Piece>,
}

const ROOT: u32 = u32::MAX;
/// Bit of a heap entry that is a shot.
const SHOT: u32 = 1 << 31;

/// The search's memory, kept from one search to the next.
#[derive(Debug)]
pub(crate) struct Search {
    nodes: Vec<Node>,
    open: BinaryHeap<Reverse<(u32, u32, u32)>>,
    closed: Closed,
    shots: Vec<Shot>,
    /// Steps of contact with soft cars from each step on, for who stands at the goal.
    clashes: Vec<u32>,
    /// Nodes expanded so far in all searches.
    pub(crate) expanded: u64,
}

impl Search {
    pub(crate) fn new() -> Self {
        Self {
            nodes: Vec::new(),
            open: BinaryHeap::new(),
            closed: Closed::new(),
            shots: Vec::new(),
            clashes: Vec::new(),
            expanded: 0,
        }
    }

    /// A track to the goal, or `None`: there is none, or the nodes are used up.
    pub(crate) fn run(&mut self, scene: &Scene, table: &Table<'_>, query: &Query<'_>) -> Option<Track> {
        self.nodes.clear();
        self.open.clear();
        self.closed.clear();
        self.shots.clear();
        let driver = &scene.drivers[query.me];
        let world = World { scene, table, query, driver };
        let goal_opens = world.goal_opens(&mut self.clashes)?;
        let to_go = u32::from(driver.to_goal.steps(&driver.start)?);
        let square = scene.lattice.square(driver.start.x, driver.start.y) as u32;
        let root =
            Node { spot: driver.start, piece: WAIT, step: 0, parent: ROOT, extra: 0, to_go, gear: 0, square };
        self.push(&world, root, goal_opens);
        let mut expanded = 0;
        while let Some(Reverse((_, _, index))) = self.open.pop() {
            if index & SHOT != 0 {
                return Some(self.track(driver, (index & !SHOT) as usize));
            }
            expanded += 1;
            self.expanded += 1;
            if expanded > query.most_nodes {
                return None;
            }
            self.expand(&world, index, goal_opens, expanded);
        }
        None
    }

    fn push(&mut self, world: &World<'_>, node: Node, goal_opens: u32) {
        let reach = node.step * STEP + node.to_go * STEP * world.query.greed / 100;
        let estimate = node.extra + reach.max(goal_opens * STEP);
        let index = self.nodes.len() as u32;
        self.nodes.push(node);
        self.open.push(Reverse((estimate, node.to_go, index)));
    }

    fn expand(&mut self, world: &World<'_>, index: u32, goal_opens: u32, expanded: usize) {
        let node = self.nodes[index as usize];
        let step = node.step as usize;
        let near = node.to_go <= SHOT_WITHIN;
        if near && (node.to_go <= SHOT_ALWAYS || expanded.is_multiple_of(SHOT_EVERY)) {
            self.shoot(world, index, goal_opens);
        }
        if step + 2 >= world.scene.horizon || self.nodes.len() >= SHOT as usize - 8 {
            return;
        }
        let mut hindered = false;
        for piece in &world.driver.moves {
            let spot = node.spot.after(piece, 1.0);
            if !world.scene.floor.inside(spot.x, spot.y) {
                continue;
            }
            let square = world.scene.lattice.square(spot.x, spot.y);
            let Some(to_go) = world.driver.to_goal.steps(&spot) else { continue };
            let gear = if piece.length_m > 0.0 { 1 } else { -1 };
            let mut extra = node.extra + DRIVE + if gear < 0 { ASTERN } else { 0 };
            if gear * node.gear < 0 {
                extra += GEAR_CHANGE;
            }
            let key = world.key(square, &spot, step + 1);
            let cost = |extra: u32| (node.step + 1) * STEP + extra;
            if self.closed.get(key).is_some_and(|best| best <= cost(extra)) {
                continue;
            }
            if !world.may_drive(&node.spot, piece) {
                continue;
            }
            let Some(clashes) = world.clashes(&node.spot, piece, step) else {
                hindered = true;
                continue;
            };
            hindered |= clashes > 0;
            extra += clashes * world.query.clash;
            if clashes > 0 && self.closed.get(key).is_some_and(|best| best <= cost(extra)) {
                continue;
            }
            self.closed.put(key, cost(extra));
            let (step, to_go, square) = (node.step + 1, u32::from(to_go), square as u32);
            self.push(
                world,
                Node { spot, piece: *piece, step, parent: index, extra, to_go, gear, square },
                goal_opens,
            );
        }
        if hindered || world.table.busy_later(node.square as usize, step) {
            self.wait(world, index, goal_opens);
        }
    }

    /// Stays for a step. Where nobody is near, waiting leads to the same state: it is kept all the same,
    /// because what comes next may be free only later.
    fn wait(&mut self, world: &World<'_>, index: u32, goal_opens: u32) {
        let node = self.nodes[index as usize];
        let step = node.step as usize;
        let Some(clashes) = world.clashes(&node.spot, &WAIT, step) else { return };
        let extra = node.extra + clashes * world.query.clash;
        let square = node.square as usize;
        let (now, then) = (world.key(square, &node.spot, step), world.key(square, &node.spot, step + 1));
        if now != then {
            let cost = (node.step + 1) * STEP + extra;
            if self.closed.get(then).is_some_and(|best| best <= cost) {
                return;
            }
            self.closed.put(then, cost);
        }
        self.push(world, Node { piece: WAIT, step: node.step + 1, parent: index, extra, ..node }, goal_opens);
    }

    /// Tries to drive straight to the goal, now or so that it is reached when it becomes free.
    fn shoot(&mut self, world: &World<'_>, index: u32, goal_opens: u32) {
        let node = self.nodes[index as usize];
        let Scene { step: length, horizon, .. } = world.scene;
        for path in shot::words(world.driver, &node.spot, *length, (node.to_go + SHOT_DETOUR) as usize) {
            let pieces = shot::cut(&path, *length);
            let waits = (goal_opens as usize).saturating_sub(node.step as usize + pieces.len());
            let arrival = node.step as usize + waits + pieces.len();
            if arrival + 1 >= *horizon {
                continue;
            }
            let (mut spot, mut step) = (node.spot, node.step as usize);
            let (mut extra, mut gear) = (node.extra, node.gear);
            let came_through = std::iter::repeat_n(&WAIT, waits).chain(&pieces).all(|piece| {
                let drives = piece.length_m != 0.0;
                if drives && !world.may_drive(&spot, piece) {
                    return false;
                }
                let Some(clashes) = world.clashes(&spot, piece, step) else { return false };
                extra += clashes * world.query.clash;
                if drives {
                    let next = if piece.length_m > 0.0 { 1 } else { -1 };
                    extra += DRIVE + if next < 0 { ASTERN } else { 0 };
                    extra += if next * gear < 0 { GEAR_CHANGE } else { 0 };
                    gear = next;
                }
                (spot, step) = (spot.after(piece, 1.0), step + 1);
                true
            });
            if !came_through {
                continue;
            }
            let clashes = self.clashes.get(arrival).copied().unwrap_or(0).min(MOST_CLASHES);
            let cost = arrival as u32 * STEP + extra + clashes * world.query.clash;
            let shot = self.shots.len() as u32 | SHOT;
            self.shots.push(Shot { node: index, waits, pieces });
            self.open.push(Reverse((cost, 0, shot)));
            return;
        }
    }

    fn track(&self, driver: &Driver, shot: usize) -> Track {
        let Shot { node, waits, pieces } = &self.shots[shot];
        let mut way = Vec::new();
        let mut at = *node;
        while at != ROOT {
            let node = &self.nodes[at as usize];
            if node.parent != ROOT {
                way.push(node.piece);
            }
            at = node.parent;
        }
        way.reverse();
        way.extend(std::iter::repeat_n(WAIT, *waits));
        way.extend(pieces);
        Track::new(driver.start, way)
    }
}

/// What one search looks at.
struct World<'a> {
    scene: &'a Scene,
    table: &'a Table<'a>,
    query: &'a Query<'a>,
    driver: &'a Driver,
}

impl World<'_> {
    /// Whether nothing that stays as it is forbids this piece.
    #[inline]
    fn may_drive(&self, spot: &Spot, piece: &Piece) -> bool {
        let (floor, driver) = (&self.scene.floor, self.driver);
        floor.clear(&driver.body, spot, piece, &driver.keep) && floor.allows(spot, piece)
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
        let haunted = || {
            self.query.ghosts.iter().any(|ghost| {
                let now = ghost.step == step || ghost.stays && ghost.step < step;
                now && !self.scene.pass((self.query.me, spot, piece), (ghost.car, &ghost.spot, &ghost.piece))
            })
        };
        if hard || haunted() { None } else { Some(soft) }
    }

    /// The first step from which on the goal can be kept for good, and the clashes from each step on.
    /// `None` where it never can.
    fn goal_opens(&self, clashes: &mut Vec<u32>) -> Option<u32> {
        let goal = Spot::new(&self.driver.goal);
        let ghosts = self.query.ghosts.iter().map(|ghost| ghost.step).max().unwrap_or(0);
        let last = self.table.steps().max(ghosts).min(self.scene.horizon - 1);
        clashes.clear();
        clashes.resize(last + 1, 0);
        let mut later = 0;
        for step in (0..=last).rev() {
            let Some(now) = self.clashes(&goal, &WAIT, step) else {
                return (step < last).then_some(step as u32 + 1);
            };
            // Whom it meets where both stand for good it would meet for ever.
            later += if step == last { now * MOST_CLASHES } else { now };
            clashes[step] = later;
        }
        Some(0)
    }
}
