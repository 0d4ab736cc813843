//! Frames, built for the line.

use super::frames::{
    ADC_SCANS, BoardStatus, CRC32, MAX_BODY, MAX_FRAME, NO_PULSE, NOT_FITTED, READY, TYPE_ADC, TYPE_ENCODER,
    TYPE_PWM, TYPE_REMOTE, TYPE_RESET, TYPE_SETUP, TYPE_STATUS, WATCHDOG,
};
use xtb_control::controller::{AdcSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, Setup};
use xtb_control::units::PwmCount;

/// A frame ready for the line.
#[derive(Debug, Clone, Copy)]
pub struct Frame {
    bytes: [u8; MAX_FRAME],
    len: usize,
}

impl Frame {
    /// The bytes, delimiter included.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        &self.bytes[..self.len]
    }
}

/// Builds frames and counts their sequence.
#[derive(Debug, Clone, Default)]
pub struct FrameWriter {
    seq: u8,
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
        self.frame(TYPE_PWM, all.map(PwmCount::get).into_iter())
    }

    /// The agent's: how the board shall configure itself.
    pub fn setup(&mut self, setup: &Setup) -> Frame {
        let bytes = setup.to_bytes();
        self.frame(TYPE_SETUP, bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])))
    }

    /// The agent's: channels of the remote control to reset.
    pub fn reset(&mut self, mask: ResetMask) -> Frame {
        let bits = u16::from(mask.speed) | u16::from(mask.steering) << 1 | u16::from(mask.selector) << 2;
        self.frame(TYPE_RESET, [bits].into_iter())
    }

    /// The board's: a frame of the receiver. Counts above 65,534 saturate there.
    pub fn remote(&mut self, sample: &RemoteSample) -> Frame {
        let word =
            |ticks: Option<u32>| ticks.map_or(NO_PULSE, |ticks| ticks.min(u32::from(NO_PULSE) - 1) as u16);
        self.frame(TYPE_REMOTE, [sample.speed, sample.steering, sample.selector].map(word).into_iter())
    }

    /// The board's: how it is.
    pub fn status(&mut self, status: &BoardStatus) -> Frame {
        let flags = (u16::from(status.ready) * READY) | (u16::from(status.watchdog) * WATCHDOG);
        let words = [status.firmware, flags, status.setup_checksum, status.rejected];
        self.frame(TYPE_STATUS, words.into_iter())
    }

    /// The board's: an encoder window.
    pub fn encoder(&mut self, pulses: u16) -> Frame {
        self.frame(TYPE_ENCODER, [pulses].into_iter())
    }

    /// The board's: a scan. Ranges as counts; tilt and pistons as sums of [`ADC_SCANS`] scans.
    pub fn adc(&mut self, sample: &AdcSample, battery_mv: Option<u16>) -> Frame {
        let ranges = sample.ir_front.iter().chain(&sample.ir_rear).map(|c| c.get() as u16);
        let sums = sample.tilt.iter().chain(&sample.pistons);
        let sums = sums.map(|c| (c.get() * f64::from(ADC_SCANS) + 0.5) as u16);
        self.frame(TYPE_ADC, ranges.chain(sums).chain([battery_mv.unwrap_or(NOT_FITTED)]))
    }

    fn frame(&mut self, kind: u8, payload: impl Iterator<Item = u16>) -> Frame {
        let mut body = [0_u8; MAX_BODY];
        body[0] = kind;
        body[1] = self.seq;
        self.seq = self.seq.wrapping_add(1);
        let mut len = 2;
        for value in payload {
            body[len..len + 2].copy_from_slice(&value.to_le_bytes());
            len += 2;
        }
        let crc = CRC32.checksum(&body[..len]);
        body[len..len + 4].copy_from_slice(&crc.to_le_bytes());
        let mut frame = Frame { bytes: [0; MAX_FRAME], len: 0 };
        let encoded = cobs::encode(&body[..len + 4], &mut frame.bytes);
        frame.len = encoded + 1; // the delimiter is already there
        frame
    }
}
