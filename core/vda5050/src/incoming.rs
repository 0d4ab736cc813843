//! Orders and instant actions as a master control sends them: read leniently, checked strictly.
//!
//! Fields that are not used are ignored, whatever they are; what is used is bounded.

use crate::problem::{Problem, ProblemKind};
use crate::protocol::Protocol;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use xtb_protocol::messages::MAX_COORDINATE_M;

/// Longest message that is read, in bytes.
pub const MAX_BYTES: usize = 512 * 1024;
/// Nodes of a message, and of an order's rest, at most.
pub const MAX_NODES: usize = 1000;
/// Actions of a node, an edge or a message at most.
pub const MAX_ACTIONS: usize = 64;
/// Bytes of an id at most.
pub const MAX_ID: usize = 256;

/// Where a node is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct NodePosition {
    /// East, in m.
    pub x: f64,
    /// North, in m.
    pub y: f64,
    /// Yaw on arrival, in rad; `None` = any.
    #[serde(default)]
    pub theta: Option<f64>,
    /// On which map.
    pub map_id: String,
    /// How near counts, in m: a number in 2.x, an ellipse in 3.0.
    #[serde(default, rename = "allowedDeviationXY", alias = "allowedDeviationXy")]
    pub allowed_deviation: Option<Value>,
}

impl NodePosition {
    /// The radius within which a robot is at the node, in m; of an ellipse the smaller axis.
    #[must_use]
    pub fn radius_m(&self) -> f64 {
        let number = |value: &Value| value.as_f64().filter(|m| m.is_finite() && *m >= 0.0);
        match &self.allowed_deviation {
            Some(Value::Object(ellipse)) => {
                let axis = |name| ellipse.get(name).and_then(number).unwrap_or(0.0);
                axis("a").min(axis("b"))
            }
            Some(value) => number(value).unwrap_or(0.0),
            None => 0.0,
        }
    }
}

/// What shall be done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Action {
    /// Which.
    pub action_type: String,
    /// Its name.
    pub action_id: String,
    /// How.
    #[serde(default)]
    pub action_parameters: Option<Vec<Parameter>>,
}

/// One parameter of an action.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// Which.
    pub key: String,
    /// What.
    pub value: Value,
}

impl Action {
    /// The value of a parameter.
    #[must_use]
    pub fn parameter(&self, key: &str) -> Option<&Value> {
        self.action_parameters
            .iter()
            .flatten()
            .find(|parameter| parameter.key == key)
            .map(|found| &found.value)
    }
}

/// A node of an order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Node {
    /// Its name.
    pub node_id: String,
    /// Its place in the order: even.
    pub sequence_id: u32,
    /// Whether it is of the base.
    pub released: bool,
    /// Where it is.
    #[serde(default)]
    pub node_position: Option<NodePosition>,
    /// What to do there.
    #[serde(default)]
    pub actions: Vec<Action>,
}

/// An edge of an order.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Edge {
    /// Its name.
    pub edge_id: String,
    /// Its place in the order: odd.
    pub sequence_id: u32,
    /// Whether it is of the base.
    pub released: bool,
    /// Where it begins; 2.x only.
    #[serde(default)]
    pub start_node_id: Option<String>,
    /// Where it ends; 2.x only.
    #[serde(default)]
    pub end_node_id: Option<String>,
    /// What to do on it.
    #[serde(default)]
    pub actions: Vec<Action>,
    /// A curve to follow: not supported.
    #[serde(default, skip_serializing)]
    pub trajectory: Option<Value>,
    /// How far from it: not supported.
    #[serde(default, skip_serializing)]
    pub corridor: Option<Value>,
    /// A speed limit, in m/s: not supported.
    #[serde(default, skip_serializing)]
    pub maximum_speed: Option<Value>,
    /// A yaw on the way: not supported.
    #[serde(default, skip_serializing)]
    pub orientation: Option<Value>,
}

/// An order, or an update of one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Order {
    /// For whose robot.
    #[serde(default)]
    pub manufacturer: Option<String>,
    /// For which robot.
    #[serde(default)]
    pub serial_number: Option<String>,
    /// Its name.
    pub order_id: String,
    /// Number of the update; 0 = new.
    #[serde(default)]
    pub order_update_id: u32,
    /// Base, then horizon.
    pub nodes: Vec<Node>,
    /// Between them.
    pub edges: Vec<Edge>,
}

/// What shall be done at once.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct InstantActions {
    /// For whose robot.
    #[serde(default)]
    pub manufacturer: Option<String>,
    /// For which robot.
    #[serde(default)]
    pub serial_number: Option<String>,
    /// In this order. Some masters of 2.0 call them `instantActions`.
    #[serde(alias = "instantActions")]
    pub actions: Vec<Action>,
}

fn malformed(what: impl Into<String>) -> Problem {
    Problem::new(ProblemKind::Malformed, what)
}

