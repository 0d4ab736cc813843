//! What comes in on the lines: bytes that become samples for the controller, and how the ports are.

use super::Robot;
use super::guards::is_neutral_stick;
use crate::line::{LINE_LOST_MS, PortTrouble};
use std::sync::Arc;
use xtb_control::{Sample, Stamp};
use xtb_protocol::board::{BoardError, FromBoard};
use xtb_protocol::gyro_3dmg::GyroFrame;

/// A line that is this long without a good frame is looked at for another device's: well before it counts as
/// lost, so that its name is known then.
const SUSPICIOUS_MS: u64 = 50;

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
            Err(BoardError::UnknownType(_)) => self.board.watch.foreign_frame(),
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
            FromBoard::Status(status) => {
                self.newest.status = Some(status);
                let was_done = self.setup.is_done();
                let hears = self.board.hears_us(now, &status);
                self.setup.confirm(status.ready && hears, status.setup_checksum);
                if was_done && !self.setup.is_done() {
                    self.lose_remote(now);
                }
            }
            _ if !self.setup.is_done() => {}
            FromBoard::Encoder { pulses } => {
                self.heard.encoder = Some(now);
                self.newest.pulses = pulses;
                self.step(now, &Sample::Encoder { pulses: u32::from(pulses) });
                self.watch_window(now, pulses);
            }
            FromBoard::Adc { sample, battery_mv } => {
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
                self.stick_held &= !self.outputs.duties.speed.is_some_and(is_neutral_stick);
            }
        }
    }

    /// Bytes from the gyro, read at `now`.
    pub fn gyro_bytes(&mut self, now: Stamp, bytes: &[u8]) {
        if bytes.is_empty() {
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
                self.heard.gyro = Some(now);
                self.newest.gyro = frame.angles;
                self.step(now, &Sample::Gyro(frame.angles));
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
            self.newest.status = None;
            (self.board.open_since, self.board.starved, self.board.fed) = (now, None, false);
            self.monitors.forget_board();
            self.lose_remote(now);
        }
    }

    /// How the gyro's port is: `None` = open.
    pub fn gyro_port(&mut self, now: Stamp, trouble: Option<(PortTrouble, &str)>) {
        let opened = self.gyro.watch.port(now, trouble.map(|(kind, _)| kind));
        keep_detail(&mut self.gyro.detail, trouble);
        if trouble.is_some() || opened {
            self.gyro.starter.forget();
            self.gyro.reader.forget();
            self.monitors.forget_gyro();
        }
    }
}

fn keep_detail(kept: &mut Option<Arc<str>>, trouble: Option<(PortTrouble, &str)>) {
    match trouble {
        None => *kept = None,
        Some((_, words)) if kept.as_deref() != Some(words) => *kept = Some(words.into()),
        Some(_) => {}
    }
}
