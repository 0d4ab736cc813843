//! What runs for the fleet's sake rather than for one command.

pub mod dispatch;
pub mod ledger;
pub mod map_server;
pub mod router;
pub mod traffic;
