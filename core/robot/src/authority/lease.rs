//! The lease: control of a robot, granted by the robot alone.
//!
//! ```text
//!            acquire, take              acquire by another: refused, with the holder's name
//!   free ────────────────────► held ◄─┐ any accepted message that bears it: heard
//!    ▲                          │ │   └─ retain, each 100 ms
//!    │ release · 900 ms silence │ └──── take by another ──► held by that one, under a new root
//!    └──────────────────────────┘
//! ```
//! A lease is `{epoch, root}`: the epoch is random at boot, the root rises with each grant. So a
//! message of another boot, of a holder who was replaced, or of an earlier process with the same
//! client's name bears a lease that is no longer the present one, and counts for nothing.

use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::messages::{Lease, LeaseState};

/// A lease that was not heard of for this long is free again: within a second, as docs/safety.md has it.
pub const LEASE_FREE_MS: u64 = 900;
/// A goal that halts on link loss ends after this much silence of the holder, so that the motor is neutral
/// within 700 ms with a retain's age and a pulse's way (docs/safety.md).
pub const LINK_LOSS_MS: u64 = 500;

/// The present grant.
#[derive(Debug, Clone)]
struct Held {
    holder: Name,
    root: u32,
    heard: Stamp,
}

/// The robot's book of its one lease.
#[derive(Debug, Clone)]
pub struct LeaseBook {
    epoch: u64,
    root: u32,
    held: Option<Held>,
    /// Who got the last grant, also when it is free again.
    last: Option<Name>,
}

impl LeaseBook {
    /// Free, at the boot with this epoch.
    #[must_use]
    pub fn new(epoch: u64) -> Self {
        Self { epoch, root: 0, held: None, last: None }
    }

    /// Grants it to `client` under a new root, whoever held it before.
    pub fn grant(&mut self, now: Stamp, client: &Name) -> Lease {
        self.root = self.root.wrapping_add(1);
        self.held = Some(Held { holder: client.clone(), root: self.root, heard: now });
        self.last = Some(client.clone());
        Lease { epoch: self.epoch, root: self.root }
    }

    /// Whether `lease`, borne by `client`, is the present one.
    #[must_use]
    pub fn is_present(&self, client: &Name, lease: Lease) -> bool {
        self.held.as_ref().is_some_and(|held| {
            lease.epoch == self.epoch && lease.root == held.root && held.holder == *client
        })
    }

    /// The holder was heard at `at`.
    pub fn heard(&mut self, at: Stamp) {
        if let Some(held) = &mut self.held {
            held.heard = held.heard.max(at);
        }
    }

    /// Makes it free. True if it was held until now.
    pub fn free(&mut self) -> bool {
        self.held.take().is_some()
    }

    /// How long the holder has been silent; `None` = it is free.
    #[must_use]
    pub fn silent_ms(&self, now: Stamp) -> Option<u64> {
        self.held.as_ref().map(|held| now.since_ms(held.heard))
    }

    /// The present lease.
    #[must_use]
    pub fn present(&self) -> Option<Lease> {
        self.held.as_ref().map(|held| Lease { epoch: self.epoch, root: held.root })
    }

    /// Who was granted the lease after this grant of the same boot, if anybody was.
    #[must_use]
    pub fn granted_after(&self, lease: Lease) -> Option<&Name> {
        self.last.as_ref().filter(|_| lease.root != self.root)
    }

    /// The holder.
    #[must_use]
    pub fn holder(&self) -> Option<&Name> {
        self.held.as_ref().map(|held| &held.holder)
    }

    /// For the state.
    #[must_use]
    pub fn state(&self, now: Stamp) -> Option<LeaseState> {
        let held = self.held.as_ref()?;
        Some(LeaseState { holder: held.holder.clone(), age_ms: now.since_ms(held.heard) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_grant_fences_the_one_before_also_of_the_same_client() {
        let (mut book, me) = (LeaseBook::new(7), Name::new("me").unwrap());
        let first = book.grant(Stamp::ZERO, &me);
        let second = book.grant(Stamp::ZERO, &me);
        assert!(!book.is_present(&me, first) && book.is_present(&me, second));
        assert!(!book.is_present(&Name::new("you").unwrap(), second));
        assert!(!book.is_present(&me, Lease { epoch: 8, ..second }));
        assert!(book.free() && !book.free());
        assert!(!book.is_present(&me, second));
    }
}
