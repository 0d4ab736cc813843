//! What somebody may send and be sent, from the table: key expressions for each kind of message.

use super::table::{self, Party, Row, Use};
use std::collections::{BTreeMap, BTreeSet};
use xtb_identity::{RegistryEntry, Role};
use xtb_protocol::keys::{FleetKeys, Kind};

/// What Zenoh's recovery of events adds to their key.
pub(super) const RECOVERY: &str = "@adv/**";
/// The name under which a dispatcher drives.
const DISPATCHER: &str = "dispatch";
/// How the names of a dashboard's sessions begin.
const DASHBOARD: &str = "web";
/// Zenoh's kinds of messages.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Message {
    Put,
    DeclareSubscriber,
    Query,
    DeclareQueryable,
    Reply,
    LivelinessToken,
    DeclareLivelinessSubscriber,
    LivelinessQuery,
}

impl Message {
    pub(super) fn as_str(self) -> &'static str {
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
pub(super) enum Flow {
    /// What somebody sends.
    Ingress,
    /// What somebody is sent.
    Egress,
}

impl Flow {
    pub(super) fn as_str(self) -> &'static str {
        match self {
            Self::Ingress => "ingress",
            Self::Egress => "egress",
        }
    }
}

/// The key expressions of each kind of message that somebody sends or is sent.
pub(super) type Grants = BTreeMap<(Flow, Message), BTreeSet<String>>;

pub(super) fn recovery(key: &str) -> String {
    format!("{key}/{RECOVERY}")
}

/// What somebody who takes part in all of these may send and be sent.
pub(super) fn of_parties(keys: &FleetKeys, parties: &[Party], entry: Option<&RegistryEntry>) -> Grants {
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

/// The declarations of others on these keys, without which Zenoh sends nothing to them.
pub(super) fn declarations(all: &str, grants: &mut Grants) {
    for message in [
        Message::DeclareSubscriber,
        Message::DeclareQueryable,
        Message::LivelinessQuery,
        Message::DeclareLivelinessSubscriber,
    ] {
        grants.entry((Flow::Egress, message)).or_default().extend([recovery(all), all.to_owned()]);
    }
}

/// A channel's keys for one party.
pub(super) struct Scope {
    /// Its own.
    own: Vec<String>,
    /// Those on which others mean it, beside these.
    called: Vec<String>,
    /// Robots take an emergency stop also from who means all of them.
    put_to_all: bool,
}

impl Scope {
    /// Keys that are a party's own alone.
    pub(super) fn at(own: Vec<String>) -> Self {
        Self { own, called: Vec::new(), put_to_all: false }
    }

    fn of(keys: &FleetKeys, kind: Kind, party: Party, entry: Option<&RegistryEntry>) -> Self {
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
    pub(super) fn speaks(&self, how: Use, grants: &mut Grants) {
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
    pub(super) fn listens(&self, how: Use, grants: &mut Grants) {
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
fn clients(kind: Kind, party: Party, entry: Option<&RegistryEntry>) -> Vec<String> {
    let Some(entry) = entry.filter(|_| kind.names_client()) else { return Vec::new() };
    let sessions = |stem: &str| format!("{stem}-$*");
    match party {
        Party::Dispatcher => vec![DISPATCHER.to_owned()],
        _ if entry.role == Role::Dashboard => vec![sessions(DASHBOARD)],
        _ => vec![entry.name.to_string(), sessions(entry.name.as_str())],
    }
}
