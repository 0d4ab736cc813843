//! Zenoh's rules for a fleet with identities, from its registry: nothing is allowed but what the [`table`] allows.
//!
//! A rule admits a message if one of its key expressions includes the message's whole, so who may put on
//! `xtb/lab/*/teleop/alice` cannot put on `xtb/lab/*/teleop/*`. Who certifies as `alice.2` is judged as alice; an
//! earlier certificate, or a revoked one, may only ask what the router says of it.

mod grants;
mod ros2;
mod table;

pub use ros2::Ros2Domain;

use grants::{Flow, Grants, Message, RECOVERY, declarations, of_parties, recovery};
use ros2::GRAPH;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use table::Party;
use xtb_identity::{Registry, Role};
use xtb_protocol::keys::{FleetKeys, Kind};

/// The rules of the router's own certificate, and of whoever has a certificate of the fleet.
const ROUTER: &str = "router";
const ANYBODY: &str = "anybody";

/// Zenoh's `access_control`, in JSON.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessControl(pub(crate) Value);

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

impl AccessControl {
    /// The rules of this fleet. Of those that have left, and of certificates that have been replaced, nothing
    /// remains. Where the router carries ROS 2 too, its rows are in [`Ros2Domain`]'s module.
    #[must_use]
    pub fn of(registry: &Registry, ros2: Option<&Ros2Domain>) -> Self {
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
                    declarations(&keys.everything(), &mut grants);
                    if let Some(domain) = ros2 {
                        domain.grant(entry, &mut grants);
                    }
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
        "key_exprs": ["**", format!("**/{RECOVERY}"), format!("{GRAPH}/**")],
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;
    use table::Row;
    use xtb_identity::{RegistryEntry, Router};
    use xtb_protocol::Name;
    use zenoh::key_expr::keyexpr;

    fn registry(entries: &[(&str, Role)]) -> Registry {
        let name = |text| Name::new(text).unwrap();
        let expires = SystemTime::UNIX_EPOCH;
        let router = Router { names: Vec::new(), port: 7447, generation: 3, expires };
        let mut registry = Registry::new(name("lab"), router);
        for (of, role) in entries {
            let (name, role) = (name(of), *role);
            registry
                .add(RegistryEntry { name, role, generation: 2, expires, revoked: false, token_sha256: None })
                .unwrap();
        }
        registry
    }

    /// Whether a certificate's own rules admit a message; the rules that deny come first.
    fn may(rules: &AccessControl, common_name: &str, flow: &str, message: &str, key: &str) -> bool {
        let has = |list: &Value, text: &str| list.as_array().unwrap().iter().any(|item| item == text);
        let policy = |policy: &&Value| has(&policy["subjects"], common_name);
        let Some(policy) = rules.0["policies"].as_array().unwrap().iter().find(policy) else { return false };
        let covers = |permission: &str| {
            rules.0["rules"].as_array().unwrap().iter().any(|rule| {
                let keys = rule["key_exprs"].as_array().unwrap().iter();
                has(&policy["rules"], rule["id"].as_str().unwrap())
                    && rule["permission"] == permission
                    && has(&rule["flows"], flow)
                    && has(&rule["messages"], message)
                    && keys.into_iter().any(|own| {
                        keyexpr::new(own.as_str().unwrap()).unwrap().includes(keyexpr::new(key).unwrap())
                    })
            })
        };
        covers("allow") && !covers("deny")
    }

    #[test]
    fn every_channel_is_used_by_somebody_for_somebody() {
        for kind in Kind::ALL {
            let rows = table::rows(*kind);
            assert!(!rows.is_empty(), "{kind:?} has no row: nobody may use it");
            for Row(how, from, to) in rows {
                assert!(!from.is_empty() && !to.is_empty(), "{kind:?} {how:?}");
                for party in from.iter().chain(*to).filter(|party| **party != Party::Anybody) {
                    let has = |role: &Role| table::parties(*role).contains(party);
                    assert!(Role::ALL.iter().any(has), "no role has {party:?}");
                }
            }
        }
    }

    #[test]
    fn a_certificate_counts_in_its_generation_only_and_a_revoked_one_not_at_all() {
        let mut registry = registry(&[("alice", Role::Operator)]);
        let key = "xtb/lab/xtb-1/cmd/alice";
        let rules = AccessControl::of(&registry, None);
        assert!(may(&rules, "alice.2", "ingress", "query", key));
        assert!(!may(&rules, "alice.1", "ingress", "query", key));
        assert!(!may(&rules, "alice.3", "ingress", "query", key));
        registry.identities[0].revoked = true;
        assert!(!may(&AccessControl::of(&registry, None), "alice.2", "ingress", "query", key));
        // The router's own certificate, which those of a mesh have too.
        assert!(may(&rules, "router.3", "ingress", "put", "xtb/lab/xtb-1/state"));
        assert!(!may(&rules, "router.2", "ingress", "put", "xtb/lab/xtb-1/state"));
    }

    #[test]
    fn a_persons_rules_cover_the_persons_sessions_and_nobody_elses() {
        let rules =
            AccessControl::of(&registry(&[("alice", Role::Operator), ("page", Role::Dashboard)]), None);
        for (own, covered) in [("alice", true), ("alice-3f9a1c", true), ("alicex", false), ("bob", false)] {
            let key = format!("xtb/lab/xtb-1/teleop/{own}");
            assert_eq!(may(&rules, "alice.2", "ingress", "put", &key), covered, "{own}");
        }
        for (own, covered) in
            [("web-alice-3f9a1c", true), ("web-3f9a1c", true), ("page", false), ("web", false)]
        {
            let key = format!("xtb/lab/xtb-1/cmd/{own}");
            assert_eq!(may(&rules, "page.2", "ingress", "query", &key), covered, "{own}");
        }
    }

    #[test]
    fn only_what_is_in_the_table_has_keys_and_no_fleet_but_its_own_is_named() {
        let everybody: Vec<(String, Role)> = Role::ALL.map(|role| (format!("x{role}"), role)).to_vec();
        let everybody: Vec<(&str, Role)> = everybody.iter().map(|(of, role)| (of.as_str(), *role)).collect();
        let rules = AccessControl::of(&registry(&everybody), None);
        assert_eq!((&rules.0["enabled"], &rules.0["default_permission"]), (&json!(true), &json!("deny")));
        for rule in rules.0["rules"].as_array().unwrap() {
            let id = rule["id"].as_str().unwrap();
            let is_router = id.starts_with("router.") || id.starts_with("xrouter.");
            for key in rule["key_exprs"].as_array().unwrap() {
                assert!(is_router || key.as_str().unwrap().starts_with("xtb/lab/"), "{id}: {key}");
            }
            assert!(is_router || !rule["messages"].as_array().unwrap().contains(&json!("delete")), "{id}");
        }
        assert_eq!(rules.0["subjects"].as_array().unwrap().len(), 2 + Role::ALL.len());
    }

    #[test]
    fn a_domain_of_ros_2_has_rules_by_role_and_takes_no_key_of_ours() {
        let of_robot = |name: &Name| name.as_str().replace('-', "_");
        let ros2 = Ros2Domain { domain: 7, namespace: of_robot };
        let people = [
            ("xtb-1", Role::Robot),
            ("lab", Role::Robot),
            ("alice", Role::Operator),
            ("vera", Role::Viewer),
            ("maps", Role::Map),
        ];
        let rules = AccessControl::of(&registry(&people), Some(&ros2));
        let put = |who: &str, key: &str| may(&rules, who, "ingress", "put", key);
        for (who, key, allowed) in [
            ("xtb-1.2", "7/xtb_1/odom/T/H", true),
            ("xtb-1.2", "7/tf/T/H", true),
            ("xtb-1.2", "7/xtb_2/odom/T/H", false),
            ("xtb-1.2", "7/xtb_2/cmd_vel/T/H", false),
            ("xtb-1.2", "8/xtb_1/odom/T/H", false),
            ("alice.2", "7/xtb_1/cmd_vel/T/H", true),
            ("alice.2", "8/xtb_1/cmd_vel/T/H", false),
            ("vera.2", "7/xtb_1/cmd_vel/T/H", false),
            ("maps.2", "7/map/T/H", true),
            ("maps.2", "7/xtb_1/cmd_vel/T/H", false),
            // A robot that is called as its fleet: its namespace has none of the fleet's keys.
            ("lab.2", "7/lab/odom/T/H", true),
            ("lab.2", "xtb/lab/xtb-1/state", false),
        ] {
            assert_eq!(put(who, key), allowed, "{who} {key}");
        }
        let ask = |who: &str, key: &str| may(&rules, who, "ingress", "query", key);
        assert!(ask("vera.2", "7/xtb_1/estop/T/H") && ask("vera.2", "7/estop/T/H"));
        assert!(!ask("vera.2", "7/xtb_1/take_control/T/H") && !ask("xtb-1.2", "7/xtb_2/stop/T/H"));
        assert!(ask("vera.2", "7/xtb_1/robot_description/T/H/@adv/pub/a/1/_"));
        let token = |who: &str, key: &str| may(&rules, who, "ingress", "liveliness_token", key);
        let odom = "@ros2_lv/7/a/1/2/MP/%/%xtb_1/xtb_agent/%xtb_1%odom/T/H/::,10:,:,:,,";
        assert!(token("xtb-1.2", odom) && token("xtb-1.2", "@ros2_lv/7/a/1/1/NN/%/%xtb_1/xtb_agent"));
        assert!(!token("vera.2", odom) && !token("lab.2", odom));
    }
}
