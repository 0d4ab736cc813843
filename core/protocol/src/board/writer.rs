//! Frames, built for the line.

use super::firmware::BoardIdentity;
use super::frames::{ADC_SCANS, Ask, BoardStatus, Frame};
use crate::bno085::Bno085Sample;
use xtb_board_codec::flags::{EMERGENCY_STOP, READY, WATCHDOG};
use xtb_board_codec::{NO_PULSE, NOT_FITTED, Writer, ask, kind};
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, TpuSetup};
use xtb_control::units::{AdcCount, PwmCount};
use xtb_control::vehicle::USUAL_SLOTS;

/// Builds frames and counts their sequence.
#[derive(Debug, Clone, Default)]
pub struct FrameWriter {
    writer: Writer,
}

impl FrameWriter {
    /// The agent's: ten pulses in [`PwmOutputs`] order.
    pub fn pwm(&mut self, pwm: &PwmOutputs) -> Frame {
        let [fl, fr, rl, rr] = pwm.pistons;
        let all = [
            pwm.motor,
            pwm.steer_front,
            pwm.steer_rear,
            pwm.bumper_front,
            pwm.bumper_rear,
            fl,
            fr,
            rl,
            rr,
            pwm.spare,
        ];
        self.writer.frame(kind::PWM, all.map(PwmCount::get))
    }

    /// The agent's: how the board shall configure itself.
    pub fn setup(&mut self, setup: &TpuSetup) -> Frame {
        let bytes = setup.to_bytes();
        self.writer
            .frame(kind::SETUP, bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])))
    }

    /// The agent's: channels of the remote control to reset.
    pub fn reset(&mut self, mask: ResetMask) -> Frame {
        let bits = u16::from(mask.speed) | u16::from(mask.steering) << 1 | u16::from(mask.selector) << 2;
        self.writer.frame(kind::RESET, [bits])
    }

    /// The agent's: what else the board shall send.
    pub fn ask(&mut self, wanted: Ask) -> Frame {
        let bits = (u16::from(wanted.identity) * ask::IDENTITY)
            | (u16::from(wanted.imu) * ask::IMU)
            | (u16::from(wanted.wide_scan) * ask::WIDE_SCAN);
        self.writer.frame(kind::ASK, [bits])
    }

    /// The board's: a frame of the receiver. Counts above 65,534 saturate there.
    pub fn remote(&mut self, sample: &RemoteSample) -> Frame {
        let word =
            |ticks: Option<u32>| ticks.map_or(NO_PULSE, |ticks| ticks.min(u32::from(NO_PULSE) - 1) as u16);
        self.writer.frame(kind::REMOTE, [sample.speed, sample.steering, sample.selector].map(word))
    }

    /// The board's: how it is.
    pub fn status(&mut self, status: &BoardStatus) -> Frame {
        let flags = (u16::from(status.ready) * READY)
            | (u16::from(status.watchdog) * WATCHDOG)
            | (u16::from(status.emergency_stop == Some(true)) * EMERGENCY_STOP);
        let words = [status.firmware.0, flags, status.setup_checksum, status.rejected];
        self.writer.frame(kind::STATUS, words)
    }

    /// The board's: who it is.
    pub fn identity(&mut self, identity: &BoardIdentity) -> Frame {
        let BoardIdentity { firmware, hash, model, after_hang, late_periods, replaced_samples } = *identity;
        let board = u16::from_le_bytes([model, u8::from(after_hang)]);
        let words = [firmware.0, hash as u16, (hash >> 16) as u16, board, late_periods, replaced_samples];
        self.writer.frame(kind::IDENTITY, words)
    }

    /// The board's: a sample of its inertial unit.
    pub fn bno085(&mut self, sample: &Bno085Sample) -> Frame {
        self.writer.frame(kind::IMU, sample.to_words())
    }

    /// The board's: an encoder window.
    pub fn encoder(&mut self, pulses: u16) -> Frame {
        self.writer.frame(kind::ENCODER, [pulses])
    }

    /// The board's: a scan with six range finders a bumper. Ranges as counts; tilt and pistons as sums of [`ADC_SCANS`]
    /// scans.
    pub fn adc(&mut self, sample: &AdcSample, battery_mv: Option<u16>) -> Frame {
        self.writer.frame(kind::ADC, usual_scan(sample, battery_mv))
    }

    /// The board's: a scan with all eight.
    pub fn wide_adc(&mut self, sample: &AdcSample, battery_mv: Option<u16>) -> Frame {
        let more = sample.ir_front[USUAL_SLOTS..].iter().chain(&sample.ir_rear[USUAL_SLOTS..]).map(counts);
        self.writer.frame(kind::WIDE_ADC, usual_scan(sample, battery_mv).chain(more))
    }
}

/// A reading of a range finder.
fn counts(reading: &AdcCount) -> u16 {
    reading.get() as u16
}

fn usual_scan(sample: &AdcSample, battery_mv: Option<u16>) -> impl Iterator<Item = u16> {
    let ranges = sample.ir_front[..USUAL_SLOTS].iter().chain(&sample.ir_rear[..USUAL_SLOTS]).map(counts);
    let sums = sample.tilt.iter().chain(&sample.pistons);
    let sums = sums.map(|c| (c.get() * f64::from(ADC_SCANS) + 0.5) as u16);
    ranges.chain(sums).chain([battery_mv.unwrap_or(NOT_FITTED)])
}
