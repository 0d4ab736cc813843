//! Admission: whose messages a robot accepts at all, as its network threads must know between two turns.
//!
//! Setpoints are authorised where they arrive, on Zenoh's threads, so that the slot which holds the
//! latest one holds authorised ones only: a stranger's flood cannot starve the holder. The control
//! loop sets it; what it admits is checked again by the agent.

use xtb_protocol::Name;
use xtb_protocol::messages::Lease;

/// Whose messages are admitted now.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Admission {
    /// Nobody: the lease is free.
    #[default]
    Nobody,
    /// The holder of this lease.
    Holder(Name, Lease),
    /// Everybody: the mutation check has switched the rule off.
    Anyone,
}

impl Admission {
    /// Whether a message of `client` that bears `lease` is admitted.
    #[must_use]
    pub fn admits(&self, client: &Name, lease: Option<Lease>) -> bool {
        match self {
            Self::Nobody => false,
            Self::Holder(holder, present) => holder == client && lease == Some(*present),
            Self::Anyone => true,
        }
    }
}
