//! What comes in on the lines: bytes that become samples for the controller, and how the ports are.

use super::Robot;
use super::guards::is_neutral_stick;
use crate::line::{LINE_LOST_MS, PortTrouble};
use std::sync::Arc;
use xtb_control::controller::GyroSample;
use xtb_control::{Sample, Stamp};
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::board::{BoardError, BoardStatus, FromBoard};
use xtb_protocol::gyro_3dmg::GyroFrame;

/// A line that is this long without a good frame is looked at for another device's: well before it counts as
/// lost, so that its name is known then.
const SUSPICIOUS_MS: u64 = 50;
/// High nibble of each type of frame: the layout's version.
const LAYOUT: u8 = 1;

impl Robot {
    /// Bytes from the I/O board, read at `now`; each sample among them takes one controller step.
    pub fn board_bytes(&mut self, now: Stamp, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        if self.is_late(now) {
            // The board's watchdog has fired because of us: no reason to set it up again.
            self.board.excused_until = now.plus_ms(LINE_LOST_MS);
        }
        self.board.watch.came(now);
        if self.board.watch.unwell_ms(now) > SUSPICIOUS_MS {
            let watch = &mut self.board.watch;
            self.board.foreign.push(bytes, |_| watch.foreign_frame());
        }
        let mut reader = std::mem::take(&mut self.board.reader);
        reader.from_board(bytes, |frame| match frame {
            Ok(frame) => {
                self.board.watch.good_frame(now);
                self.board_frame(now, frame);
            }
            // Whole, but not a board's: our own echo, or firmware of another version.
            Err(BoardError::UnknownType(kind)) => {
                self.board.watch.foreign_frame();
                self.board.other_layout = Some(kind >> 4).filter(|layout| *layout != LAYOUT);
            }
            Err(BoardError::Repeated(_)) => self.board.watch.repeated_frame(),
            Err(BoardError::Pulses(pulses)) => self.monitors.impossible_window(pulses),
            Err(_) => {} // the reader counts it
        });
        self.board.reader = reader;
        self.board.watch.bytes(now, bytes);
    }

    /// Until the board has confirmed its set-up, nothing but its status counts (Fig. 8).
    fn board_frame(&mut self, now: Stamp, frame: FromBoard) {
        self.heard.board = Some(now);
        match frame {
            FromBoard::Status(status) => self.board_status(now, status),
            FromBoard::Identity(identity) => self.asker.heard(identity),
            _ if !self.setup.is_done() => {}
            FromBoard::Bno085(sample) => self.bno085_sample(now, &sample),
            FromBoard::Encoder { pulses } => {
                self.heard.encoder = Some(now);
                self.newest.pulses = pulses;
                self.step(now, &Sample::Encoder { pulses: u32::from(pulses) });
                self.watch_window(now, pulses);
            }
            // Not all of the car's range finders: it has been asked for a wide one.
            FromBoard::Adc { is_wide: false, .. } if self.needs_wide_scan() => {}
            FromBoard::Adc { sample, battery_mv, .. } => {
                self.heard.adc = Some(now);
                (self.newest.adc, self.newest.battery_mv) = (Some(sample), battery_mv);
                self.monitors.scan(self.controller.config(), now, &sample, battery_mv);
                self.step(now, &Sample::Adc(self.seen(sample)));
            }
            FromBoard::Remote(sample) => {
                self.heard.remote = Some(now);
                self.newest.remote = sample;
                self.remote_due = Some(now.plus_ns(self.remote_period_ns() * 3 / 2));
                self.step(now, &Sample::Remote(sample));
                // Frames that waited while the loop was held up tell how the stick was, not how it is.
                let is_now = now >= self.board.excused_until;
                let rests = is_now && self.outputs.duties.speed.is_some_and(is_neutral_stick);
                self.stick_held &= !rests;
            }
        }
    }

    fn board_status(&mut self, now: Stamp, mut status: BoardStatus) {
        // A board that has said once that its stop is pressed knows the bit, whatever its firmware.
        self.board.has_stop |= status.emergency_stop.is_some();
        status.emergency_stop = status.emergency_stop.or(self.board.has_stop.then_some(false));
        if self.newest.status.is_none_or(|before| before.firmware != status.firmware) {
            self.board.refused = status.firmware.check().err().map(|error| error.to_string().into());
        }
        let was_ready = self.newest.status.replace(status).is_some_and(|before| before.ready);
        if let Some(pressed) = status.emergency_stop {
            self.agent.set_stop_switch(now, pressed);
        }
        let was_done = self.setup.is_done();
        let understood = self.board.hears_us(now, &status) && self.board.refused.is_none();
        self.setup.confirm(status.ready && understood, status.setup_checksum);
        if was_done && !self.setup.is_done() {
            self.lose_remote(now);
        }
        if was_ready && !status.ready {
            self.forget_what_was_asked();
        }
    }

