//! The simulation's step.

/// Length of a step in ns: 5 ms, one turn of the agent's control loop.
pub const STEP_NS: u64 = 5_000_000;
/// The same in s, for formulas.
pub(crate) const STEP_S: f64 = STEP_NS as f64 * 1e-9;
