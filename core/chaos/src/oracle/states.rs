//! What a robot says of itself, against what is known of it.

use super::{Broken, Cut, Invariant, Oracle, Published, bit};
use crate::time::{MS_PER_TURN, Turn, ms};
use xtb_protocol::messages::{Latch, RobotState};

/// A motor between two commands: an encoder window of 52 ms, frame, PWM period, and states 50 ms apart.
const SPEECHLESS: Turn = ms(200);
/// Pulses that grow towards the end of the dead band.
const STARTING: Turn = ms(1000);

impl Oracle {
    /// A state of the robot.
    pub(crate) fn state(&mut self, now: Turn, state: &RobotState) -> Result<(), Broken> {
        let latches = || state.latches.iter().map(|latch| latch.latch);
        self.published = Published {
            any: latches().next().is_some(),
            holds_transmitter: latches().any(Latch::holds_transmitter),
            estop: latches().any(|latch| latch == Latch::Estop),
            latches: latches().fold(0, |bits, latch| bits | bit(latch)),
        };
        if self.published.any {
            self.cut(Cut::Latch);
        }
        if self.estopped && !self.published.estop {
            return Err((Invariant::Requests, "an emergency stop arrived and is not in the state".into()));
        }
        self.known_goal(state)?;
        let numbers =
            [state.pose.x_m, state.pose.y_m, state.pose.yaw_rad, state.reference_rpm, state.steering];
        let optional = [state.speed_mps, state.tilt_deg.x, state.tilt_deg.y, state.battery_v];
        if !numbers.iter().chain(optional.iter().flatten()).all(|value| value.is_finite()) {
            return Err((Invariant::Range, format!("a number of the state is not finite: {state:?}")));
        }
        self.reasons(now, state)
    }

    /// A robot that stands says why.
    fn reasons(&mut self, now: Turn, state: &RobotState) -> Result<(), Broken> {
        if !state.stopped_because.is_empty() {
            self.silent_since = None;
            return Ok(());
        }
        let silent = now - *self.silent_since.get_or_insert(now);
        let both = |since: Option<Turn>| since.map_or(0, |since| (now - since).min(silent));
        let (neutral, stands) = (both(self.neutral_since), both(self.stands_since));
        match neutral > SPEECHLESS || stands > STARTING {
            true => {
                let ms = u64::from(stands) * MS_PER_TURN;
                Err((Invariant::Reasons, format!("stopped for {ms} ms without a reason")))
            }
            false => Ok(()),
        }
    }

    /// The goal acknowledged last is in the state, or among those that ended.
    fn known_goal(&self, state: &RobotState) -> Result<(), Broken> {
        let Some(id) = self.acknowledged else { return Ok(()) };
        let present = state.goal.as_ref().is_some_and(|goal| goal.id.as_u128() == id);
        let ended = state.ended_goals.iter().any(|end| end.id.as_u128() == id);
        match present || ended {
            true => Ok(()),
            false => Err((Invariant::Requests, "an acknowledged goal is not in the state".into())),
        }
    }
}
