//! The message `state`, made of what is known of a robot, its order and its task.

use crate::header::Serial;
use crate::incoming::{Edge, Node};
use crate::operating::{self, Operating};
use crate::record::OrderRecord;
use serde_json::{Value, json};
use std::f64::consts::{PI, TAU};
use xtb_protocol::messages::{MapState, RobotState, TaskState};

/// What a state is made of.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// Whose.
    pub serial: &'a Serial,
    /// Its order.
    pub record: &'a OrderRecord,
    /// What it said last.
    pub robot: &'a RobotState,
    /// How the task of its order stands.
    pub task: Option<TaskState>,
    /// What is refused or wrong, besides what the robot says.
    pub errors: &'a [Value],
}

/// Fields that change all the time while a robot drives: they alone are no reason to send a state at once.
pub const CONTINUOUS: [&str; 5] =
    ["agvPosition", "mobileRobotPosition", "velocity", "batteryState", "powerSupply"];

/// The message, without its header.
#[must_use]
pub fn compose(view: View<'_>) -> Value {
    let View { serial, record, robot, task, errors } = view;
    let protocol = serial.protocol;
    let is_v3 = protocol.is_v3();
    let order = &record.order;
    let map = robot.nav.map.as_ref().map_or("", |map| map.name.as_str());
    let errors: Vec<Value> =
        operating::errors(robot, protocol).into_iter().chain(errors.iter().cloned()).collect();
    let actions: Vec<Value> = record.actions.iter().map(|action| action.view(is_v3)).collect();
    let base = order.base();
    let position = json!({
        "x": robot.pose.x_m,
        "y": robot.pose.y_m,
        "theta": wrapped(robot.pose.yaw_rad),
        "mapId": map,
        protocol.pick("positionInitialized", "localized"): operating::is_localized(robot),
    });
    let mut state = json!({
        "orderId": order.id,
        "orderUpdateId": order.update,
        "lastNodeId": order.last_node.0,
        "lastNodeSequenceId": order.last_node.1,
        "nodeStates": order.nodes.iter().map(node).collect::<Vec<_>>(),
        "edgeStates": order.edges.iter().map(edge).collect::<Vec<_>>(),
        "driving": operating::drives(robot),
        "paused": record.paused || task == Some(TaskState::Paused),
        "newBaseRequest": base <= 1 && base < order.nodes.len(),
        "operatingMode": Operating::of(robot, !order.is_finished()).text(protocol),
        "errors": errors,
        "information": information(record, is_v3),
        "safetyState": operating::safety(robot, protocol),
        "loads": [],
        "maps": robot.nav.map.iter().map(map_state).collect::<Vec<_>>(),
        protocol.pick("agvPosition", "mobileRobotPosition"): position,
        protocol.pick("batteryState", "powerSupply"): operating::battery(robot, protocol),
        // Actions of nodes are refused, so that 3.0 has none here.
        "actionStates": if is_v3 { json!([]) } else { json!(actions) },
    });
    if is_v3 {
        state["instantActionStates"] = json!(actions);
    }
    if let Some(mps) = robot.speed_mps {
        state["velocity"] = json!({"vx": mps, "vy": 0.0});
    }
    state
}

fn node(node: &Node) -> Value {
    let mut state =
        json!({"nodeId": node.node_id, "sequenceId": node.sequence_id, "released": node.released});
    if let Some(position) = &node.node_position {
        let mut at = json!({"x": position.x, "y": position.y, "mapId": position.map_id});
        if let Some(theta) = position.theta {
            at["theta"] = json!(wrapped(theta));
        }
        state["nodePosition"] = at;
    }
    state
}

fn map_state(map: &MapState) -> Value {
    json!({"mapId": map.name, "mapVersion": map.hash, "mapStatus": "ENABLED"})
}

fn edge(edge: &Edge) -> Value {
    json!({"edgeId": edge.edge_id, "sequenceId": edge.sequence_id, "released": edge.released})
}

/// Which task of the dispatcher drives the order, for people who look there.
fn information(record: &OrderRecord, is_v3: bool) -> Value {
    let Some(part) = &record.part else { return json!([]) };
    let text = format!("`fleet-cli task {}` shows the task of the order", part.task);
    json!([{
        "infoType": "dispatcherTask",
        "infoLevel": "DEBUG",
        if is_v3 { "infoDescriptor" } else { "infoDescription" }: text,
        "infoReferences": [{"referenceKey": "taskId", "referenceValue": part.task.to_string()}],
    }])
}

/// Within ±π.
fn wrapped(rad: f64) -> f64 {
    // The schema's π has eleven digits.
    let wrapped = rad - TAU * (rad / TAU).round();
    wrapped.clamp(-PI + 1e-11, PI - 1e-11)
}
