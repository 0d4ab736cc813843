//! Hybrid A*, once for live traffic control and for plans beforehand: best first over poses that stay as they
//! are driven to. What else a node is (when it is reached, how long it may stay, what contacts have cost), where it
//! leads and which of two is as good as the other is its kind's.
//!
//! D. Dolgov, S. Thrun, M. Montemerlo and J. Diebel, *Path planning for autonomous vehicles in unknown
//! semi-structured environments*, IJRR 29 (2010).

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// A kind of nodes.
pub(crate) trait Expand {
    type Node;

    /// Whether the search ends here.
    fn is_goal(&self, node: &Self::Node) -> bool;

    /// Pushes all that a node leads to.
    fn expand(&mut self, tree: &mut Tree<Self::Node>, index: u32);
}

/// Why a search ended without a goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    /// All that can be reached has been seen.
    Nowhere,
    /// Not enough expansions.
    Budget,
}

const ROOT: u32 = u32::MAX;

/// All nodes of one search, and those that wait to be expanded.
#[derive(Debug)]
pub(crate) struct Tree<N> {
    nodes: Vec<N>,
    parents: Vec<u32>,
    open: BinaryHeap<Reverse<(u64, u32)>>,
    /// How many were expanded.
    pub(crate) expanded: u32,
}

impl<N> Tree<N> {
    pub(crate) const fn new() -> Self {
        Self { nodes: Vec::new(), parents: Vec::new(), open: BinaryHeap::new(), expanded: 0 }
    }

    /// Begins anew, with this node.
    pub(crate) fn plant(&mut self, root: N, estimate: u64) {
        self.nodes.clear();
        self.parents.clear();
        self.open.clear();
        self.expanded = 0;
        self.push(ROOT, root, estimate);
    }

    /// Adds a node. The least estimate is looked at first, of equal ones the oldest.
    #[inline]
    pub(crate) fn push(&mut self, parent: u32, node: N, estimate: u64) {
        self.open.push(Reverse((estimate, self.nodes.len() as u32)));
        self.nodes.push(node);
        self.parents.push(parent);
    }

    #[inline]
    pub(crate) fn node(&self, index: u32) -> &N {
        &self.nodes[index as usize]
    }

    /// From the root to a node.
    pub(crate) fn chain(&self, index: u32) -> Vec<&N> {
        let next = |&at: &u32| Some(self.parents[at as usize]).filter(|&parent| parent != ROOT);
        let mut chain: Vec<&N> = std::iter::successors(Some(index), next).map(|at| self.node(at)).collect();
        chain.reverse();
        chain
    }

    /// The goal that is found first; every node that is expanded counts one down in `budget`. With more of it the
    /// search goes on.
    pub(crate) fn search(&mut self, kind: &mut impl Expand<Node = N>, budget: &mut u32) -> Result<u32, End> {
        while let Some(&Reverse((_, index))) = self.open.peek() {
            if kind.is_goal(self.node(index)) {
                return Ok(index);
            }
            *budget = budget.checked_sub(1).ok_or(End::Budget)?;
            self.open.pop();
            self.expanded += 1;
            kind.expand(self, index);
        }
        Err(End::Nowhere)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers that lead to their double and to one more, at a cost of one.
    struct Numbers(u64);

    impl Expand for Numbers {
        type Node = (u64, u64);

        fn is_goal(&self, node: &(u64, u64)) -> bool {
            node.0 == self.0
        }

        fn expand(&mut self, tree: &mut Tree<(u64, u64)>, index: u32) {
            let (number, cost) = *tree.node(index);
            for next in [2 * number, number + 1].into_iter().filter(|&next| next <= self.0) {
                tree.push(index, (next, cost + 1), cost + 1);
            }
        }
    }

    #[test]
    fn the_cheapest_way_is_found_within_its_budget_or_it_says_why_not() {
        let mut tree = Tree::new();
        let mut search = |from, most: u32| {
            tree.plant((from, 0), 0);
            let mut budget = most;
            let found = tree.search(&mut Numbers(10), &mut budget);
            assert_eq!(tree.expanded, most - budget);
            found.map(|goal| tree.chain(goal).iter().map(|node| node.0).collect::<Vec<_>>())
        };
        assert_eq!(search(1, 1000), Ok(vec![1, 2, 4, 5, 10]));
        assert_eq!(search(1, 3), Err(End::Budget));
        assert_eq!(search(11, 3), Err(End::Nowhere));
        // In two parts as in one.
        let mut in_parts = |parts: &[u32]| {
            tree.plant((1, 0), 0);
            let mut found = Err(End::Nowhere);
            parts.iter().for_each(|&part| found = tree.search(&mut Numbers(10), &mut { part }));
            (found, tree.expanded, tree.nodes.len())
        };
        assert_eq!(in_parts(&[3, 1000]), in_parts(&[1003]));
        assert_eq!(in_parts(&[1, 1, 1000]), in_parts(&[1002]));
    }
}
