//! What runs for the fleet's sake rather than for one command.

#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod alert_outlets;
pub mod dispatch;
pub mod history;
pub mod ledger;
pub mod map_server;
pub mod ros2;
pub mod router;
pub mod traffic;
pub mod vda5050;
