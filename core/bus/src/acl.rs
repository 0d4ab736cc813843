//! Zenoh's rules for a fleet with identities, from its registry.

/// Zenoh's `access_control`, in JSON.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AccessControl(pub(crate) serde_json::Value);
