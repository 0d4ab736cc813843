//! What a new registry means for a router that runs with an earlier one.

use std::collections::BTreeSet;
use std::fmt;
use xtb_identity::{Registry, Role};
use xtb_protocol::Name;

/// Who comes in with one registry and not with the other.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AdmissionChange {
    /// Not admitted any more, or not in this role, or not with this certificate.
    pub out: BTreeSet<Name>,
    /// Admitted anew.
    pub added: BTreeSet<Name>,
    /// The router has another certificate.
    pub own: bool,
}

impl AdmissionChange {
    /// From the registry that is in force to another.
    #[must_use]
    pub fn between(now: &Registry, then: &Registry) -> Self {
        let (now_in, then_in) = (admitted(now), admitted(then));
        let names = |these: &BTreeSet<Admitted>, those: &BTreeSet<Admitted>| {
            these.difference(those).map(|(name, ..)| name.clone()).collect()
        };
        let out = names(&now_in, &then_in);
        let mut added: BTreeSet<Name> = names(&then_in, &now_in);
        added.retain(|name| !out.contains(name));
        let own = now.router.generation != then.router.generation || now.fleet != then.fleet;
        Self { out, added, own }
    }

    /// Nothing that the rules depend on.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Whether it cannot wait until no robot is driven.
    #[must_use]
    pub fn is_urgent(&self) -> bool {
        !self.out.is_empty() || self.own
    }
}

/// For people: `out: alice; added: xtb-7, xtb-8`.
impl fmt::Display for AdmissionChange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |names: &BTreeSet<Name>| names.iter().map(Name::as_str).collect::<Vec<_>>().join(", ");
        let mut parts = Vec::new();
        if !self.out.is_empty() {
            parts.push(format!("certificates not admitted any more: {}", list(&self.out)));
        }
        if !self.added.is_empty() {
            parts.push(format!("added: {}", list(&self.added)));
        }
        if self.own {
            parts.push("the router's certificate".into());
        }
        f.write_str(&parts.join("; "))
    }
}

type Admitted = (Name, Role, u32);

fn admitted(registry: &Registry) -> BTreeSet<Admitted> {
    registry.admitted().map(|entry| (entry.name.clone(), entry.role, entry.generation)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::SystemTime;
    use xtb_identity::{RegistryEntry, Router};

    fn name(text: &str) -> Name {
        Name::new(text).unwrap()
    }

    fn registry() -> Registry {
        let expires = SystemTime::UNIX_EPOCH;
        let router = Router { names: Vec::new(), port: 7447, generation: 1, expires };
        let mut registry = Registry::new(name("lab"), router);
        for (of, role) in [("alice", Role::Operator), ("xtb-1", Role::Robot)] {
            let entry = RegistryEntry {
                name: name(of),
                role,
                generation: 1,
                expires,
                revoked: false,
                token_sha256: None,
            };
            registry.add(entry).unwrap();
        }
        registry
    }

    #[test]
    fn who_has_to_leave_cannot_wait_and_who_is_added_can() {
        let now = registry();
        assert!(AdmissionChange::between(&now, &now).is_empty());

        let mut revoked = now.clone();
        revoked.get_mut(&name("alice")).unwrap().revoked = true;
        let change = AdmissionChange::between(&now, &revoked);
        assert!(change.is_urgent());
        assert_eq!(change.to_string(), "certificates not admitted any more: alice");

        let change = AdmissionChange::between(&revoked, &now);
        assert!(!change.is_urgent() && !change.is_empty());
        assert_eq!(change.to_string(), "added: alice");

        let mut renewed = now.clone();
        renewed.get_mut(&name("xtb-1")).unwrap().generation = 2;
        assert!(AdmissionChange::between(&now, &renewed).is_urgent());

        let mut signs_in = now.clone();
        signs_in.get_mut(&name("alice")).unwrap().token_sha256 = Some("ab".into());
        assert!(AdmissionChange::between(&now, &signs_in).is_empty());

        let mut own = now.clone();
        own.router.generation = 2;
        assert!(AdmissionChange::between(&now, &own).is_urgent());
    }
}
