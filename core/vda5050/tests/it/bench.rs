//! A robot, a dispatcher that is played, and what a master control sees of them.

use crate::schema;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use xtb_protocol::Name;
use xtb_protocol::Uuid;
use xtb_protocol::messages::{DispatchCode, RobotState, TaskId, TaskKind, TaskState, Waypoint};
use xtb_vda5050::record::OrderRecord;
use xtb_vda5050::{Answer, Ask, Effect, Protocol, Serial, Topic, Vehicle};

pub(crate) const START_MS: u64 = 1_790_000_000_000;
pub(crate) const MAP: &str = "world";

pub(crate) fn serial(protocol: Protocol) -> Serial {
    Serial {
        protocol,
        interface: protocol.interface().to_owned(),
        manufacturer: "xtb".to_owned(),
        robot: Name::new("xtb-1").unwrap(),
    }
}

/// A task of the dispatcher that is played.
#[derive(Debug, Clone)]
pub(crate) struct Task {
    pub(crate) key: Uuid,
    pub(crate) points: Vec<Waypoint>,
    pub(crate) state: TaskState,
    pub(crate) legs_done: usize,
}

/// Takes what is asked by the dispatcher's rules.
#[derive(Debug, Clone, Default)]
pub(crate) struct Dispatcher {
    pub(crate) tasks: BTreeMap<TaskId, Task>,
    /// Points that were driven to, in their order.
    pub(crate) driven: Vec<(f64, f64)>,
    pub(crate) refuses: Option<DispatchCode>,
}

impl Dispatcher {
    pub(crate) fn ask(&mut self, ask: &Ask) -> Answer {
        if let Some(code) = self.refuses {
            return Answer::Refused(code, "so it is".to_owned());
        }
        let next = TaskId::new(self.tasks.len() as u64 + 1);
        let refused = |code| Answer::Refused(code, "so it is".to_owned());
        let (task, wanted) = match ask {
            Ask::SetPose { .. } => return Answer::Done,
            Ask::Submit { id, spec } => {
                if let Some((known, _)) = self.tasks.iter().find(|(_, task)| task.key == *id) {
                    return Answer::Submitted(*known);
                }
                let TaskKind::Route { points, loops: 1, .. } = &spec.kind else { panic!("{spec:?}") };
                spec.validate().unwrap();
                let task = Task { key: *id, points: points.clone(), state: TaskState::Running, legs_done: 0 };
                self.tasks.insert(next, task);
                return Answer::Submitted(next);
            }
            Ask::Show(task) => (task, None),
            Ask::Extend { task, .. } => (task, None),
            Ask::Cancel(task) => (task, Some(TaskState::Cancelled)),
            Ask::Pause(task) => (task, Some(TaskState::Paused)),
            Ask::Resume(task) => (task, Some(TaskState::Running)),
        };
        let Some(task) = self.tasks.get_mut(task) else { return refused(DispatchCode::UnknownTask) };
        if let Ask::Extend { after, points, .. } = ask {
            if task.points.get(*after as usize..).is_some_and(|known| known.starts_with(points)) {
                return Answer::Done;
            }
            if task.state.is_final() {
                return refused(DispatchCode::WrongState);
            }
            if task.points.len() != *after as usize || task.points.len() + points.len() > 100 {
                return refused(DispatchCode::Stale);
            }
            task.points.extend(points);
        }
        match wanted {
            Some(_) if task.state.is_final() => refused(DispatchCode::WrongState),
            Some(state) => {
                task.state = state;
                Answer::Done
            }
            None => Answer::Done,
        }
    }

    /// The robot arrives at the next point of its task.
    pub(crate) fn drive(&mut self) -> Option<Waypoint> {
        let task = self.tasks.values_mut().find(|task| task.state == TaskState::Running)?;
        let point = task.points[task.legs_done];
        self.driven.push((point.x_m, point.y_m));
        task.legs_done += 1;
        if task.legs_done == task.points.len() {
            task.state = TaskState::Done;
        }
        Some(point)
    }
}

pub(crate) struct Bench {
    pub(crate) protocol: Protocol,
    pub(crate) now_ms: u64,
    pub(crate) vehicle: Vehicle,
    pub(crate) dispatcher: Dispatcher,
    pub(crate) robot: RobotState,
    /// What was kept last.
    pub(crate) saved: String,
    /// What was asked for, but for how tasks stand.
    pub(crate) asked: Vec<Ask>,
    pub(crate) published: Vec<(Topic, Value)>,
    /// The dispatcher's answers do not come.
    pub(crate) silent: bool,
    /// What was asked while they did not.
    pub(crate) unanswered: Option<Ask>,
}

impl Bench {
    pub(crate) fn new(protocol: Protocol) -> Self {
        let mut robot: RobotState = serde_json::from_str(include_str!("../data/robot_state.json")).unwrap();
        (robot.pose.x_m, robot.pose.y_m) = (0.0, 0.0);
        let mut bench = Self {
            protocol,
            now_ms: START_MS,
            vehicle: Vehicle::new(serial(protocol), OrderRecord::default()),
            dispatcher: Dispatcher::default(),
            robot,
            saved: String::new(),
            asked: Vec::new(),
            published: Vec::new(),
            silent: false,
            unanswered: None,
        };
        bench.run();
        bench
    }

    /// Two seconds, in which nothing drives.
    pub(crate) fn run(&mut self) {
        for _ in 0..40 {
            self.turn();
        }
    }

