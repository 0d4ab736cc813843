//! A joint plan that is being made elsewhere, and what it was made from.

use super::job::Member;
use xtb_control::Stamp;

/// A truck as a joint plan was told of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Told {
    pub(super) id: u32,
    pub(super) revision: u64,
    /// It goes on along its way meanwhile.
    pub(super) fixed: bool,
    /// Released to it then.
    pub(super) held: usize,
}

/// A job that is out.
#[derive(Debug)]
pub(super) struct Outstanding {
    pub(super) id: u64,
    pub(super) since: Stamp,
    /// It is a part of those that could meet, not all of them.
    pub(super) is_part: bool,
    /// By ascending id.
    told: Vec<Told>,
}

impl Outstanding {
    pub(super) fn new(id: u64, since: Stamp, is_part: bool, members: &[Member]) -> Self {
        let told = |member: &Member| Told {
            id: member.id,
            revision: member.revision,
            fixed: member.fixed,
            held: member.held,
        };
        let mut told: Vec<Told> = members.iter().map(told).collect();
        told.sort_unstable_by_key(|told| told.id);
        Self { id, since, is_part, told }
    }

    /// What was told of this one.
    pub(super) fn told(&self, id: u32) -> Option<&Told> {
        self.told.binary_search_by_key(&id, |told| told.id).ok().map(|index| &self.told[index])
    }

    pub(super) fn ids(&self) -> impl Iterator<Item = u32> {
        self.told.iter().map(|told| told.id)
    }

    /// Those to whom nothing is released until it is done.
    pub(super) fn frozen(&self) -> impl Iterator<Item = u32> {
        self.told.iter().filter(|told| !told.fixed).map(|told| told.id)
    }
}
