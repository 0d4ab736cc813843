//! Whether identities and routers keep others out, and what will run out. Pure: facts in, findings out.

use super::super::finding::Finding;
use std::collections::{BTreeMap, BTreeSet};
use std::net::IpAddr;
use std::path::PathBuf;
use std::time::{Duration, SystemTime};
use xtb_bus::link_problem::Admits;
use xtb_identity::certificate::Certificate;
use xtb_identity::{Identity, Registry};
use xtb_protocol::Name;

const TOPIC: &str = "security";
/// Certificates that end sooner are to be renewed.
const SOON: Duration = Duration::from_secs(30 * 24 * 3600);

/// What there is to keep others out.
pub(in super::super) struct Security {
    /// By this computer.
    pub(in super::super) now: SystemTime,
    /// The routers.
    pub(in super::super) endpoints: Vec<String>,
    /// Who is there, by these routers.
    pub(in super::super) robots: BTreeSet<Name>,
    /// The own identity.
    pub(in super::super) identity: Option<Identity>,
    /// Secrets that other users of this computer can read, with their modes.
    pub(in super::super) readable: Vec<(PathBuf, u32)>,
    /// The fleet's registry, if it is here.
    pub(in super::super) registry: Option<Result<Registry, String>>,
    /// What routers with TLS let in, by endpoint.
    pub(in super::super) routers: BTreeMap<String, Admits>,
    /// A robot that answered this identity under the name of another.
    pub(in super::super) answers_others: Option<(Name, Name)>,
}

impl Security {
    /// What is wrong, and what was found in order.
    pub(in super::super) fn findings(&self) -> Vec<Finding> {
        let mut found: Vec<Finding> = self.readable.iter().map(readable).collect();
        match &self.identity {
            Some(identity) => found.extend(self.with(identity)),
            None => found.extend(self.without()),
        }
        match &self.registry {
            Some(Ok(registry)) => found.extend(self.registered(registry)),
            Some(Err(reason)) => {
                found.push(Finding::problem(
                    TOPIC,
                    reason.clone(),
                    "restore it from a copy of the PKI folder",
                ));
            }
            None => {}
        }
        found
    }

    fn without(&self) -> Option<Finding> {
        let open: Vec<&str> =
            self.endpoints.iter().filter(|endpoint| is_open(endpoint)).map(String::as_str).collect();
        let names: Vec<&str> = self.robots.iter().map(Name::as_str).collect();
        let without_tls = match &names[..] {
            [] => String::new(),
            names => format!("; without TLS there: {}", names.join(", ")),
        };
        let text = format!(
            "{} lets in everybody: whoever reaches it could drive every robot{without_tls}",
            open.join(", ")
        );
        let hint =
            "set up identities: `fleet-cli pki init`, then `fleet-cli router --listen tls/0.0.0.0:7447`";
        (!open.is_empty()).then(|| Finding::warning(TOPIC, text, hint))
    }

    fn with(&self, identity: &Identity) -> Vec<Finding> {
        let mut found = Vec::new();
        if let Ok(Certificate { not_after, .. }) = identity.certificate() {
            let what = format!("the certificate of {}", identity.name);
            let hint = format!("renew it where the CA is: `fleet-cli pki renew {}`", identity.name);
            found.push(self.lasts(&what, not_after, hint).unwrap_or_else(|| {
                let text = format!(
                    "{} ({}); {what} is valid until {}",
                    identity.name,
                    identity.role,
                    day(not_after)
                );
                Finding::ok(TOPIC, text)
            }));
        }
        if let Ok(ca) = Certificate::parse(&identity.ca)
            && !(ca.not_before..=ca.not_after).contains(&self.now)
        {
            let text = format!(
                "this computer's clock says {}, but the fleet's CA is valid from {} to {}",
                day(self.now),
                day(ca.not_before),
                day(ca.not_after)
            );
            found.push(Finding::problem(TOPIC, text, "set the clock: `timedatectl` shows it"));
        }
        for (endpoint, admits) in &self.routers {
            found.extend(self.router(endpoint, admits));
        }
        if let Some((robot, other)) = &self.answers_others {
            let text = format!("answers a command of {} under the name {other}", identity.name);
            let hint =
                "the router does not check names: run it with `fleet-cli router` and the fleet's PKI folder";
            found.push(Finding::problem(TOPIC, text, hint).of(robot));
        }
        found
    }

