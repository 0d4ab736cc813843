//! VDA 5050 for the fleet's robots: what a master control and the dispatcher are told, as pure state machines.
//!
//! ```text
//!   order, instantActions ──►┌─────────┐──► Effect::Save (what a restart needs)
//!   RobotState, tasks ──────►│ Vehicle │──► Effect::Ask (dispatcher: submit, extend, cancel …)
//!   the dispatcher's answers►│         │──► Effect::Publish (state, connection, factsheet)
//!   step(now) ──────────────►└─────────┘
//! ```
//!
//! A [`Vehicle`] is one robot towards a master control. What it wants of the dispatcher follows from its
//! [`record`](record::OrderRecord) and the task anew at each step, as with the dispatcher itself: it does not matter which
//! message was lost, or whether the process has restarted in between. An order is accepted when the dispatcher's
//! ledger has it, never before.
//!
//! Glossary: the *base* are the released nodes of an order, the *horizon* those that are only planned; a *part* is a
//! task of the dispatcher that drives nodes of the base, usually all of them.

pub mod action;
pub mod factsheet;
pub mod header;
pub mod incoming;
pub mod operating;
pub mod order;
pub mod problem;
pub mod protocol;
pub mod record;
pub mod state;
pub mod vehicle;

pub use header::Serial;
pub use protocol::Protocol;
pub use vehicle::{Answer, Ask, Effect, Topic, Vehicle};
