//! Zenoh's rules for a fleet with identities, from its registry: nothing is allowed but what the [`table`] allows.
//!
//! A rule admits a message if one of its key expressions includes the message's whole, so who may put on
//! `xtb/lab/*/teleop/alice` cannot put on `xtb/lab/*/teleop/*`. Who certifies as `alice.2` is judged as alice; an
//! earlier certificate, or a revoked one, may only ask what the router says of it.

mod table;

use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use table::{Party, Row, Use};
use xtb_identity::{Entry, Registry, Role};
use xtb_protocol::keys::{FleetKeys, Kind};

/// What Zenoh's recovery of events adds to their key.
const RECOVERY: &str = "@adv/**";
/// The name under which a dispatcher drives.
const DISPATCHER: &str = "dispatch";
/// How the names of a dashboard's sessions begin.
const DASHBOARD: &str = "web";
/// The rules of the router's own certificate, and of whoever has a certificate of the fleet.
const ROUTER: &str = "router";
const ANYBODY: &str = "anybody";

/// Zenoh's `access_control`, in JSON.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessControl(pub(crate) Value);

/// Zenoh's kinds of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Message {
    Put,
    DeclareSubscriber,
    Query,
    DeclareQueryable,
    Reply,
    LivelinessToken,
    DeclareLivelinessSubscriber,
    LivelinessQuery,
}

/// Everything that Zenoh's rules tell apart, for routers.
const EVERY_MESSAGE: [&str; 9] = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "declare_queryable",
    "reply",
    "liveliness_token",
    "declare_liveliness_subscriber",
    "liveliness_query",
];

impl Message {
    fn as_str(self) -> &'static str {
        match self {
            Self::Put => "put",
            Self::DeclareSubscriber => "declare_subscriber",
            Self::Query => "query",
            Self::DeclareQueryable => "declare_queryable",
            Self::Reply => "reply",
            Self::LivelinessToken => "liveliness_token",
            Self::DeclareLivelinessSubscriber => "declare_liveliness_subscriber",
            Self::LivelinessQuery => "liveliness_query",
        }
    }
}

/// Seen from the router.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Flow {
    /// What somebody sends.
    Ingress,
    /// What somebody is sent.
    Egress,
}

impl Flow {
    fn as_str(self) -> &'static str {
        match self {
            Self::Ingress => "ingress",
            Self::Egress => "egress",
        }
    }
}

/// The key expressions of each kind of message that somebody sends or is sent.
type Grants = BTreeMap<(Flow, Message), BTreeSet<String>>;

impl AccessControl {
    /// The rules of this fleet. Of those that have left, and of certificates that have been replaced, nothing
    /// remains.
    #[must_use]
    pub fn of(registry: &Registry) -> Self {
        let keys = FleetKeys::new(registry.fleet.clone());
        let mut rules = Vec::new();
        let mut subjects = Vec::new();
        let mut policies = Vec::new();
        let mut policy = |id: &str, subject: Value, own: Vec<Value>| {
            let ids: Vec<Value> = own.iter().map(|rule| rule["id"].clone()).collect();
            rules.extend(own);
            subjects.push(subject);
            policies.push(json!({ "id": id, "rules": ids, "subjects": [id] }));
        };
        let named = |id: &str| json!({ "id": id, "cert_common_names": [id] });
        let asks = of_parties(&keys, &[Party::Anybody], None);
        policy(ANYBODY, json!({ "id": ANYBODY, "link_protocols": ["tls"] }), allow(ANYBODY, &asks));
        // Of the fleet's own router: the others of its mesh have copies, or certificates of their own.
        let own = format!("{ROUTER}.{}", registry.router.generation);
        policy(&own, named(&own), vec![everything(&own)]);
        for entry in registry.admitted() {
            let id = entry.common_name().to_string();
            let own = match entry.role {
                Role::Router => vec![everything(&id)],
                role => {
                    let mut grants = of_parties(&keys, table::parties(role), Some(entry));
                    declarations(&keys, &mut grants);
                    let mut own = allow(&id, &grants);
                    if role == Role::Simulator {
                        own.push(no_service(&id, &keys));
                    }
                    own
                }
            };
            policy(&id, named(&id), own);
        }
        Self(json!({
            "enabled": true,
            "default_permission": "deny",
            "rules": rules,
            "subjects": subjects,
            "policies": policies,
        }))
    }

