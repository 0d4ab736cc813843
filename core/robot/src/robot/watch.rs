//! A robot's monitors at their places: what each sample and each turn tells them, and what their answers
//! hold back.

use super::Robot;
use crate::authority::guard::{Guard, Guards};
use crate::faults::INPUT_LOST_MS;
use crate::line::LineFault;
use crate::monitor::{Driven, SignsOfLife};
use xtb_control::controller::AdcSample;
use xtb_control::vehicle::SLOTS;
use xtb_control::{AdcCount, Mode, PwmCount, Stamp};
use xtb_protocol::messages::{BatteryLevel, Fault};

impl Robot {
    /// The same robot under these rules, for the mutation check alone.
    #[must_use]
    pub fn with_guards(mut self, guards: Guards) -> Self {
        self.guards = guards;
        self.agent.set_guards(guards);
        self
    }

    /// What the battery's voltage means; unknown while no scan of the converter comes.
    #[must_use]
    pub fn battery_level(&self, now: Stamp) -> BatteryLevel {
        match self.ages(now).adc {
            Some(ms) if ms <= INPUT_LOST_MS => self.monitors.battery_level(),
            _ => BatteryLevel::Unknown,
        }
    }

    /// Whether the transmitter's drive is held back because the truck is faster than the obstacle rule
    /// can stop.
    #[must_use]
    pub fn over_speed(&self) -> bool {
        self.outputs.mode == Mode::Manual
            && self.vehicle().guard.manual_limit
            && self.guards.on(Guard::OverSpeed)
            && self.monitors.over_speed()
    }

    /// An encoder window, after the controller's step. Wheels that ran away or did not turn under the
    /// transmitter want to see a neutral stick before they are driven again.
    pub(super) fn watch_window(&mut self, now: Stamp, pulses: u16) {
        let vehicle = self.controller.config();
        self.monitors.window(vehicle, now, pulses, || vehicle.by_hand_mps(self.outputs.demanded));
        // The pulse that was decided now stays until the next window, whatever is asked for meanwhile.
        self.watch_drive(self.pulses().motor);
        let of_the_drive = |fault: Fault| matches!(fault, Fault::Runaway | Fault::Stalled);
        self.stick_held |= self.monitors.faults(self.guards).any(|(fault, _)| of_the_drive(fault));
    }

    /// The motor is driven with this pulse.
    pub(super) fn watch_drive(&mut self, motor: PwmCount) {
        self.monitors.drive(Driven {
            by_hand: self.outputs.mode == Mode::Manual,
            motor,
            reference_rpm: self.outputs.reference_rpm,
        });
    }

    /// Whether a frame of the gyro is the last one again, unchanged to its timer.
    pub(super) fn is_repeated(&mut self, now: Stamp, frame: impl Into<SignsOfLife>) -> bool {
        self.monitors.gyro(self.controller.config(), now, frame.into()) && self.guards.on(Guard::Frozen)
    }

    /// What the controller gets to see of a scan: all of it, or nothing in range if the obstacle rule is
    /// switched off.
    pub(super) fn seen(&self, scan: AdcSample) -> AdcSample {
        match self.guards.on(Guard::Obstacle) {
            true => scan,
            false => {
                let nothing = [AdcCount::ZERO; SLOTS];
                AdcSample { ir_front: nothing, ir_rear: nothing, ..scan }
            }
        }
    }

    /// A line's fault, unless its rule is switched off.
    pub(super) fn in_force(&self, fault: Option<LineFault>) -> Option<LineFault> {
        fault.filter(|fault| match fault {
            LineFault::Frozen => self.guards.on(Guard::Frozen),
            _ => self.guards.on(Guard::LineLost),
        })
    }
}
