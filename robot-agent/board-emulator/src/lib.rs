//! The I/O board's own firmware in its emulator, as the board of a simulated truck.
//!
//! ```text
//!   Truck ── Pins ──► Emulator ── a line of JSON ──► node bridge.mjs: the emulated chip runs the firmware
//!         ◄─ Pulses ─          ◄─ a line of JSON ──
//! ```
//! The truck's simulated time is the chip's: nothing depends on how fast this computer is, and the same run
//! gives the same bits. Needs Node 18 or newer, and the packages of `robot-agent/firmware/emulator`.

mod line;

use line::{Answer, Step};
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use thiserror::Error;
use xtb_control::units::Stamp;
use xtb_sim::{ExternalBoard, Pins, Pulses};

/// Why there is no emulated board.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum EmulatorError {
    /// No such firmware.
    #[error("{} is no file", .0.display())]
    NoFirmware(PathBuf),
    /// The folder is not the emulator's.
    #[error("{} has no bridge.mjs", .0.display())]
    NoEmulator(PathBuf),
    /// Its packages are not installed.
    #[error("{} has no node_modules/rp2040js", .0.display())]
    NoPackages(PathBuf),
    /// The system's word.
    #[error("node does not start: {0}")]
    NoNode(String),
    /// It began and did not go on.
    #[error("the emulator has ended: {0}")]
    Ended(String),
}

impl EmulatorError {
    /// What to do.
    #[must_use]
    pub fn hint(&self) -> &'static str {
        match self {
            Self::NoFirmware(_) => "build it: cargo xtask uf2 in robot-agent/firmware; it is the ELF file",
            Self::NoEmulator(_) => "name this repository's folder robot-agent/firmware/emulator",
            Self::NoPackages(_) => "npm ci --ignore-scripts in that folder",
            Self::NoNode(_) => "install Node 18 or newer",
            Self::Ended(_) => "its process was ended, or the file is not the firmware's ELF file for a Pico",
        }
    }
}

/// A chip with the firmware, in a process that ends with this.
#[derive(Debug)]
pub struct Emulator {
    process: Child,
    to: ChildStdin,
    from: BufReader<ChildStdout>,
    pulses: Pulses,
    resets: u64,
    failure: Option<EmulatorError>,
}

impl Emulator {
    /// Switches the board on. `firmware` is an ELF file for the RP2040, `emulator` the folder with `bridge.mjs`.
    ///
    /// # Errors
    /// A file, the emulator's packages or Node is missing, or it is no firmware.
    pub fn start(firmware: &Path, emulator: &Path, receiver_fitted: bool) -> Result<Self, EmulatorError> {
        let bridge = emulator.join("bridge.mjs");
        if !firmware.is_file() {
            return Err(EmulatorError::NoFirmware(firmware.to_owned()));
        }
        if !bridge.is_file() {
            return Err(EmulatorError::NoEmulator(emulator.to_owned()));
        }
        if !emulator.join("node_modules/rp2040js").exists() {
            return Err(EmulatorError::NoPackages(emulator.to_owned()));
        }
        let option = (!receiver_fitted).then_some(OsStr::new("--no-receiver"));
        let arguments = [bridge.as_os_str(), firmware.as_os_str()].into_iter().chain(option);
        let mut node = Command::new("node");
        node.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut process = node.spawn().map_err(|error| EmulatorError::NoNode(error.to_string()))?;
        let (Some(to), Some(from)) = (process.stdin.take(), process.stdout.take()) else {
            return Err(EmulatorError::NoNode("it has no pipes".into()));
        };
        let pulses = Pulses { counts: [0; 10], begun: Stamp::ZERO };
        let from = BufReader::new(from);
        let mut emulator = Self { process, to, from, pulses, resets: 0, failure: None };
        emulator.exchange(&Step::power_on()).map(|_| emulator)
    }

    /// How often the chip's watchdog has reset it.
    #[must_use]
    pub fn resets(&self) -> u64 {
        self.resets
    }

    /// Why it gives neither pulses nor bytes any more.
    #[must_use]
    pub fn failure(&self) -> Option<&EmulatorError> {
        self.failure.as_ref()
    }

    fn exchange(&mut self, step: &Step) -> Result<Answer, EmulatorError> {
        let mut line = String::new();
        let result = writeln!(self.to, "{}", step.written()).and_then(|()| self.from.read_line(&mut line));
        match result {
            Ok(length) if length > 0 => Answer::read(&line).map_err(EmulatorError::Ended),
            _ => Err(EmulatorError::Ended(self.last_words())),
        }
    }

    /// The line of its messages that names the error; it has closed its end of a pipe, so it ends.
    fn last_words(&mut self) -> String {
        let mut said = String::new();
        if let Some(mut from) = self.process.stderr.take() {
            let _ = from.read_to_string(&mut said);
        }
        let error = said.lines().find(|line| line.contains("Error: "));
        error.or(said.lines().last()).unwrap_or("it said nothing").trim().to_owned()
    }
}

impl ExternalBoard for Emulator {
    fn step(&mut self, from_agent: &[u8], pins: &Pins, to_agent: &mut Vec<u8>) -> Pulses {
        if self.failure.is_some() {
            return self.pulses;
        }
        match self.exchange(&Step::of(from_agent, pins)) {
            Ok(answer) => {
                to_agent.extend_from_slice(&answer.bytes);
                (self.pulses, self.resets) = (answer.pulses, answer.resets);
            }
            Err(failure) => {
                self.failure = Some(failure);
                self.pulses = Pulses { counts: [0; 10], begun: pins.now };
            }
        }
        self.pulses
    }
}

impl Drop for Emulator {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