    /// As Zenoh's configuration has it.
    #[must_use]
    pub fn json(&self) -> &Value {
        &self.0
    }
}

/// A rule for each kind of message that has keys.
fn allow(id: &str, grants: &Grants) -> Vec<Value> {
    let rule = |(&(flow, message), keys): (&(Flow, Message), &BTreeSet<String>)| {
        json!({
            "id": format!("{id} {} {}", flow.as_str(), message.as_str()),
            "permission": "allow",
            "flows": [flow.as_str()],
            "messages": [message.as_str()],
            "key_exprs": keys,
        })
    };
    grants.iter().map(rule).collect()
}

/// A router sends on what others have sent it, and those were judged where they came in.
fn everything(id: &str) -> Value {
    json!({
        "id": id,
        "permission": "allow",
        "flows": [Flow::Ingress.as_str(), Flow::Egress.as_str()],
        "messages": EVERY_MESSAGE,
        "key_exprs": ["**", format!("**/{RECOVERY}")],
    })
}

/// The robots of a simulator have any name, but none that is a service's: `xtb/lab/*/event` has the dispatcher's
/// events in it.
fn no_service(id: &str, keys: &FleetKeys) -> Value {
    let any = keys.any_robot();
    let services = [Kind::TrafficAlive, Kind::TrafficState, Kind::DispatchAlive, Kind::DispatchEvent];
    let mut denied: Vec<String> = services.map(|kind| kind.key_expr(keys, &any)).to_vec();
    denied.push(Kind::DispatchCmd.key_expr(keys, &any));
    denied.push(recovery(&Kind::DispatchEvent.key_expr(keys, &any)));
    json!({
        "id": format!("{id} is no service"),
        "permission": "deny",
        "flows": [Flow::Ingress.as_str()],
        "messages": ["put", "declare_queryable", "reply", "liveliness_token"],
        "key_exprs": denied,
    })
}

fn recovery(key: &str) -> String {
    format!("{key}/{RECOVERY}")
}

/// What somebody who takes part in all of these may send and be sent.
fn of_parties(keys: &FleetKeys, parties: &[Party], entry: Option<&Entry>) -> Grants {
    let mut grants = Grants::new();
    for &kind in Kind::ALL {
        for Row(how, from, to) in table::rows(kind) {
            for &party in parties {
                let scope = Scope::of(keys, kind, party, entry);
                if to.contains(&party) {
                    scope.listens(*how, &mut grants);
                }
                if from.contains(&party) {
                    scope.under(&clients(kind, party, entry)).speaks(*how, &mut grants);
                }
            }
        }
    }
    grants
}

/// The declarations of others, without which Zenoh sends nothing to them.
fn declarations(keys: &FleetKeys, grants: &mut Grants) {
    for message in [
        Message::DeclareSubscriber,
        Message::DeclareQueryable,
        Message::LivelinessQuery,
        Message::DeclareLivelinessSubscriber,
    ] {
        let all = keys.everything();
        grants.entry((Flow::Egress, message)).or_default().extend([recovery(&all), all]);
    }
}

/// A channel's keys for one party.
struct Scope {
    /// Its own.
    own: Vec<String>,
    /// Those on which others mean it, beside these.
    called: Vec<String>,
    /// Robots take an emergency stop also from who means all of them.
    put_to_all: bool,
}

impl Scope {
    fn of(keys: &FleetKeys, kind: Kind, party: Party, entry: Option<&Entry>) -> Self {
        let any = keys.any_robot();
        let called = if party == Party::Robot { vec![kind.key_expr(keys, &any)] } else { Vec::new() };
        let robot = match entry {
            Some(entry) if party == Party::Robot && entry.role == Role::Robot => keys.robot(&entry.name),
            _ => any,
        };
        Self { own: vec![kind.key_expr(keys, &robot)], called, put_to_all: kind == Kind::Estop }
    }

