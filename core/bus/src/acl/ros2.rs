//! What of ROS 2 each role may do, where a router carries a domain of it: beside the fleet's own keys, never among
//! them, as a domain's keys begin with its number.
//!
//! | role | may |
//! | --- | --- |
//! | robot | publish, hear and answer in its own namespace; publish `/tf`, `/tf_static`, `/diagnostics` |
//! | operator, simulator | everything in the domain |
//! | viewer | hear everything; ask `estop` |
//! | map | publish `/map` |
//!
//! Topics are used as events are: what is latched is asked for by those who come late. A node of ROS is what its
//! certificate is: who drives by `cmd_vel` has to be an operator.

use super::grants::{Flow, Grants, Message, Scope, declarations, recovery};
use super::table::Use::{Alive, Ask, Event};
use xtb_identity::{RegistryEntry, Role};
use xtb_protocol::Name;

/// Where the liveliness tokens of ROS 2's graph are: wildcards of other keys do not meet it.
pub(super) const GRAPH: &str = "@ros2_lv";

/// A domain of ROS 2 that a router carries.
#[derive(Debug, Clone, Copy)]
pub struct Ros2Domain {
    /// `ROS_DOMAIN_ID`.
    pub domain: u32,
    /// A robot's namespace, without its first slash.
    pub namespace: fn(&Name) -> String,
}

impl Ros2Domain {
    /// Adds what somebody of the registry may do.
    pub(super) fn grant(&self, entry: &RegistryEntry, grants: &mut Grants) {
        let domain = self.domain;
        let keys = |names: &[&str]| names.iter().map(|name| format!("{domain}/{name}")).collect::<Vec<_>>();
        let tokens = |ends: &[&str]| Scope::at(ends.iter().map(|end| self.token(end)).collect());
        match entry.role {
            Role::Robot => {
                let namespace = (self.namespace)(&entry.name);
                let own = keys(&[&format!("{namespace}/**")]);
                hears(own.clone(), grants);
                Scope::at(own.clone()).listens(Ask, grants);
                let shared = keys(&["tf/**", "tf_static/**", "diagnostics/**"]);
                Scope::at([own, shared].concat()).speaks(Event, grants);
                let node = format!("*/*/*/*/*/%{}/**", namespace.replace('/', "%"));
                tokens(&[&node]).speaks(Alive, grants);
            }
            Role::Operator | Role::Simulator => {
                let all = Scope::at(keys(&["**"]));
                all.speaks(Event, grants);
                hears(keys(&["**"]), grants);
                all.speaks(Ask, grants);
                all.listens(Ask, grants);
                tokens(&["**"]).speaks(Alive, grants);
            }
            Role::Viewer => {
                hears(keys(&["**"]), grants);
                Scope::at(keys(&["estop/**", "*/estop/**"])).speaks(Ask, grants);
                tokens(&["*/*/*/NN/**", "*/*/*/MS/**", "*/*/*/SC/**"]).speaks(Alive, grants);
            }
            Role::Map => {
                Scope::at(keys(&["map/**"])).speaks(Event, grants);
                tokens(&["*/*/*/NN/*/%/**", "*/*/*/MP/*/%/*/%map/**"]).speaks(Alive, grants);
            }
            Role::Dashboard
            | Role::Dispatcher
            | Role::Traffic
            | Role::Tracker
            | Role::Recorder
            | Role::Router => return,
        }
        tokens(&["**"]).listens(Alive, grants);
        declarations(&format!("{domain}/**"), grants);
        declarations(&self.token("**"), grants);
    }

    fn token(&self, end: &str) -> String {
        format!("{GRAPH}/{}/{end}", self.domain)
    }
}

/// Also shows publishers that it is there, as subscribers of rmw_zenoh do.
fn hears(keys: Vec<String>, grants: &mut Grants) {
    let shown: Vec<String> = keys.iter().map(|key| recovery(key)).collect();
    grants.entry((Flow::Ingress, Message::LivelinessToken)).or_default().extend(shown);
    Scope::at(keys).listens(Event, grants);
}
