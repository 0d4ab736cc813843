//! Many robots: which of them goes first, and where the others wait.
//!
//! One robot's own way is [`xtb_nav`]'s. Pure like the rest of `core`: no clock, no file, no socket; budgets
//! are counted in nodes, so a slow machine finds the same plans, later.
//!
//! ```text
//!   robots' states, goals ──► coordinator ──► passing order ──► released stretches      while they drive
//!   instance of a fleet ────► solver ───────► schedule                                  before they drive
//!                                 ├─ conflicts: the conflict-based search of both
//!                                 ╰─ hybrid_a_star: one robot's search, of both
//! ```

mod conflicts;
pub mod coordinator;
mod hybrid_a_star;
pub mod solver;