    fn router(&self, endpoint: &str, admits: &Admits) -> Vec<Finding> {
        let Admits { certificate, anonymous, plain } = admits;
        let mut found = Vec::new();
        if *anonymous {
            let text = format!("the router at {endpoint} accepts connections without a certificate");
            let hint = "run it with `fleet-cli router`, or zenohd with the rules of `--print-acl` and mTLS";
            found.push(Finding::problem(TOPIC, text, hint));
        }
        if *plain {
            let text = format!("the router at {endpoint} opens sessions without TLS");
            found.push(Finding::problem(TOPIC, text, "end its tcp/ listeners that others can reach"));
        }
        let hint = "renew it where the CA is: `fleet-cli pki renew --router`".to_owned();
        let what = format!("the certificate of the router at {endpoint}");
        found.push(self.lasts(&what, certificate.not_after, hint).unwrap_or_else(|| {
            let names = certificate.hosts.join(", ");
            let text =
                format!("router {endpoint}: names {names}; valid until {}", day(certificate.not_after));
            Finding::ok(TOPIC, text)
        }));
        found
    }

    fn registered(&self, registry: &Registry) -> Vec<Finding> {
        let router = self.lasts(
            "the router's certificate",
            registry.router.expires,
            "renew it: `fleet-cli pki renew --router`".to_owned(),
        );
        let entries = registry.admitted().filter_map(|entry| {
            let hint = format!("renew it: `fleet-cli pki renew {}`", entry.name);
            self.lasts(&format!("the certificate of {}", entry.name), entry.expires, hint)
        });
        let mut found: Vec<Finding> = router.into_iter().chain(entries).collect();
        // Each once, though the own certificate is also an entry.
        found.retain(|finding| {
            !self.identity.as_ref().is_some_and(|own| {
                own.fleet == registry.fleet
                    && finding.text.starts_with(&format!("the certificate of {} ", own.name))
            })
        });
        if found.is_empty() {
            let text =
                format!("registry of fleet {}: {} identities", registry.fleet, registry.admitted().count());
            found.push(Finding::ok(TOPIC, text));
        }
        found
    }

    /// `None` = it lasts for longer than a month.
    fn lasts(&self, what: &str, until: SystemTime, hint: String) -> Option<Finding> {
        match until.duration_since(self.now) {
            Err(_) => Some(Finding::problem(TOPIC, format!("{what} expired on {}", day(until)), hint)),
            Ok(left) if left <= SOON => {
                let days = left.as_secs() / (24 * 3600);
                let text = format!("{what} expires in {days} days, on {}", day(until));
                Some(Finding::warning(TOPIC, text, hint))
            }
            Ok(_) => None,
        }
    }
}

fn readable((path, mode): &(PathBuf, u32)) -> Finding {
    let (path, is_folder) = (path.display(), path.extension().is_none());
    let right = if is_folder { 700 } else { 600 };
    let text = format!("other users of this computer can read {path} (mode {mode:o})");
    Finding::problem(TOPIC, text, format!("`chmod {right} {path}`; if others were here, renew what is in it"))
}

/// Whether others than this computer reach it, without TLS.
fn is_open(endpoint: &str) -> bool {
    let Some(address) = endpoint.strip_prefix("tcp/") else { return false };
    let host = address.rsplit_once(':').map_or(address, |(host, _)| host);
    let bare = host.trim_start_matches('[').trim_end_matches(']');
    match bare.parse::<IpAddr>() {
        Ok(address) => !address.is_loopback(),
        Err(_) => bare != "localhost",
    }
}