    /// A sample of the BNO085, of a truck that has one. It is watched as the 3DM-G's line is.
    fn bno085_sample(&mut self, now: Stamp, sample: &Bno085Sample) {
        let Some(link) = &mut self.bno085 else { return };
        self.gyro.watch.came(now);
        link.counter.count(sample);
        link.yaw_cdeg = sample.yaw_cdeg;
        let angles = sample.angles(link.yaw);
        if self.is_repeated(now, sample) {
            self.gyro.watch.repeated_frame();
            self.gyro.watch.bytes(now, &sample.to_rvc());
        } else {
            self.gyro.watch.good_frame(now);
            self.gyro_sample(now, angles);
        }
    }

    fn gyro_sample(&mut self, now: Stamp, angles: GyroSample) {
        self.heard.gyro = Some(now);
        self.newest.gyro = angles;
        self.step(now, &Sample::Gyro(angles));
    }

    /// Bytes from the gyro, read at `now`; of no concern to a truck whose gyro is at the board.
    pub fn gyro_bytes(&mut self, now: Stamp, bytes: &[u8]) {
        if bytes.is_empty() || self.bno085.is_some() {
            return;
        }
        self.gyro.watch.came(now);
        if self.gyro.watch.unwell_ms(now) > SUSPICIOUS_MS {
            let watch = &mut self.gyro.watch;
            self.gyro.foreign.from_board(bytes, |frame| {
                if frame.is_ok() {
                    watch.foreign_frame();
                }
            });
        }
        let mut reader = std::mem::take(&mut self.gyro.reader);
        reader.push(bytes, |frame| match frame {
            GyroFrame::Firmware(version) => self.gyro.starter.heard_firmware(version),
            GyroFrame::Euler(frame) if self.is_repeated(now, &frame) => self.gyro.watch.repeated_frame(),
            GyroFrame::Euler(frame) => {
                self.gyro.watch.good_frame(now);
                self.gyro_sample(now, frame.angles);
            }
        });
        self.gyro.reader = reader;
        self.gyro.watch.bytes(now, bytes);
    }

    /// How the board's port is: `None` = open. What is plugged in again has to be set up again.
    pub fn board_port(&mut self, now: Stamp, trouble: Option<(PortTrouble, &str)>) {
        let opened = self.board.watch.port(now, trouble.map(|(kind, _)| kind));
        keep_detail(&mut self.board.detail, trouble);
        if trouble.is_some() || opened {
            self.setup.forget();
            self.board.reader.forget();
            self.forget_what_was_asked();
            (self.newest.status, self.board.has_stop) = (None, false);
            (self.board.refused, self.board.other_layout) = (None, None);
            (self.board.open_since, self.board.starved, self.board.fed) = (now, None, false);
            self.monitors.forget_board();
            self.lose_remote(now);
        }
    }

    /// The board has to be asked anew.
    fn forget_what_was_asked(&mut self) {
        self.asker.forget();
        if let Some(link) = &mut self.bno085 {
            link.counter.forget();
            self.monitors.forget_gyro();
        }
    }

    /// How the gyro's port is: `None` = open; of no concern to a truck whose gyro is at the board.
    pub fn gyro_port(&mut self, now: Stamp, trouble: Option<(PortTrouble, &str)>) {
        if self.bno085.is_some() {
            return;
        }
        let opened = self.gyro.watch.port(now, trouble.map(|(kind, _)| kind));
        keep_detail(&mut self.gyro.detail, trouble);
        if trouble.is_some() || opened {
            self.gyro.starter.forget();
            self.gyro.reader.forget();
            self.monitors.forget_gyro();
        }
    }
}

#[inline]
fn keep_detail(kept: &mut Option<Arc<str>>, trouble: Option<(PortTrouble, &str)>) {
    match trouble {
        None if kept.is_none() => {}
        None => *kept = None,
        Some((_, words)) if kept.as_deref() != Some(words) => *kept = Some(words.into()),
        Some(_) => {}
    }
}
