//! A truck's lines with an ear on the board's: which pulses pass, and when.

use robot_agent::hardware::Hardware;
use robot_agent::hardware::simulated::SimulatedHardware;
use std::io;
use std::sync::mpsc::Sender;
use std::time::Instant;
use xtb_control::controller::PwmOutputs;
use xtb_protocol::board::{FrameReader, ToBoard};

/// See the module's documentation.
pub struct Probe {
    inner: SimulatedHardware,
    reader: FrameReader,
    passed: Sender<(PwmOutputs, Instant)>,
}

impl Probe {
    /// Tells `passed` of each PWM frame.
    #[must_use]
    pub fn new(inner: SimulatedHardware, passed: Sender<(PwmOutputs, Instant)>) -> Self {
        Self { inner, reader: FrameReader::default(), passed }
    }
}

impl Hardware for Probe {
    fn kind(&self) -> &'static str {
        self.inner.kind()
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read_board(buffer)
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.inner.read_gyro(buffer)
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        let passed = &self.passed;
        self.reader.to_board(bytes, |frame| {
            if let Ok(ToBoard::Pwm(pulses)) = frame {
                let _ = passed.send((pulses, Instant::now()));
            }
        });
        self.inner.write_board(bytes)
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.inner.write_gyro(bytes)
    }
}
