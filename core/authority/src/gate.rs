//! The gate: whose messages a robot lets in at all, as its doors must know between two turns.
//!
//! Setpoints are authorised where they arrive, on Zenoh's threads, so that the slot which holds the
//! latest one holds authorised ones only: a stranger's flood cannot starve the holder. The control
//! loop opens and shuts the gate; what it lets in is checked again by the agent.

use xtb_protocol::Name;
use xtb_protocol::messages::Lease;

/// Who may come in now.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub enum Gate {
    /// Nobody: the lease is free.
    #[default]
    Shut,
    /// The holder of this lease.
    Holder(Name, Lease),
    /// Everybody: the mutation check has switched the rule off.
    Open,
}

impl Gate {
    /// Whether a message of `client` that bears `lease` comes in.
    #[must_use]
    pub fn admits(&self, client: &Name, lease: Option<Lease>) -> bool {
        match self {
            Self::Shut => false,
            Self::Holder(holder, present) => holder == client && lease == Some(*present),
            Self::Open => true,
        }
    }
}