    pub(crate) fn turn(&mut self) {
        self.now_ms += 50;
        self.vehicle.robot(Some(&self.robot), true);
        self.vehicle.about("1.0.0", None);
        for effect in self.vehicle.step(self.now_ms) {
            match effect {
                Effect::Save(record) => self.saved = record,
                Effect::Ask(ask) => {
                    self.unanswered = self.silent.then(|| ask.clone());
                    if !matches!(ask, Ask::Show(_)) {
                        self.asked.push(ask.clone());
                    }
                    if !self.silent {
                        let answer = self.dispatcher.ask(&ask);
                        self.tell();
                        self.vehicle.answered(self.now_ms, answer);
                    }
                }
                Effect::Publish(topic, message) => {
                    schema::assert_valid(self.protocol, topic.name(), &message);
                    self.published.push((topic, message));
                }
            }
        }
        self.tell();
    }

    /// How the tasks stand.
    pub(crate) fn tell(&mut self) {
        for (id, task) in &self.dispatcher.tasks {
            self.vehicle.task((7, *id), task.state, task.legs_done as u32, None);
        }
    }

    /// The robot drives to the next point.
    pub(crate) fn drive(&mut self) {
        if let Some(point) = self.dispatcher.drive() {
            (self.robot.pose.x_m, self.robot.pose.y_m) = (point.x_m, point.y_m);
        }
        self.run();
    }

    /// `kill -9`: what was not kept is gone.
    pub(crate) fn kill(&mut self) {
        let record = if self.saved.is_empty() {
            OrderRecord::default()
        } else {
            OrderRecord::from_json(&self.saved).unwrap()
        };
        self.vehicle = Vehicle::new(serial(self.protocol), record);
    }

    pub(crate) fn send(&mut self, order: &Value) {
        schema::assert_valid(self.protocol, "order", order);
        self.vehicle.order(order.to_string().as_bytes());
        self.run();
    }

    pub(crate) fn act(&mut self, kind: &str, id: &str, parameters: &Value) {
        let action = json!({"actionType": kind, "actionId": id, "blockingType": "NONE", "actionParameters": parameters});
        let mut message = self.header();
        message["actions"] = json!([action]);
        schema::assert_valid(self.protocol, "instantActions", &message);
        self.vehicle.instant_actions(message.to_string().as_bytes());
        self.run();
    }

    pub(crate) fn header(&self) -> Value {
        json!({
            "headerId": 1, "timestamp": "2026-09-21T14:13:20.123Z", "version": self.protocol.version(),
            "manufacturer": "xtb", "serialNumber": "xtb-1",
        })
    }

    /// Nodes at x = 0, 1, 2 … m; the first one has this sequenceId, `base` of them are released.
    pub(crate) fn order(&self, id: &str, update: u32, first: u32, count: u32, base: u32) -> Value {
        let mut order = self.header();
        let nodes: Vec<Value> = (0..count)
            .map(|i| {
                let place = first / 2 + i;
                let position = json!({"x": f64::from(place), "y": 0.0, "mapId": MAP});
                json!({"nodeId": format!("n{place}"), "sequenceId": first + 2 * i, "released": i < base,
                       "nodePosition": position, "actions": []})
            })
            .collect();
        let edges: Vec<Value> = (1..count)
            .map(|i| {
                let place = first / 2 + i;
                json!({"edgeId": format!("e{place}"), "sequenceId": first + 2 * i - 1, "released": i < base,
                       "startNodeId": format!("n{}", place - 1), "endNodeId": format!("n{place}"), "actions": []})
            })
            .collect();
        order["orderId"] = json!(id);
        order["orderUpdateId"] = json!(update);
        (order["nodes"], order["edges"]) = (json!(nodes), json!(edges));
        order
    }

    pub(crate) fn state(&self) -> &Value {
        &self.published.iter().rfind(|(topic, _)| *topic == Topic::State).unwrap().1
    }

    /// `n1+ n2+ n3`: nodes that are left; + = of the base.
    pub(crate) fn nodes(&self) -> String {
        let names = |list: &str, id: &str| {
            let list = self.state()[list].as_array().unwrap();
            let name = |one: &Value| {
                format!("{}{}", one[id].as_str().unwrap(), if one["released"] == true { "+" } else { "" })
            };
            list.iter().map(name).collect::<Vec<_>>().join(" ")
        };
        let nodes = names("nodeStates", "nodeId");
        assert_eq!(names("edgeStates", "edgeId"), nodes.replace('n', "e"), "an edge for each node");
        nodes
    }

    pub(crate) fn last(&self) -> (&str, u64) {
        let state = self.state();
        (state["lastNodeId"].as_str().unwrap(), state["lastNodeSequenceId"].as_u64().unwrap())
    }

    pub(crate) fn errors(&self) -> Vec<&str> {
        self.state()["errors"]
            .as_array()
            .unwrap()
            .iter()
            .map(|error| error["errorType"].as_str().unwrap())
            .collect()
    }

    pub(crate) fn action(&self, id: &str) -> String {
        let list = if self.protocol.is_v3() { "instantActionStates" } else { "actionStates" };
        let found = self.state()[list].as_array().unwrap().iter().find(|action| action["actionId"] == id);
        found.unwrap_or_else(|| panic!("no {id} in {}", self.state()))["actionStatus"]
            .as_str()
            .unwrap()
            .to_owned()
    }
}
