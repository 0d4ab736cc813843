//! Tasks for a fleet: a state machine that no crash makes forget or double what it acknowledged.
//!
//! ```text
//!   submit, cancel, pause … ──►┌────────────┐──► Write(entries) ──► ledger ──► written ┐
//!   states and replies of ────►│ Dispatcher │◄─────────────────────────────────────────┘
//!   robots, roster, presence   │   (Book)   │──► Ask(robot, request)
//!   step(now) ────────────────►└────────────┘──► Reply(ticket), Event
//! ```
//!
//! * [`book`]: what is in the ledger, and nothing else. It changes only by entries that were written;
//!   so a write that fails leaves nothing to undo, and a restart is the same entries read again.
//! * [`dispatcher`]: decides. Whatever depends on an entry (an answer to a submitter, a request to a
//!   robot) leaves only after that entry is durable.
//! * [`robot`]: what is known of each robot now; forgotten at a restart, learned again from its state.
//! * [`drive`]: what a task's robot says of it, and what to ask of the robot next.
//! * [`suspend`]: which tasks no robot may be given, after a fleet stop or on another map.
//! * [`assign`]: who does what, by cost; [`soon`]: when and where a busy robot will be free.
//! * `pages`: lists and answers that fit into a message.
//!
//! Times are ms since 1970 and never go back within a run; numbers for ids come in as an argument.

pub mod admit;
pub mod assign;
pub mod book;
pub mod dispatcher;
pub mod drive;
pub mod ground;
mod pages;
pub mod record;
pub mod robot;
pub mod settings;
pub mod soon;
pub mod suspend;
pub mod task;
mod writer;

pub use book::{Book, BookError};
pub use dispatcher::{Dispatcher, Effect, Ticket};
pub use ground::{Ground, MapGround, OpenGround};
pub use record::{Entry, Record};
pub use settings::Settings;
pub use writer::Write;