    /// The keys that name these clients, of those that name any; all of them if there are none.
    fn under(mut self, clients: &[String]) -> Self {
        if !clients.is_empty() {
            // `…/cmd/*` → `…/cmd/alice`
            let named = |key: &String| {
                let stem = key.trim_end_matches('*').to_owned();
                clients.iter().map(move |client| format!("{stem}{client}"))
            };
            self.own = self.own.iter().flat_map(named).collect();
        }
        self
    }

    /// It publishes, asks, or is there.
    fn speaks(&self, how: Use, grants: &mut Grants) {
        use Flow::{Egress, Ingress};
        match how {
            Use::Put => self.grant(grants, Ingress, Message::Put),
            Use::Ask => {
                self.grant(grants, Ingress, Message::Query);
                self.grant(grants, Egress, Message::Reply);
            }
            Use::Alive => self.grant(grants, Ingress, Message::LivelinessToken),
            Use::AliveNow => {}
            Use::Event => {
                self.grant(grants, Ingress, Message::Put);
                self.grant(grants, Ingress, Message::Reply);
                let recovery = self.recovery();
                for message in
                    [Message::Put, Message::DeclareQueryable, Message::Reply, Message::LivelinessToken]
                {
                    recovery.grant(grants, Ingress, message);
                }
                recovery.grant_called(grants, Message::Query);
            }
        }
    }

    /// It hears, answers, or sees who is there.
    fn listens(&self, how: Use, grants: &mut Grants) {
        use Flow::{Egress, Ingress};
        match how {
            Use::Put => {
                self.grant(grants, Ingress, Message::DeclareSubscriber);
                self.grant(grants, Egress, Message::Put);
                if self.put_to_all {
                    self.grant_called(grants, Message::Put);
                }
            }
            Use::Ask => {
                self.grant(grants, Ingress, Message::DeclareQueryable);
                self.grant(grants, Ingress, Message::Reply);
                self.grant_called(grants, Message::Query);
            }
            Use::AliveNow => {
                self.grant(grants, Ingress, Message::LivelinessQuery);
                self.grant(grants, Egress, Message::LivelinessToken);
            }
            Use::Alive => {
                self.grant(grants, Ingress, Message::LivelinessQuery);
                self.grant(grants, Ingress, Message::DeclareLivelinessSubscriber);
                self.grant(grants, Egress, Message::LivelinessToken);
            }
            Use::Event => {
                self.listens(Use::Put, grants);
                self.grant(grants, Egress, Message::Reply);
                let recovery = self.recovery();
                recovery.listens(Use::Put, grants);
                recovery.speaks(Use::Ask, grants);
                recovery.listens(Use::Alive, grants);
            }
        }
    }

    fn recovery(&self) -> Self {
        let of = |keys: &[String]| keys.iter().map(|key| recovery(key)).collect();
        Self { own: of(&self.own), called: of(&self.called), put_to_all: self.put_to_all }
    }

    fn grant(&self, grants: &mut Grants, flow: Flow, message: Message) {
        grants.entry((flow, message)).or_default().extend(self.own.iter().cloned());
    }

    /// What it is sent on its own keys, and on those that mean all.
    fn grant_called(&self, grants: &mut Grants, message: Message) {
        self.grant(grants, Flow::Egress, message);
        grants.entry((Flow::Egress, message)).or_default().extend(self.called.iter().cloned());
    }
}

/// The client names that stand in the keys of a party that asks or puts.
fn clients(kind: Kind, party: Party, entry: Option<&Entry>) -> Vec<String> {
    let Some(entry) = entry.filter(|_| kind.names_client()) else { return Vec::new() };
    let sessions = |stem: &str| format!("{stem}-$*");
    match party {
        Party::Dispatcher => vec![DISPATCHER.to_owned()],
        _ if entry.role == Role::Dashboard => vec![sessions(DASHBOARD)],
        _ => vec![entry.name.to_string(), sessions(entry.name.as_str())],
    }
}
