//! Teleoperation: which setpoints count, and for how long.

use super::{Agent, Arrival};
use crate::authority::guard::Guard;
use xtb_control::{Command, Mode, Stamp, Steering, WheelRpm};
use xtb_protocol::Name;
use xtb_protocol::messages::{Fault, GoalStatus, Setpoint, StopReason};

/// A setpoint answers a state that is at most this old: a burst that was held up somewhere does not drive,
/// and no clocks need to agree. So driving by hand needs a round trip below it (docs/network.md). Chosen, not
/// measured.
pub(super) const ECHO_MS: u64 = 300;

/// The setpoint that drives.
#[derive(Debug, Clone)]
pub(super) struct Teleop {
    setpoint: Setpoint,
    at: Stamp,
    delivered: bool,
}

impl Agent {
    /// A setpoint that arrived at `at`; replaces the one before and takes over from a goal. It counts
    /// if it bears the present lease, is newer than the last one, answers a recent state, is not dead
    /// already, and came after the last stop or goal.
    pub fn setpoint(&mut self, now: Stamp, at: Stamp, arrival: Arrival, client: &Name, setpoint: &Setpoint) {
        if !self.admission().admits(client, setpoint.lease) {
            self.fenced += 1;
            return;
        }
        let fresh = self.is_fresh(now, at, setpoint);
        if fresh {
            self.last_seq = Some(setpoint.seq);
            self.lease.heard(at);
        }
        // One that is too old to drive still shows a joystick that is held, but none that was let go.
        let first = !std::mem::replace(&mut self.setpoint_seen, true);
        let let_go = fresh && setpoint.rpm == 0.0;
        let overtaken = arrival < self.commanded_by && self.guards.on(Guard::Overtaken);
        self.rearm &= overtaken || !(first || let_go);
        let held = self.rearm && self.guards.on(Guard::Rearm);
        if !fresh || overtaken || held || self.cannot_drive() {
            self.rearm |= self.cannot_drive();
            self.stale += 1;
            return;
        }
        self.setpoint_heard = Some(at);
        if self.goal_runs() {
            self.end_goal(at, GoalStatus::Cancelled, Some("replaced by teleoperation"));
            self.pending = Some(Command::Idle);
        }
        self.teleop = Some(Teleop { setpoint: *setpoint, at, delivered: false });
    }

    /// What refuses a goal refuses setpoints too; only a battery that is low lets one who drives go on.
    fn cannot_drive(&self) -> bool {
        let low = self.teleop.is_none() && self.faults.present().any(|fault| fault == Fault::BatteryLow);
        let by_hand = matches!(self.mode, Mode::Manual | Mode::Fault);
        self.is_held() || by_hand || low || self.faults.stopping().is_some()
    }

    fn is_fresh(&self, now: Stamp, at: Stamp, setpoint: &Setpoint) -> bool {
        let alive = now.since_ms(at) < self.setpoint_lifetime_ms || !self.guards.on(Guard::SetpointLifetime);
        let newer =
            self.last_seq.is_none_or(|last| setpoint.seq > last) || !self.guards.on(Guard::SetpointSequence);
        let answers = setpoint
            .echo_tick_ms
            .is_some_and(|tick| tick <= now.ms() && now.ms() - tick <= self.limits.echo_ms)
            || !self.guards.on(Guard::SetpointEcho);
        alive && newer && answers
    }

    /// A setpoint lives 200 ms on this clock, and a lost session ends teleoperation.
    pub(super) fn watch_teleop(&mut self, now: Stamp) {
        let Some(teleop) = &mut self.teleop else { return };
        let dead = now.since_ms(teleop.at) >= self.setpoint_lifetime_ms;
        if dead && self.guards.on(Guard::SetpointLifetime) {
            return self.stand(now, StopReason::SetpointExpired, GoalStatus::Cancelled, None);
        }
        if !self.link_up {
            return self.stand(now, StopReason::LinkLost, GoalStatus::Cancelled, None);
        }
        if std::mem::replace(&mut teleop.delivered, true) {
            return;
        }
        let max_rpm = self.max_rpm.min(self.params.limit_mps() / self.mps_per_rpm);
        let rpm = teleop.setpoint.rpm.clamp(-max_rpm, max_rpm);
        if let (Ok(rpm), Ok(steering)) =
            (WheelRpm::try_from(rpm), Steering::try_from(teleop.setpoint.steering))
        {
            self.pending = Some(Command::Teleop { rpm, steering });
        }
    }
}
