//! What holds a robot back beside its brain: a receiver that falls silent, a stick that was never
//! neutral, a board that is not there; and what is broken, collected for the brain.

use super::ask::Wanted;
use super::early::EarlyFrames;
use super::{Heard, LOOP_STALL_MS, Robot};
use crate::agent::STICK_NEUTRAL_COUNTS;
use crate::authority::arbitration::MotorWriter;
use crate::authority::guard::Guard;
use crate::faults::{of_line, silent_kinds};
use crate::line::{Device, LINE_LOST_MS, LineFault};
use std::sync::Arc;
use xtb_control::controller::{PwmOutputs, RemoteSample};
use xtb_control::pistons::standing;
use xtb_control::units::PWM_PERIOD_COUNTS;
use xtb_control::vehicle::Platform;
use xtb_control::{Command, Mode, PwmCount, Sample, Stamp};
use xtb_protocol::board::{Ask, Firmware, Frame, UnknownFirmware};
use xtb_protocol::messages::Fault;

/// A board sends something at least this often: converter scans each 38 ms, encoder windows each 52 ms.
const QUIET_MS: u64 = 60;
/// A receiver that was lost with its board gets this time to be heard again: four of its frames of 22.2 ms.
const RECEIVER_BACK_MS: u64 = 100;

impl Robot {
    /// A loop that was held up, or whose clock jumped: everything ends, and a stick that is held has to be let go.
    /// After a jump back no age says anything any more, so the lease is free and every input has to be heard anew.
    pub(super) fn watch_loop(&mut self, now: Stamp) {
        let (late, last) = (self.is_late(now), self.turned.replace(now));
        if !late {
            return;
        }
        self.board.watch.look_anew(now);
        self.gyro.watch.look_anew(now);
        (self.board.speaks_since, self.board.starved) = (now, None);
        self.stick_held = true;
        if last.is_some_and(|last| now < last) {
            self.agent.clock_went_back(now);
            (self.heard, self.board.open_since) = (Heard::default(), now);
            (self.next_frame, self.neutral_since) = (now, self.neutral_since.map(|_| now));
            self.remote_due = self.remote_due.map(|_| now);
            self.early = EarlyFrames::default();
            self.monitors.clock_went_back();
            self.setup.forget();
        }
        self.agent.loop_stalled(now);
    }

    /// Whether the last turn is too long ago, or ahead of us.
    pub(super) fn is_late(&self, now: Stamp) -> bool {
        let late = |last: Stamp| now < last || now.since_ms(last) > LOOP_STALL_MS;
        self.guards.on(Guard::LoopStall) && self.turned.is_some_and(late)
    }

    pub(super) fn remote_period_ns(&self) -> u64 {
        Stamp::from_s(self.vehicle().remote.period_ms / 1000.0).ns().max(1)
    }

    /// A frame of the receiver that does not come is one without pulses: the controller loses the
    /// channel after ten (§4.2.2).
    pub(super) fn miss_remote(&mut self, now: Stamp) {
        for _ in 0..self.vehicle().remote.lost_after {
            let Some(due) = self.remote_due.filter(|due| now >= *due) else { return };
            self.remote_due = Some(due.plus_ns(self.remote_period_ns()));
            self.step(now, &Sample::Remote(RemoteSample::default()));
        }
        self.remote_due = self.remote_due.map(|_| now.plus_ns(self.remote_period_ns()));
    }

    /// The board is lost, and with it the receiver: a transmitter that drives is lost at once, and what
    /// comes back has to show a neutral stick before it drives.
    pub(super) fn lose_remote(&mut self, now: Stamp) {
        self.stick_held = true;
        for _ in 0..self.vehicle().remote.lost_after {
            if self.outputs.mode != Mode::Manual {
                return;
            }
            self.step(now, &Sample::Remote(RemoteSample::default()));
        }
    }

    /// What is wrong with the gyro's line. The samples of a BNO085 come over the board's: while that is at fault, or
    /// silent and so about to be, nothing is known of the unit, and then it gets its time to speak.
    pub(super) fn gyro_fault(&mut self, now: Stamp, board: Option<LineFault>) -> Option<LineFault> {
        if self.bno085.is_some() {
            if board.is_some() || !self.setup.is_done() {
                self.gyro.watch.look_anew(now);
            }
            if self.board.watch.unwell_ms(now) > QUIET_MS {
                return None;
            }
        }
        self.gyro.watch.fault(now)
    }

    /// What the board has to be asked for now.
    pub(super) fn ask(&mut self, now: Stamp) -> Option<Ask> {
        let firmware = self.newest.status.map_or(Firmware(0), |status| status.firmware);
        let (imu, wide_scan) = (self.bno085.is_some(), self.needs_wide_scan());
        let unheard = self.heard.adc.is_none_or(|at| now.since_ms(at) > QUIET_MS);
        let missing = (imu && self.gyro.watch.unwell_ms(now) > QUIET_MS) || (wide_scan && unheard);
        self.asker.request(now, firmware, Wanted { imu, wide_scan, missing })
    }

    /// Whether a scan with six range finders a bumper is not enough.
    pub(super) fn needs_wide_scan(&self) -> bool {
        self.vehicle().range_finders.need_wide_scan()
    }

