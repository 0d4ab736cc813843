//! The order that a robot has: base, horizon, and how updates fit on it.

use crate::incoming::{Edge, MAX_NODES, Node, Order};
use crate::problem::{Problem, ProblemKind};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use xtb_protocol::messages::Waypoint;

/// A robot is at the first node of an order within so many m, even if the node allows less: an arrival is no more
/// exact than this at worst. Chosen, not measured.
pub const START_RADIUS_M: f64 = 0.5;

/// The order that a robot has, or had last.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct ActiveOrder {
    /// Its name; empty = there was none yet.
    pub id: String,
    /// Number of its last update.
    pub update: u32,
    /// What that update said.
    pub digest: String,
    /// Nodes that were not traversed: base, then horizon.
    pub nodes: Vec<Node>,
    /// Edges that were not traversed.
    pub edges: Vec<Edge>,
    /// The last node that was traversed, of this order or before, and its place; empty = none.
    pub last_node: (String, u32),
    /// It was cancelled: no update of it is taken.
    pub cancelled: bool,
}

/// How a received order stands to the one that there is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Relation {
    /// The same again.
    Repeated,
    /// A new one.
    New,
    /// An update that fits.
    Update,
}

/// What an order says, to be compared with another one of the same numbers.
#[must_use]
pub fn digest(order: &Order) -> String {
    let content = serde_json::to_vec(&(&order.nodes, &order.edges)).unwrap_or_default();
    Sha256::digest(content).iter().take(16).map(|byte| format!("{byte:02x}")).collect()
}

/// The points of nodes, but for the first one; those of the base.
#[must_use]
pub fn new_points(order: &Order) -> Vec<Waypoint> {
    let base = order.nodes.iter().skip(1).take_while(|node| node.released);
    base.filter_map(point).collect()
}

fn point(node: &Node) -> Option<Waypoint> {
    let position = node.node_position.as_ref()?;
    Some(Waypoint { x_m: position.x, y_m: position.y, yaw_rad: position.theta })
}

impl ActiveOrder {
    /// Whether nothing of it is left to be done or waited for.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.nodes.is_empty() && self.edges.is_empty()
    }

    /// Nodes of the base that are left.
    #[must_use]
    pub fn base(&self) -> usize {
        self.nodes.iter().take_while(|node| node.released).count()
    }

    /// Where the base ends.
    fn decision_point(&self) -> (&str, u32) {
        match self.base() {
            0 => (&self.last_node.0, self.last_node.1),
            base => (&self.nodes[base - 1].node_id, self.nodes[base - 1].sequence_id),
        }
    }

    /// How a received order stands to this one.
    ///
    /// # Errors
    /// Why it is not taken.
    pub fn relation(&self, order: &Order, is_v3: bool) -> Result<Relation, Problem> {
        let refused = |kind, text: String| {
            let problem = Problem::new(kind, text).with("orderId", &order.order_id);
            Err(problem.with("orderUpdateId", order.order_update_id).with("topic", "order"))
        };
        if order.order_id != self.id {
            if !self.is_finished() {
                let text = format!("the order {} is not finished", self.id);
                return refused(ProblemKind::OtherOrderActive, text);
            }
            if is_v3 && order.order_update_id != 0 {
                let text = format!("orderUpdateId {} of a new order is not 0", order.order_update_id);
                return refused(ProblemKind::NotStitching, text);
            }
            return Ok(Relation::New);
        }
        if order.order_update_id < self.update {
            let text = format!("the present orderUpdateId is {}", self.update);
            return refused(ProblemKind::OutdatedUpdate, text);
        }
        if order.order_update_id == self.update {
            if self.digest == digest(order) {
                return Ok(Relation::Repeated);
            }
            return refused(ProblemKind::SameUpdate, "another order under the same numbers".to_owned());
        }
        if self.cancelled {
            return refused(ProblemKind::FollowingCancel, "the order was cancelled".to_owned());
        }
        let (id, sequence) = self.decision_point();
        let Some(first) =
            order.nodes.first().filter(|first| (first.node_id.as_str(), first.sequence_id) == (id, sequence))
        else {
            return refused(
                ProblemKind::NotStitching,
                format!("the base ends at node {id}, sequenceId {sequence}"),
            );
        };
        let rest = self.base() + order.nodes.len();
        if rest > MAX_NODES {
            return refused(ProblemKind::TooLarge, format!("{rest} nodes after {}", first.node_id));
        }
        Ok(Relation::Update)
    }

    /// Takes an order that fits: the first node of a new one counts as traversed, an update goes on the base.
    pub fn take(&mut self, order: Order) {
        let is_update = order.order_id == self.id;
        let digest = digest(&order);
        let Order { order_id, order_update_id, nodes, edges, .. } = order;
        let base = if is_update { self.base() } else { 0 };
        self.nodes.truncate(base);
        self.edges.retain(|edge| is_update && edge.released);
        let mut nodes = nodes.into_iter();
        if let Some(first) = nodes.next().filter(|_| !is_update) {
            self.last_node = (first.node_id, first.sequence_id);
        }
        self.nodes.extend(nodes);
        self.edges.extend(edges);
        (self.id, self.update, self.digest, self.cancelled) = (order_id, order_update_id, digest, false);
    }

    /// The next node of the base was traversed, and with it the edge to it.
    pub fn traverse(&mut self) {
        if self.base() == 0 {
            return;
        }
        let node = self.nodes.remove(0);
        self.edges.retain(|edge| edge.sequence_id > node.sequence_id);
        self.last_node = (node.node_id, node.sequence_id);
    }

    /// It is over: nothing of it is driven any more.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.edges.clear();
        self.cancelled = true;
    }
}
