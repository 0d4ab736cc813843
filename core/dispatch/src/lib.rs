//! Tasks for a fleet: a state machine that no crash makes forget or double what it acknowledged.
//!
//! ```text
//!   submit, cancel, pause … ──►┌─────────────┐──► Write(entries) ──► ledger ──► written ┐
//!   states and replies of ────►│ Dispatcher  │◄─────────────────────────────────────────┘
//!   robots, roster, presence   │ (TaskStore) │──► Ask(robot, request)
//!   step(now) ────────────────►└─────────────┘──► Reply(ticket), Event
//! ```
//!
//! * [`task_store`]: what is in the ledger, and nothing else. It changes only by entries that were written;
//!   so a write that fails leaves nothing to undo, and a restart is the same entries read again.
//! * [`dispatcher`]: decides. Whatever depends on an entry (an answer to a submitter, a request to a
//!   robot) leaves only after that entry is durable.
//! * [`tracked_robot`]: what is known of each robot now; forgotten at a restart, learned again from its state.
//! * [`task_progress`]: what a task's robot reports of it, and what to ask of the robot next.
//! * [`suspension`]: which tasks no robot may be given, after a fleet stop or on another map.
//! * [`assign`]: which robot gets which task, by [`travel_cost`]; [`predicted_free`]: when and where a busy
//!   robot will be free.
//! * [`home`]: when a robot goes to a dock or to a parking place by itself.
//! * [`alerts`]: what needs a person, by rules over the same.
//! * [`replication`]: when a write counts that a stand-by has to have too, and when the stand-by takes over.
//!
//! Times are ms since 1970 and never go back within a run; numbers for ids come in as an argument.

pub mod admission;
pub mod alerts;
pub mod assign;
pub mod dispatcher;
pub mod home;
pub mod predicted_free;
pub mod replication;
pub mod settings;
pub mod suspension;
pub mod task;
pub mod task_progress;
pub mod task_store;
pub mod tracked_robot;
pub mod transition;
pub mod travel_cost;
mod write_queue;

pub use dispatcher::{Dispatcher, Effect, Ticket};
pub use home::{HomeRules, HomeSettings};
pub use settings::DispatcherSettings;
pub use task_store::record::{LedgerEntry, Record};
pub use task_store::{ReplayError, TaskStore};
pub use travel_cost::{ANY_CAR, MapTravelCost, OpenTravelCost, TravelCost};
pub use write_queue::Write;