    /// What the board gets: what was decided, but no drive while nobody may write the motor, none in
    /// mode manual before the stick has been neutral, none while the board's watchdog waits for a
    /// frame with a neutral motor, and none while its emergency stop is pressed.
    pub(super) fn pulses(&self) -> PwmOutputs {
        let nobody = self.agent.writer() == MotorWriter::Nobody;
        let manual = self.outputs.mode == Mode::Manual;
        let stick_held = manual && (self.stick_held || self.over_speed());
        let held =
            self.newest.status.is_some_and(|status| status.watchdog || status.emergency_stop == Some(true));
        match nobody || stick_held || held || !self.setup.is_done() {
            true => PwmOutputs { motor: PwmCount::NEUTRAL, ..self.outputs.pwm },
            false => self.outputs.pwm,
        }
    }

    /// What is broken now, with the system's words. Empty (and nothing allocated) while all is well.
    pub(super) fn faults(
        &self,
        now: Stamp,
        board: Option<LineFault>,
        gyro: Option<LineFault>,
    ) -> Vec<(Fault, Option<Arc<str>>)> {
        let mut faults: Vec<_> = self.monitors.faults(self.guards).collect();
        let (board, gyro) = (self.in_force(board), self.in_force(gyro));
        let lost = self.guards.on(Guard::LineLost);
        let (open_ms, speaks_ms) =
            (now.since_ms(self.board.open_since), now.since_ms(self.board.speaks_since));
        match board {
            Some(fault) => {
                let layout = self.board.other_layout.filter(|_| fault == LineFault::WrongDevice);
                let other = layout.map(|layout| UnknownFirmware::of_layout(layout).to_string().into());
                faults.push((of_line(Device::Board, fault), self.board.detail.clone().or(other)));
            }
            None if !lost => {}
            None if !self.setup.is_done() && open_ms > LINE_LOST_MS => {
                faults.push((Fault::BoardNotSetUp, self.board.refused.clone()));
            }
            // While nothing at all comes, the line's own fault is on its way.
            None if self.board.watch.unwell_ms(now) > QUIET_MS => {}
            None => {
                // Windows that cannot be are refused, but they do come.
                let wild = faults.iter().any(|(fault, _)| *fault == Fault::EncoderOutOfRange);
                let silent = silent_kinds(&self.ages(now), speaks_ms);
                let silent = silent.filter(|fault| !(wild && *fault == Fault::EncoderSilent));
                faults.extend(silent.map(|fault| (fault, self.board_detail(fault))));
            }
        }
        if let Some(fault) = gyro {
            faults.push((of_line(Device::Gyro, fault), self.gyro_detail()));
        }
        faults.extend(self.agent.pose_faults(now));
        // Without a platform there is no tilt sensor to look at.
        let is_level =
            self.controller.config().platform == Platform::Off || self.outputs.tilt.both().is_some();
        let tilted = self.newest.adc.is_some() && !is_level;
        for (fault, present) in [
            (Fault::RemoteLost, self.outputs.mode == Mode::Fault && speaks_ms > RECEIVER_BACK_MS),
            (Fault::TiltOutOfRange, tilted),
            (Fault::RecordingFailed, self.recording_failed),
        ] {
            if present {
                faults.push((fault, None));
            }
        }
        faults
    }

    /// Why the board sends no samples of this kind, if its firmware is the reason.
    fn board_detail(&self, fault: Fault) -> Option<Arc<str>> {
        let firmware = self.newest.status?.firmware;
        let too_old =
            fault == Fault::ConverterSilent && self.needs_wide_scan() && !firmware.sends_wide_scans();
        too_old.then(|| {
            format!("firmware {firmware} of the I/O board sends six range finders a bumper, the car has more")
                .into()
        })
    }

    /// The system's words on the gyro's line; of a BNO085 its name, and whether its board can be the reason.
    fn gyro_detail(&self) -> Option<Arc<str>> {
        let firmware = self.newest.status.filter(|_| self.bno085.is_some()).map(|status| status.firmware);
        match firmware.filter(|firmware| !firmware.answers_asks()) {
            Some(firmware) => {
                Some(format!("BNO085: firmware {firmware} of the I/O board does not send its samples").into())
            }
            None => self.gyro.detail.clone(),
        }
    }

    /// Everything at rest, for the last frame before the agent ends; whoever drives.
    pub fn neutral_frame(&mut self, now: Stamp) -> Frame {
        self.step(now, &Sample::Command(Command::Idle));
        let vehicle = self.controller.config();
        let rest = PwmOutputs {
            motor: PwmCount::NEUTRAL,
            steer_front: PwmCount::saturating(vehicle.steering.front_centre),
            steer_rear: PwmCount::saturating(vehicle.steering.rear_centre),
            pistons: vehicle.calibration.pistons().map(standing),
            ..self.outputs.pwm
        };
        self.writer.pwm(&rest)
    }
}

/// Whether a duty cycle of the speed stick does not move the truck.
pub(super) fn is_neutral_stick(duty: f64) -> bool {
    (duty * PWM_PERIOD_COUNTS - PwmCount::NEUTRAL.as_f64()).abs() <= STICK_NEUTRAL_COUNTS
}