/// An order, if the bytes are one in itself.
///
/// # Errors
/// What is wrong with it, with its numbers where those can be read.
pub fn order(protocol: Protocol, bytes: &[u8]) -> Result<Order, Problem> {
    let value = json(bytes)?;
    let (id, update) = (value.get("orderId").cloned(), value.get("orderUpdateId").cloned());
    let read = serde_json::from_value::<Order>(value).map_err(|error| malformed(error.to_string()));
    read.and_then(|order| check(protocol, &order).map(|()| order)).map_err(|mut problem| {
        if let Some(id) = id.as_ref().and_then(Value::as_str) {
            problem = problem.with("orderId", id);
        }
        if let Some(update) = update.as_ref().and_then(Value::as_u64) {
            problem = problem.with("orderUpdateId", update);
        }
        problem.with("topic", "order")
    })
}

/// Instant actions, if the bytes are some.
///
/// # Errors
/// What is wrong with them.
pub fn instant_actions(bytes: &[u8]) -> Result<InstantActions, Problem> {
    let read = json(bytes).and_then(|value| {
        serde_json::from_value::<InstantActions>(value).map_err(|error| malformed(error.to_string()))
    });
    read.and_then(|read| check_actions(&read.actions).map(|()| read))
        .map_err(|problem| problem.with("topic", "instantActions"))
}

fn json(bytes: &[u8]) -> Result<Value, Problem> {
    if bytes.len() > MAX_BYTES {
        return Err(malformed(format!("{} bytes, the limit is {MAX_BYTES}", bytes.len())));
    }
    serde_json::from_slice(bytes).map_err(|error| malformed(error.to_string()))
}

fn check_id(what: &str, id: &str) -> Result<(), Problem> {
    if id.is_empty() || id.len() > MAX_ID {
        return Err(malformed(format!("{what} has {} bytes, not 1 to {MAX_ID}", id.len())));
    }
    Ok(())
}

fn check_actions(actions: &[Action]) -> Result<(), Problem> {
    if actions.len() > MAX_ACTIONS {
        return Err(malformed(format!("{} actions, the limit is {MAX_ACTIONS}", actions.len())));
    }
    actions.iter().try_for_each(|action| {
        check_id("an actionType", &action.action_type)?;
        check_id("an actionId", &action.action_id)
    })
}

fn check(protocol: Protocol, order: &Order) -> Result<(), Problem> {
    check_id("the orderId", &order.order_id)?;
    let Order { nodes, edges, .. } = order;
    let Some(first) = nodes.first().filter(|first| first.released) else {
        return Err(malformed("the order has no released first node"));
    };
    if nodes.len() > MAX_NODES {
        let text = format!("{} nodes, the limit is {MAX_NODES}", nodes.len());
        return Err(Problem::new(ProblemKind::TooLarge, text));
    }
    if edges.len() + 1 != nodes.len() {
        return Err(malformed(format!("{} nodes and {} edges", nodes.len(), edges.len())));
    }
    for (i, node) in nodes.iter().enumerate() {
        check_id("a nodeId", &node.node_id)?;
        let sequence_id = u64::from(first.sequence_id) + 2 * i as u64;
        if u64::from(node.sequence_id) != sequence_id || !node.sequence_id.is_multiple_of(2) {
            return Err(malformed("the sequenceId of a node does not continue").with("nodeId", &node.node_id));
        }
        check_actions(&node.actions)?;
        if let Some(position) = &node.node_position {
            check_position(position).map_err(|problem| problem.with("nodeId", &node.node_id))?;
        }
    }
    for (edge, ends) in edges.iter().zip(nodes.windows(2)) {
        let at = |problem: Problem| problem.with("edgeId", &edge.edge_id);
        check_id("an edgeId", &edge.edge_id)?;
        check_actions(&edge.actions)?;
        if edge.sequence_id != ends[0].sequence_id + 1 {
            return Err(at(malformed("the sequenceId of an edge does not continue")));
        }
        if edge.released != ends[1].released || (ends[1].released && !ends[0].released) {
            return Err(at(malformed("a released node or edge follows one that is not")));
        }
        for (named, node) in [(&edge.start_node_id, &ends[0]), (&edge.end_node_id, &ends[1])] {
            if named.as_ref().is_some_and(|named| *named != node.node_id) {
                return Err(at(malformed("an edge does not join the nodes beside it")));
            }
        }
        let ignored = [
            ("trajectory", &edge.trajectory),
            ("corridor", &edge.corridor),
            ("maximumSpeed", &edge.maximum_speed),
            ("orientation", &edge.orientation),
        ];
        // 2.x does not know this error: what is not listed in the factsheet is ignored there.
        if let Some((name, _)) = ignored.iter().find(|(_, value)| protocol.is_v3() && value.is_some()) {
            let problem = Problem::new(ProblemKind::UnsupportedParameter, format!("{name} is not supported"));
            return Err(at(problem.with("parameter", name)));
        }
    }
    Ok(())
}

fn check_position(position: &NodePosition) -> Result<(), Problem> {
    check_id("a mapId", &position.map_id)?;
    let is_far = |m: f64| !(-MAX_COORDINATE_M..=MAX_COORDINATE_M).contains(&m);
    if is_far(position.x) || is_far(position.y) {
        return Err(malformed(format!("a position is not within ±{MAX_COORDINATE_M} m")));
    }
    if position.theta.is_some_and(|rad| !(-7.0..=7.0).contains(&rad)) {
        return Err(malformed("a theta is not within ±π"));
    }
    Ok(())
}
