//! The lease: control of a robot, granted by the robot alone.
//!
//! This version grants to everyone who asks (the newest holder is shown) and does not enforce:
//! clients already acquire and retain, so nothing changes for them when it will.

use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::messages::{Lease, LeaseState};

/// A lease that is not retained for this long is free again.
pub const LEASE_FREE_MS: u64 = 900;

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
}

impl LeaseBook {
    /// Free, at the boot with this epoch.
    #[must_use]
    pub fn new(epoch: u64) -> Self {
        Self { epoch, root: 0, held: None }
    }

    /// Grants to `client`: the same lease again if it holds it, else a new root.
    pub fn acquire(&mut self, now: Stamp, client: &Name) -> Lease {
        if self.held.as_ref().is_none_or(|held| held.holder != *client) {
            self.root = self.root.wrapping_add(1);
        }
        self.held = Some(Held { holder: client.clone(), root: self.root, heard: now });
        Lease { epoch: self.epoch, root: self.root }
    }

    /// A message that bears `lease` was accepted: true if it is the present one.
    pub fn touch(&mut self, now: Stamp, client: &Name, lease: Lease) -> bool {
        match &mut self.held {
            Some(held) if lease.epoch == self.epoch && lease.root == held.root && held.holder == *client => {
                held.heard = now;
                true
            }
            _ => false,
        }
    }

    /// Gives the lease back: true if it was the present one.
    pub fn release(&mut self, now: Stamp, client: &Name, lease: Lease) -> bool {
        let present = self.touch(now, client, lease);
        if present {
            self.held = None;
        }
        present
    }

    /// Frees a lease that has not been heard of. True if it was held until now.
    pub fn expire(&mut self, now: Stamp) -> bool {
        let expired = self.held.as_ref().is_some_and(|held| now.since_ms(held.heard) > LEASE_FREE_MS);
        if expired {
            self.held = None;
        }
        expired
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
