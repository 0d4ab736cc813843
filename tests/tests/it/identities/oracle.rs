//! What each role may do, written by hand from the design: not from the rules of the bus.
//!
//! `n` is the robot's own name, `r` its namespace in ROS 2, `me` the names of its own sessions; keys are those below
//! the fleet, or, of domain 7 of ROS 2, whole ones.

use xtb_identity::Role;
use zenoh::key_expr::keyexpr;

/// What is sent to the router (`in`) or by it (`out`), which kinds of messages, on which keys.
type Line = (&'static str, &'static str, &'static str);

const LOOK: &[Line] = &[
    (
        "in",
        "declare_subscriber",
        "*/{state,state/json,sensors,event,event/json,route,fix,near/*} map map/places traffic/state dispatch/{tasks,event,alerts} sim/{truth,stats} \
         {*,dispatch}/event/@adv/** */event/json/@adv/**",
    ),
    (
        "in",
        "query",
        "*/{state,about} map map/places map/history dispatch/{tasks,homes,alerts,history} sim/{roster,stats} {*,dispatch}/event/@adv/** */event/json/@adv/**",
    ),
    (
        "in",
        "liveliness_query declare_liveliness_subscriber",
        "{*,traffic,dispatch}/alive {*,dispatch}/event/@adv/** */event/json/@adv/**",
    ),
    (
        "out",
        "put",
        "*/{state,state/json,sensors,event,event/json,route,fix,near/*} map map/places traffic/state dispatch/{tasks,event,alerts} sim/{truth,stats} \
         {*,dispatch}/event/@adv/** */event/json/@adv/**",
    ),
    (
        "out",
        "reply",
        "*/{state,about} map map/places map/history dispatch/{tasks,homes,alerts,history} sim/{roster,stats} {*,dispatch}/event/@adv/** */event/json/@adv/** {*,dispatch}/event */event/json",
    ),
    ("out", "liveliness_token", "{*,traffic,dispatch}/alive {*,dispatch}/event/@adv/** */event/json/@adv/**"),
];
const STOP: &[Line] =
    &[("in", "put query", "*/estop/me"), ("in", "put", "all/estop/me"), ("out", "reply", "*/estop/me")];
const DRIVE: &[Line] = &[
    ("in", "query", "*/{cmd,estop,log,param}/me dispatch/{cmd,ack,standby}/me map/edit/me"),
    ("in", "put", "*/{teleop,estop}/me all/estop/me"),
    ("out", "reply", "*/{cmd,estop,log,param}/me dispatch/{cmd,ack,standby}/me map/edit/me"),
];
const ROBOT: &[Line] = &[
    ("in", "put", "n/{state,state/json,sensors,event,near/*,event/@adv/**,event/json,event/json/@adv/**}"),
    (
        "in",
        "declare_queryable",
        "n/{state,about,cmd/*,estop/*,log/*,param/*,event/@adv/**,event/json/@adv/**}",
    ),
    (
        "in",
        "reply",
        "n/{state,about,cmd/*,estop/*,log/*,param/*,event/@adv/**,event,event/json/@adv/**,event/json}",
    ),
    ("in", "liveliness_token", "n/{alive,event/@adv/**,event/json/@adv/**}"),
    ("in", "declare_subscriber", "n/{teleop/*,estop/*,fix,route} all/estop/* map */near/*"),
    ("in", "query", "n/state map"),
    ("in", "liveliness_query", "n/alive"),
    ("out", "put", "n/{teleop/*,fix,route} */estop/* all/estop/* map */near/*"),
    ("out", "query", "{n,*}/{state,about,cmd/*,estop/*,log/*,param/*,event/@adv/**,event/json/@adv/**}"),
    ("out", "reply", "n/state map"),
    ("out", "liveliness_token", "n/alive"),
];
/// The dispatcher, but for traffic control and map.
const DISPATCH: &[Line] = &[
    ("in", "declare_subscriber", "all/estop/*"),
    ("in", "query", "*/cmd/dispatch dispatch/standby/dispatch"),
    ("in", "put", "dispatch/{tasks,alerts,event,event/@adv/**}"),
    ("in", "declare_queryable", "dispatch/{tasks,homes,alerts,history,cmd/*,ack/*,standby/*,event/@adv/**}"),
    ("in", "reply", "dispatch/{tasks,homes,alerts,history,cmd/*,ack/*,standby/*,event/@adv/**,event}"),
    ("in", "liveliness_token", "dispatch/{alive,event/@adv/**}"),
    ("out", "put", "all/estop/*"),
    ("out", "query", "dispatch/{tasks,homes,alerts,history,cmd/*,ack/*,standby/*,event/@adv/**}"),
    ("out", "reply", "*/cmd/dispatch dispatch/standby/dispatch"),
];
const TRAFFIC: &[Line] =
    &[("in", "put", "*/route traffic/state"), ("in", "liveliness_token", "traffic/alive")];
const MAP: &[Line] = &[
    ("in", "put declare_queryable reply", "map map/places"),
    ("in", "declare_queryable reply", "map/history map/edit/*"),
    ("in", "query", "map"),
    ("out", "query", "map map/places map/history map/edit/*"),
    ("out", "reply", "map"),
];
const FIXES: &[Line] = &[("in", "put", "*/fix")];
const SIMULATE: &[Line] = &[
    ("in", "put", "sim/{truth,stats}"),
    ("in", "declare_subscriber", "sim/truth"),
    ("in", "declare_queryable reply", "sim/{roster,stats}"),
    ("out", "put", "sim/truth"),
    ("out", "query", "sim/{roster,stats}"),
];
/// Whoever is admitted hears what others declare.
const MEMBER: &[Line] = &[(
    "out",
    "declare_subscriber declare_queryable liveliness_query declare_liveliness_subscriber",
    "** **/@adv/**",
)];
/// Whoever has a certificate, even a revoked one.
const ANYBODY: &[Line] = &[("in", "query", "identity/*"), ("out", "reply", "identity/*")];
/// Whoever takes part in ROS 2 sees its graph, and hears what others declare.
const ROS2: &[Line] = &[
    ("in", "liveliness_query declare_liveliness_subscriber", "@ros2_lv/7/**"),
    ("out", "liveliness_token", "@ros2_lv/7/**"),
    (
        "out",
        "declare_subscriber declare_queryable liveliness_query declare_liveliness_subscriber",
        "7/** 7/**/@adv/** @ros2_lv/7/** @ros2_lv/7/**/@adv/**",
    ),
];
const ROS2_ROBOT: &[Line] = &[
    ("in", "put reply", "7/{r,tf,tf_static,diagnostics}/** 7/{r,tf,tf_static,diagnostics}/**/@adv/**"),
    ("in", "declare_queryable", "7/r/** 7/{r,tf,tf_static,diagnostics}/**/@adv/**"),
    ("in", "declare_subscriber", "7/r/** 7/r/**/@adv/**"),
    ("in", "query liveliness_query declare_liveliness_subscriber", "7/r/**/@adv/**"),
    ("in", "liveliness_token", "7/{r,tf,tf_static,diagnostics}/**/@adv/** @ros2_lv/7/*/*/*/*/*/%r/**"),
    ("out", "put reply", "7/r/** 7/r/**/@adv/**"),
    ("out", "query", "7/r/** 7/{r,tf,tf_static,diagnostics}/**/@adv/**"),
    ("out", "liveliness_token", "7/r/**/@adv/**"),
];
/// Hears everything, and shows that it does.
const ROS2_LOOK: &[Line] = &[
    ("in", "declare_subscriber", "7/** 7/**/@adv/**"),
    ("in", "query liveliness_query declare_liveliness_subscriber liveliness_token", "7/**/@adv/**"),
    ("out", "put reply", "7/** 7/**/@adv/**"),
    ("out", "liveliness_token", "7/**/@adv/**"),
];
const ROS2_VIEWER: &[Line] = &[
    ("in", "query", "7/estop/** 7/*/estop/**"),
    ("in", "liveliness_token", "@ros2_lv/7/*/*/*/{NN,MS,SC}/**"),
];
const ROS2_EVERYTHING: &[Line] = &[
    ("in", "put query reply declare_queryable", "7/** 7/**/@adv/**"),
    ("in", "liveliness_token", "@ros2_lv/7/**"),
    ("out", "query", "7/** 7/**/@adv/**"),
];
const ROS2_MAP: &[Line] = &[
    ("in", "put reply", "7/map/** 7/map/**/@adv/**"),
    ("in", "declare_queryable", "7/map/**/@adv/**"),
    (
        "in",
        "liveliness_token",
        "7/map/**/@adv/** @ros2_lv/7/*/*/*/NN/*/%/** @ros2_lv/7/*/*/*/MP/*/%/*/%map/**",
    ),
    ("out", "query", "7/map/**/@adv/**"),
];
/// What a simulator's robots may not be, though `*` is any name.
const NO_ROBOT: &str = "traffic/{alive,state} dispatch/{alive,event,cmd/*,event/@adv/**}";

/// Who asks: the role, the name, and the names of its sessions.
pub(super) struct Who {
    role: Option<Role>,
    n: String,
    me: Vec<String>,
}

impl Who {
    /// `None` = not admitted.
    pub(super) fn new(name: &str, role: Option<Role>) -> Self {
        let n = if role == Some(Role::Robot) { name } else { "*" };
        let me = match role {
            Some(Role::Dashboard) => vec!["web-$*".to_owned()],
            _ => vec![name.to_owned(), format!("{name}-$*")],
        };
        Self { role, n: n.to_owned(), me }
    }

    /// Whether a message of this kind on this whole key may pass.
    pub(super) fn may(&self, flow: &str, kind: &str, key: &str) -> bool {
        let sections: &[&[Line]] = match self.role {
            None => &[],
            Some(Role::Router) => return true,
            Some(Role::Robot) => &[ROBOT, MEMBER, ROS2_ROBOT, ROS2],
            Some(Role::Viewer) => &[LOOK, STOP, MEMBER, ROS2_LOOK, ROS2_VIEWER, ROS2],
            Some(Role::Operator) => &[LOOK, DRIVE, MEMBER, ROS2_LOOK, ROS2_EVERYTHING, ROS2],
            Some(Role::Dashboard) => &[LOOK, DRIVE, MEMBER],
            // It includes traffic control, and serves a map.
            Some(Role::Dispatcher) => &[LOOK, DISPATCH, TRAFFIC, MAP, MEMBER],
            Some(Role::Traffic) => &[LOOK, TRAFFIC, MEMBER],
            Some(Role::Map) => &[LOOK, MAP, MEMBER, ROS2_MAP, ROS2],
            Some(Role::Tracker) => &[FIXES, MEMBER],
            Some(Role::Recorder) => &[LOOK, MEMBER],
            Some(Role::Simulator) => &[ROBOT, MAP, FIXES, SIMULATE, MEMBER, ROS2_LOOK, ROS2_EVERYTHING, ROS2],
        };
        let speaks = matches!(kind, "put" | "declare_queryable" | "reply" | "liveliness_token");
        if self.role == Some(Role::Simulator) && flow == "in" && speaks && self.covers(NO_ROBOT, key) {
            return false;
        }
        let mut lines = sections.iter().copied().chain([ANYBODY]).flatten();
        lines.any(|(its, kinds, keys)| {
            *its == flow && kinds.split(' ').any(|its| its == kind) && self.covers(keys, key)
        })
    }

    /// Whether one of these covers the whole key.
    fn covers(&self, keys: &str, key: &str) -> bool {
        let key = keyexpr::new(key).unwrap();
        keys.split(' ').flat_map(braces).flat_map(|line| self.named(&line)).any(|line| {
            let whole = line.starts_with(['7', '@']);
            let line = if whole { line } else { format!("xtb/lab/{line}") };
            keyexpr::new(&line).unwrap().includes(key)
        })
    }

    fn named(&self, key: &str) -> Vec<String> {
        let namespace = self.n.replace('-', "_");
        let chunk = |chunk: &str| match chunk {
            "n" => self.n.clone(),
            "r" => namespace.clone(),
            "%r" => format!("%{namespace}"),
            _ => chunk.to_owned(),
        };
        let key = key.split('/').map(chunk).collect::<Vec<_>>().join("/");
        match key.strip_suffix("/me") {
            Some(stem) => self.me.iter().map(|me| format!("{stem}/{me}")).collect(),
            None => vec![key],
        }
    }
}

/// `a/{b,c}` → `a/b`, `a/c`; of several braces each with each.
fn braces(text: &str) -> Vec<String> {
    let Some((before, rest)) = text.split_once('{') else { return vec![text.to_owned()] };
    let (these, after) = rest.split_once('}').unwrap();
    these.split(',').flat_map(|this| braces(&format!("{before}{this}{after}"))).collect()
}
