//! Wheels that do not turn on the way to a planned goal: first of all something in the way.
//!
//! ```text
//!   motor driven, no pulse ──► on a path? ──► navigator: plausible ──► marked, backs off, plans anew
//!                                  │                      └ not ─────► fault `stalled`, the goal fails
//!                                  └ any other drive ────────────────► fault `stalled`
//! ```
//! Either way the motor is neutral at once, and stays so until the alarm has ended.

use super::Agent;
use crate::authority::arbitration::MotorWriter;
use std::sync::Arc;
use xtb_control::Stamp;
use xtb_protocol::messages::Fault;

/// What the present alarm is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum StallAlarm {
    #[default]
    None,
    /// Something was touched; the navigator waits for the alarm's end.
    Touch,
    /// A fault like any other.
    Fault,
}

impl Agent {
    /// The present faults without a stall that the navigator takes for something in its way.
    pub(super) fn without_touch<'a>(
        &mut self,
        now: Stamp,
        current: &'a [(Fault, Option<Arc<str>>)],
    ) -> impl Iterator<Item = &'a (Fault, Option<Arc<str>>)> + Clone + use<'a> {
        let stalled = current.iter().any(|(fault, _)| *fault == Fault::Stalled);
        self.stall_alarm = match (stalled, self.stall_alarm) {
            (false, StallAlarm::Touch) => {
                self.nav.release_motor();
                StallAlarm::None
            }
            (false, _) => StallAlarm::None,
            (true, StallAlarm::None) if self.drives_a_path() => {
                let pose = self.filter.estimate(now).pose;
                if self.nav.stalled(now, &pose) { StallAlarm::Touch } else { StallAlarm::Fault }
            }
            // Whoever drives now, it is not the navigator that waits.
            (true, StallAlarm::Touch) if self.drives_a_path() && self.nav.in_contact() => StallAlarm::Touch,
            (true, _) => StallAlarm::Fault,
        };
        let is_touch = self.stall_alarm == StallAlarm::Touch;
        current.iter().filter(move |(fault, _)| !(is_touch && *fault == Fault::Stalled))
    }

    fn drives_a_path(&self) -> bool {
        let planned = self.goal.as_ref().is_some_and(|goal| goal.is_planned());
        planned && self.goal_runs() && self.writer == MotorWriter::Goal
    }
}
