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
//! A node of ROS is what its certificate is: who drives by `cmd_vel` has to be an operator.

use super::grants::{Flow, Grants, Message, recovery};
use xtb_identity::{Entry, Role};
use xtb_protocol::Name;

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
    pub(super) fn grant(&self, entry: &Entry, grants: &mut Grants) {
        let domain = self.domain;
        let topic = |name: &str| vec![format!("{domain}/{name}/**")];
        let all = vec![format!("{domain}/**")];
        let tokens = |rest: &str| vec![format!("@ros2_lv/{domain}/{rest}")];
        let mut own = Own(grants);
        match entry.role {
            Role::Robot => {
                let namespace = (self.namespace)(&entry.name);
                let space = topic(&namespace);
                own.publishes(&space);
                ["tf", "tf_static", "diagnostics"].iter().for_each(|name| own.publishes(&topic(name)));
                own.hears(&space);
                own.answers(&space);
                own.is(&tokens(&format!("*/*/*/*/*/%{}/**", namespace.replace('/', "%"))));
            }
            Role::Operator | Role::Simulator => {
                own.publishes(&all);
                own.hears(&all);
                own.answers(&all);
                own.asks(&all);
                own.is(&tokens("**"));
            }
            Role::Viewer => {
                own.hears(&all);
                own.asks(&[format!("{domain}/estop/**"), format!("{domain}/*/estop/**")]);
                own.is(&["NN", "MS", "SC"].map(|kind| format!("@ros2_lv/{domain}/*/*/*/{kind}/**")));
            }
            Role::Map => {
                own.publishes(&topic("map"));
                own.is(&tokens("*/*/*/NN/*/%/**"));
                own.is(&tokens("*/*/*/MP/*/%/*/%map/**"));
            }
            Role::Dashboard
            | Role::Dispatcher
            | Role::Traffic
            | Role::Tracker
            | Role::Recorder
            | Role::Router => return,
        }
        own.sees(&tokens("**"));
        own.learns(&[all, tokens("**")].concat());
    }
}

/// The grants of one of the registry.
struct Own<'a>(&'a mut Grants);

impl Own<'_> {
    fn grant(&mut self, flow: Flow, messages: &[Message], keys: &[String]) {
        for message in messages {
            self.0.entry((flow, *message)).or_default().extend(keys.iter().cloned());
        }
    }

    /// Also what is latched, which late subscribers ask for.
    fn publishes(&mut self, keys: &[String]) {
        self.grant(Flow::Ingress, &[Message::Put, Message::Reply], keys);
        let cached = recovered(keys);
        let cache = [Message::Put, Message::DeclareQueryable, Message::Reply, Message::LivelinessToken];
        self.grant(Flow::Ingress, &cache, &cached);
        self.grant(Flow::Egress, &[Message::Query], &cached);
    }

    fn hears(&mut self, keys: &[String]) {
        self.grant(Flow::Ingress, &[Message::DeclareSubscriber], keys);
        self.grant(Flow::Egress, &[Message::Put, Message::Reply], keys);
        let cached = recovered(keys);
        let asked = [
            Message::DeclareSubscriber,
            Message::Query,
            Message::LivelinessQuery,
            Message::DeclareLivelinessSubscriber,
            // Of a late subscriber, which publishers look for.
            Message::LivelinessToken,
        ];
        self.grant(Flow::Ingress, &asked, &cached);
        self.grant(Flow::Egress, &[Message::Put, Message::Reply, Message::LivelinessToken], &cached);
    }

    fn answers(&mut self, keys: &[String]) {
        self.grant(Flow::Ingress, &[Message::DeclareQueryable, Message::Reply], keys);
        self.grant(Flow::Egress, &[Message::Query], keys);
    }

    fn asks(&mut self, keys: &[String]) {
        self.grant(Flow::Ingress, &[Message::Query], keys);
        self.grant(Flow::Egress, &[Message::Reply], keys);
    }

    fn is(&mut self, tokens: &[String]) {
        self.grant(Flow::Ingress, &[Message::LivelinessToken], tokens);
    }

    fn sees(&mut self, tokens: &[String]) {
        let looks = [Message::LivelinessQuery, Message::DeclareLivelinessSubscriber];
        self.grant(Flow::Ingress, &looks, tokens);
        self.grant(Flow::Egress, &[Message::LivelinessToken], tokens);
    }

    /// The declarations of others, without which Zenoh sends nothing to them.
    fn learns(&mut self, keys: &[String]) {
        let declarations = [
            Message::DeclareSubscriber,
            Message::DeclareQueryable,
            Message::LivelinessQuery,
            Message::DeclareLivelinessSubscriber,
        ];
        self.grant(Flow::Egress, &declarations, keys);
        self.grant(Flow::Egress, &declarations, &recovered(keys));
    }
}

fn recovered(keys: &[String]) -> Vec<String> {
    keys.iter().map(|key| recovery(key)).collect()
}