fn day(time: SystemTime) -> String {
    humantime::format_rfc3339_seconds(time).to_string().chars().take(10).collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::finding::Level;
    use super::*;
    use std::time::UNIX_EPOCH;
    use xtb_client::fake::name;
    use xtb_identity::{RegistryEntry, Role, Router};

    fn at(days: u64) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs((20_000 + days) * 24 * 3600)
    }

    fn nothing() -> Security {
        Security {
            now: at(0),
            robots: BTreeSet::new(),
            endpoints: vec!["tcp/127.0.0.1:7447".into()],
            identity: None,
            readable: Vec::new(),
            registry: None,
            routers: BTreeMap::new(),
            answers_others: None,
        }
    }

    fn wrong(security: &Security) -> Vec<(Level, String)> {
        let found = security.findings().into_iter().filter(|finding| finding.level != Level::Ok);
        found.map(|finding| (finding.level, finding.text)).collect()
    }

    #[test]
    fn a_router_that_lets_in_everybody_is_worth_a_warning_unless_it_is_only_this_computers() {
        for own in ["tcp/127.0.0.1:7447", "tcp/[::1]:7447", "tcp/localhost:7447"] {
            assert_eq!(wrong(&Security { endpoints: vec![own.into()], ..nothing() }), [], "{own}");
        }
        let endpoints = vec!["tcp/10.0.0.1:7447".to_owned()];
        let robots = ["xtb-1", "xtb-2"].map(|robot| Name::new(robot).unwrap()).into();
        let found = wrong(&Security { endpoints, robots, ..nothing() });
        let text = "tcp/10.0.0.1:7447 lets in everybody: whoever reaches it could drive every robot; without TLS \
                    there: xtb-1, xtb-2";
        assert_eq!(found, [(Level::Warning, text.to_owned())]);
    }

    #[test]
    fn certificates_of_the_registry_that_end_soon_or_have_ended_are_named() {
        let router = Router { names: Vec::new(), port: 7447, generation: 1, expires: at(300) };
        let mut registry = Registry::new(name("lab"), router);
        for (who, days, revoked) in [("alice", 300, false), ("bob", 29, false), ("carol", 5, true)] {
            let (role, expires) = (Role::Operator, at(days));
            let entry =
                RegistryEntry { name: name(who), role, generation: 1, expires, revoked, token_sha256: None };
            registry.add(entry).unwrap();
        }
        let of = |now| Security { now, registry: Some(Ok(registry.clone())), ..nothing() };
        let soon = "the certificate of bob expires in 29 days, on 2024-11-02";
        assert_eq!(wrong(&of(at(0))), [(Level::Warning, soon.to_owned())]);
        let late = "the certificate of bob expired on 2024-11-02".to_owned();
        assert_eq!(wrong(&of(at(30)))[0], (Level::Problem, late));
    }

    #[test]
    fn secrets_that_others_can_read_are_a_problem() {
        let readable = vec![("/home/a/.config/xtb/identity/key.pem".into(), 0o644)];
        let found = Security { readable, ..nothing() }.findings();
        assert!(found[0].text.ends_with("key.pem (mode 644)"), "{found:?}");
        assert!(found[0].hint.as_ref().unwrap().starts_with("`chmod 600 "), "{found:?}");
    }

    #[test]
    fn a_router_that_lets_in_who_has_no_certificate_is_a_problem() {
        let hosts = vec!["10.0.0.1".to_owned()];
        let certificate = Certificate {
            subject: "router.1".into(),
            not_before: at(0),
            not_after: at(365),
            hosts,
            public_key: Vec::new(),
        };
        let own = Identity::new(
            name("lab"),
            "alice.1".parse().unwrap(),
            Role::Viewer,
            Vec::new(),
            String::new(),
            String::new(),
            String::new(),
        );
        let of = |anonymous, plain| {
            let admits = Admits { certificate: certificate.clone(), anonymous, plain };
            let routers = BTreeMap::from([("tls/10.0.0.1:7447".to_owned(), admits)]);
            Security { routers, identity: Some(own.clone()), ..nothing() }
        };
        assert_eq!(wrong(&of(false, false)), []);
        let ok = of(false, false).findings();
        assert_eq!(ok[0].text, "router tls/10.0.0.1:7447: names 10.0.0.1; valid until 2025-10-04");
        let found = wrong(&of(true, true));
        assert!(
            found[0].1.contains("without a certificate") && found[1].1.contains("without TLS"),
            "{found:?}"
        );
        let answered = Some((name("xtb-1"), name("probe-1")));
        let found = wrong(&Security { answers_others: answered, ..of(false, false) });
        assert_eq!(found[0].1, "answers a command of alice under the name probe-1");
    }
}
