//! Where everybody is expected while the trucks of a job get their ways one by one.

use super::arrival_times::{arrival_times, to_release};
use super::discretized_path::DiscretizedPath;
use super::job::Member;
use super::occupancy::Occupancy;
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;
use xtb_nav::geometry::rect::Rect;

/// A truck that has still to leave its place is not driven through so many ticks longer, 3 s; chosen, not
/// measured.
const GRACE_TICKS: u32 = 12;

/// Where everybody is expected while ways are looked for one by one.
#[derive(Clone, Default)]
pub(super) struct Expected {
    /// By member. Those without a way yet leave their places some time.
    pub(super) lines: BTreeMap<usize, Rc<Occupancy>>,
    pub(super) times: BTreeMap<usize, Rc<Vec<f64>>>,
    /// The places of those without a way yet.
    pub(super) soft: BTreeMap<usize, Rect>,
    pub(super) ways: BTreeMap<usize, Arc<DiscretizedPath>>,
}

impl Expected {
    /// The lines of all others; what is told twice of one holds twice.
    pub(super) fn others(&self, index: usize) -> Vec<(usize, &Occupancy)> {
        self.lines
            .iter()
            .filter(|(other, _)| **other != index)
            .map(|(other, line)| (*other, &**line))
            .collect()
    }

    /// Places of those without a way yet, but for these.
    pub(super) fn soft(&self, but: &[usize]) -> Vec<Rect> {
        self.soft.iter().filter(|(index, _)| !but.contains(index)).map(|(_, rect)| *rect).collect()
    }

    /// Bodies of the others all along their ways.
    pub(super) fn taken(&self, index: usize) -> impl Iterator<Item = Rect> {
        let lines = self.lines.iter().filter(move |(other, _)| **other != index);
        lines.flat_map(|(_, line)| line.bodies())
    }

    /// This one is not on its way any more, and leaves its place some time.
    pub(super) fn leave(&mut self, index: usize, member: &Member) {
        let gone = to_release(member).len() as u32 + GRACE_TICKS;
        self.lines.insert(index, Rc::new(Occupancy::leaving(member.held_stands(), gone)));
        self.soft.insert(index, member.way.stands[member.held].body);
    }

    /// From now on this one goes so, with its position at each tick.
    pub(super) fn take(&mut self, index: usize, way: DiscretizedPath, at_m: &[f64], line: Occupancy) {
        self.soft.remove(&index);
        self.times.insert(index, Rc::new(arrival_times(&way, at_m)));
        self.lines.insert(index, Rc::new(line));
        self.ways.insert(index, Arc::new(way));
    }
}
