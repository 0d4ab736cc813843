//! Bounds and times of a dispatcher.

/// Bounds and times; times in ms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DispatcherSettings {
    /// Tasks that have not ended, at most; more are refused as `queue_full`.
    pub max_open: usize,
    /// Ended tasks that stay readable; the oldest are forgotten first.
    pub keep_ended: usize,
    /// Requests that wait for robots to confirm, at most; more are refused as `overloaded`.
    pub max_waiting: usize,
    /// Changes of tasks that wait for the ledger, at most; more submissions are refused as `overloaded`.
    pub max_unwritten: usize,
    /// A robot without a state for this long is silent.
    pub silent_ms: u64,
    /// A silent robot's `halt` goal has surely ended after this much without a request of ours: its own
    /// 0.5 s, and as long as the network may hold a request up.
    pub halted_ms: u64,
    /// A `finish` goal has surely ended so long after its bound: as long as the network may hold a request up.
    pub finish_margin_ms: u64,
    /// A cancelled task's robot has this long to confirm before the answer says that it has not.
    pub confirm_ms: u64,
    /// A request is asked again with the same id for this long.
    pub request_timeout_ms: u64,
    /// Pause after a request that was refused or not answered.
    pub pause_ms: u64,
    /// A robot that has refused a task is not asked for another one for this long.
    pub refused_ms: u64,
    /// A robot that has left so many requests in a row unanswered, and was not asked to drive yet, loses its task.
    pub most_unanswered: u32,
    /// It gets no other task for this long.
    pub unanswered_ms: u64,
    /// A task waits this long after it has failed, before it is begun anew; longer each time.
    pub retry_ms: u64,
    /// Longest of these pauses.
    pub retry_max_ms: u64,
    /// Something has to be in the way for this long before the history says so.
    pub blocked_ms: u64,
    /// A task that any of several may do goes back to the queue after it was blocked for this long.
    pub blocked_max_ms: u64,
    /// A task that waits gains one level of priority each.
    pub priority_step_ms: u64,
    /// A task is reserved for a robot that is nearly done until it has waited for this long.
    pub reserve_ms: u64,
    /// Time between two rounds of assignment.
    pub allocation_period_ms: u64,
    /// The ledger is tried again this long after a write has failed.
    pub ledger_retry_ms: u64,
    /// A lease is given back after this long without a task.
    pub lease_idle_ms: u64,
    /// A robot that was given back has to be left alone for this long before its task goes on.
    pub settle_ms: u64,
    /// Emergency stops of several robots by one client within this are one call.
    pub fleet_stop_window_ms: u64,
    /// After a start, robots have this long to be heard of before their silence counts.
    pub start_ms: u64,
}

impl Default for DispatcherSettings {
    fn default() -> Self {
        Self {
            max_open: 20_000,
            keep_ended: 2_000,
            max_waiting: 256,
            max_unwritten: 40_000,
            silent_ms: 1_500,
            halted_ms: 10_000,
            finish_margin_ms: 10_000,
            confirm_ms: 5_000,
            request_timeout_ms: 2_000,
            pause_ms: 500,
            refused_ms: 5_000,
            // Some 10 s with what a request may take and the pause after it: as long as the network may hold one up.
            most_unanswered: 4,
            // Six times as long as it kept the task; chosen, not measured.
            unanswered_ms: 60_000,
            retry_ms: 2_000,
            retry_max_ms: 60_000,
            blocked_ms: 2_000,
            blocked_max_ms: 60_000,
            priority_step_ms: 60_000,
            reserve_ms: 30_000,
            allocation_period_ms: 200,
            ledger_retry_ms: 1_000,
            lease_idle_ms: 1_000,
            settle_ms: 3_000,
            fleet_stop_window_ms: 10_000,
            start_ms: 3_000,
        }
    }
}
