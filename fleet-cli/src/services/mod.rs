//! What runs for the fleet's sake rather than for one command.

pub mod dispatch;
pub mod ledger;
