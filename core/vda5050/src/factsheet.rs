//! The message `factsheet`: what a robot is and can do.

use crate::header::Serial;
use crate::incoming::{MAX_ACTIONS, MAX_BYTES, MAX_ID, MAX_NODES};
use serde_json::{Value, json};

/// The body and speed of a robot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Over all, in m.
    pub length_m: f64,
    /// Over all, in m.
    pub width_m: f64,
    /// Fastest, in m/s.
    pub speed_mps: f64,
}

/// Of the trucks of the memorandum: a height is not among a robot's parameters, in m.
const HEIGHT_M: f64 = 0.5;
/// What the simulated trucks do at most, in m/s²; it is not among a robot's parameters.
const ACCELERATION_MPS2: f64 = 1.0;
/// A state is sent at most so often, in s.
pub const STATE_EVERY_S: f64 = 0.1;

/// The message, without its header. Without a `body` its sizes are 0.
#[must_use]
pub fn compose(serial: &Serial, version: &str, body: Option<Body>) -> Value {
    let Body { length_m, width_m, speed_mps } =
        body.unwrap_or(Body { length_m: 0.0, width_m: 0.0, speed_mps: 0.0 });
    let is_v3 = serial.protocol.is_v3();
    let actions: Vec<Value> = actions(is_v3);
    if is_v3 {
        json!({
            "typeSpecification": {
                "seriesName": "XTB",
                "seriesDescription": format!("XTB fleet {version}"),
                "mobileRobotKinematics": "ACKERMANN",
                "mobileRobotClass": "CARRIER",
                "maximumLoadMass": 0,
                "localizationTypes": ["NATURAL"],
                "navigationTypes": ["AUTONOMOUS"],
            },
            "physicalParameters": {
                "minimumSpeed": 0.0, "maximumSpeed": speed_mps,
                "maximumAcceleration": ACCELERATION_MPS2, "maximumDeceleration": ACCELERATION_MPS2,
                "minimumHeight": HEIGHT_M, "maximumHeight": HEIGHT_M, "width": width_m, "length": length_m,
            },
            "protocolLimits": {
                "maximumStringLengths": {"maximumMessageLength": MAX_BYTES, "maximumIdLength": MAX_ID},
                "maximumArrayLengths": {
                    "order.nodes": MAX_NODES, "order.edges": MAX_NODES - 1, "node.actions": 0, "edge.actions": 0,
                    "instantActions": MAX_ACTIONS,
                },
                "timing": {"minimumOrderInterval": 0.0, "minimumStateInterval": STATE_EVERY_S},
            },
            "protocolFeatures": {"optionalParameters": [], "mobileRobotActions": actions},
            "mobileRobotGeometry": {},
            "loadSpecification": {},
        })
    } else {
        json!({
            "typeSpecification": {
                "seriesName": "XTB",
                "seriesDescription": format!("XTB fleet {version}"),
                "agvKinematic": "THREEWHEEL",
                "agvClass": "CARRIER",
                "maxLoadMass": 0,
                "localizationTypes": ["NATURAL"],
                "navigationTypes": ["AUTONOMOUS"],
            },
            "physicalParameters": {
                "speedMin": 0.0, "speedMax": speed_mps,
                "accelerationMax": ACCELERATION_MPS2, "decelerationMax": ACCELERATION_MPS2,
                "heightMin": HEIGHT_M, "heightMax": HEIGHT_M, "width": width_m, "length": length_m,
            },
            "protocolLimits": {
                "maxStringLens": {"msgLen": MAX_BYTES, "idLen": MAX_ID},
                "maxArrayLens": {
                    "order.nodes": MAX_NODES, "order.edges": MAX_NODES - 1, "node.actions": 0, "edge.actions": 0,
                    "instantActions": MAX_ACTIONS,
                },
                "timing": {"minOrderInterval": 0.0, "minStateInterval": STATE_EVERY_S},
            },
            "protocolFeatures": {"optionalParameters": [], "agvActions": actions},
            "agvGeometry": {},
            "loadSpecification": {},
        })
    }
}

fn actions(is_v3: bool) -> Vec<Value> {
    let position = if is_v3 { "initializePosition" } else { "initPosition" };
    let plain = ["cancelOrder", "startPause", "stopPause", "stateRequest", "factsheetRequest"];
    let clear = is_v3.then_some("clearInstantActions");
    let parameter = |(key, kind, optional): (&str, &str, bool)| json!({"key": key, "valueDataType": kind, "isOptional": optional});
    let pose = [
        ("x", "NUMBER", false),
        ("y", "NUMBER", false),
        ("theta", "NUMBER", false),
        ("mapId", "STRING", false),
        ("lastNodeId", "STRING", true),
    ];
    let action = |name: &str| {
        let mut action = json!({"actionType": name, "actionScopes": ["INSTANT"]});
        if name == position {
            action["actionParameters"] = pose.into_iter().map(parameter).collect();
        }
        if is_v3 {
            (action["pauseAllowed"], action["cancelAllowed"]) = (json!(false), json!(false));
        }
        action
    };
    plain.into_iter().chain(clear).chain([position]).map(action).collect()
}
