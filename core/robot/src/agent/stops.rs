//! Stops: of the moment, latched, and what resets them.

use super::{Agent, Arrival};
use crate::authority::guard::Guard;
use crate::faults::latch_of;
use std::sync::Arc;
use xtb_control::{Mode, Stamp};
use xtb_protocol::messages::{EventKind, Fault, GoalStatus, Latch, LatchState, STOP_SWITCH, StopReason};
use xtb_protocol::{Name, Uuid};

/// Ids of emergency stops that are remembered: a stranger has to send as many before a repetition of another
/// one latches again.
pub(super) const ESTOP_IDS: usize = 1024;

impl Agent {
    /// A stop has arrived: the robot stands, whatever waits in a queue.
    pub fn stop(&mut self, now: Stamp, arrival: Arrival) {
        if self.overtakes(arrival) {
            self.stand(now, StopReason::Stop, GoalStatus::Cancelled, None);
            self.disarm();
        }
    }

    /// An emergency stop has arrived: as a stop, and latched. One whose caller and id were seen before is a
    /// repetition and does nothing: it must not latch again after a reset.
    pub fn estop(&mut self, now: Stamp, arrival: Arrival, by: &Name, id: Uuid) {
        let seen = self.estops.iter().any(|(caller, call)| *call == id && caller == by);
        if seen || !self.guards.on(Guard::Estop) {
            return;
        }
        if self.estops.len() == ESTOP_IDS {
            self.estops.pop_front();
        }
        self.estops.push_back((by.clone(), id));
        self.overtakes(arrival);
        self.latch_as(now, Latch::Estop, by.as_str());
    }

    /// Whether the emergency stop switch at the I/O board is pressed, as the board says; not to be called while that
    /// is unknown, so that it stays pressed until it is seen released. Pressing it is an emergency stop, and is told
    /// also if one is latched already.
    pub fn set_stop_switch(&mut self, now: Stamp, pressed: bool) {
        let before = std::mem::replace(&mut self.stop_switch, pressed);
        if !pressed || before || !self.guards.on(Guard::Estop) {
            return;
        }
        if self.latches.is_set(Latch::Estop) {
            self.emit(now, EventKind::Latch { latch: Latch::Estop, set: true, by: STOP_SWITCH.to_owned() });
        }
        self.latch_as(now, Latch::Estop, STOP_SWITCH);
    }

    /// From here on a joystick has to be let go once, also that of a client who has only just come.
    fn disarm(&mut self) {
        (self.rearm, self.setpoint_seen) = (true, true);
    }

    /// Whether a stop is news; if so, what arrived before it cannot begin any more.
    fn overtakes(&mut self, arrival: Arrival) -> bool {
        let news = arrival > self.stopped_by;
        if news {
            self.stopped_by = arrival;
            self.commanded_by = self.commanded_by.max(arrival);
        }
        news
    }

    /// The control loop was held up, or its clock jumped: nobody watched, so everything ends.
    pub fn loop_stalled(&mut self, now: Stamp) {
        if self.under_way() {
            let reason = StopReason::LoopStalled;
            self.stand(now, reason, GoalStatus::Failed, Some(reason.text()));
        }
        self.disarm();
    }

    /// The clock went back: no age says anything any more, so the lease is free.
    pub fn clock_went_back(&mut self, now: Stamp) {
        self.setpoint_heard = None;
        if self.lease.free() {
            self.emit(now, EventKind::Lease { holder: None });
        }
    }

    /// What is broken now: all of it, with the system's words. News are reported, and latched where
    /// the table says so; board and gyro only after they have been well. A stall on a path may be something
    /// in the way instead, see `touch.rs`.
    pub fn set_faults(&mut self, now: Stamp, current: &[(Fault, Option<Arc<str>>)]) {
        let current = self.without_touch(now, current);
        for (fault, detail) in current.clone() {
            if !self.faults.begin(now, *fault, detail.as_deref()) {
                continue;
            }
            let words = detail.as_deref().map(str::to_owned);
            self.emit(now, EventKind::Fault { fault: *fault, present: true, detail: words });
            match latch_of(*fault) {
                Some(Latch::BoardLost | Latch::GyroLost) if !self.was_well => {}
                Some(latch) => {
                    let by = detail.as_deref().map_or_else(|| fault.to_string(), |d| format!("{fault}: {d}"));
                    self.latch_as(now, latch, &by);
                }
                None => {}
            }
        }
        while let Some(fault) = self.faults.end_other_than(current.clone()) {
            self.emit(now, EventKind::Fault { fault, present: false, detail: None });
        }
    }

    /// Sets a latch: everything ends.
    pub(super) fn latch_as(&mut self, now: Stamp, latch: Latch, by: &str) {
        if self.latches.set(now, latch, by) {
            self.emit(now, EventKind::Latch { latch, set: true, by: by.to_owned() });
        }
        let (status, words) = match latch {
            Latch::RemoteTakeover => (GoalStatus::Cancelled, latch.text().to_owned()),
            latch => (GoalStatus::Failed, format!("{latch} latched by {by}")),
        };
        self.stand(now, latch.reason(), status, Some(&words));
        self.stick_to_rest |= latch.holds_transmitter();
        self.disarm();
    }

    /// Clears this latch, or all; those whose cause is still there stay set and are returned.
    pub(super) fn reset(&mut self, now: Stamp, wanted: Option<Latch>, by: &Name) -> Vec<Latch> {
        let asked: Vec<Latch> =
            self.latches.all().filter(|latch| wanted.is_none_or(|wanted| wanted == *latch)).collect();
        let (stay, go): (Vec<Latch>, Vec<Latch>) = asked
            .into_iter()
            .partition(|latch| self.guards.on(Guard::ResetInterlock) && self.is_present(*latch));
        if !go.is_empty() {
            self.disarm();
        }
        for latch in go {
            self.latches.clear(latch);
            self.emit(now, EventKind::Latch { latch, set: false, by: by.to_string() });
        }
        stay
    }

    /// Whether what set a latch is still so.
    fn is_present(&self, latch: Latch) -> bool {
        match latch {
            Latch::Estop => self.stop_switch,
            Latch::RemoteTakeover => matches!(self.mode, Mode::Manual | Mode::Fault),
            other => self.faults.present().any(|fault| latch_of(fault) == Some(other)),
        }
    }

    /// Whether a latch holds the network.
    pub(super) fn is_held(&self) -> bool {
        self.guards.on(Guard::LatchHolds) && self.latches.all().next().is_some()
    }

    /// Whether a latch is set that holds the transmitter too.
    #[must_use]
    pub fn holds_transmitter(&self) -> bool {
        self.guards.on(Guard::LatchHolds) && self.latches.all().any(Latch::holds_transmitter)
    }

    /// Whether the transmitter's stick has to be let go before it drives: a latch held it, also if that was
    /// set and reset between two turns.
    pub(crate) fn take_stick_to_rest(&mut self) -> bool {
        let latched = std::mem::take(&mut self.stick_to_rest) && self.guards.on(Guard::LatchHolds);
        latched || self.holds_transmitter()
    }

    /// Whether this latch is set.
    #[must_use]
    pub fn is_latched(&self, latch: Latch) -> bool {
        self.latches.is_set(latch)
    }

    /// The latches, for the state.
    #[must_use]
    pub fn latch_states(&self, now: Stamp) -> Vec<LatchState> {
        self.latches.states(now, |latch| self.is_present(latch))
    }
}
