//! A robot on its lines: what one turn reads from them and writes to them.
//!
//! Shared by the control loop and `check-hardware`, so that a technician sees what a run would see.
//! It waits no longer than the lines do: a full one up to 2 ms a write.

use super::Hardware;
use std::io;
use xtb_control::Stamp;
use xtb_robot::Robot;
use xtb_robot::line::PortTrouble;

/// Bytes read from a line in one turn at most.
const READ_BUFFER: usize = 1024;

/// Hears when a line breaks (its name and the system's words) and when it works again (`None`), once
/// each.
pub type Note<'a> = &'a mut dyn FnMut(&'static str, Option<String>);

/// Both lines of a truck.
pub struct Lines {
    hardware: Box<dyn Hardware>,
    /// Which of them gave an error last time, in [`Line`]'s order.
    broken: [bool; 4],
}

impl Lines {
    /// Lines that have been opened, or will be.
    #[must_use]
    pub fn new(hardware: Box<dyn Hardware>) -> Self {
        Self { hardware, broken: [false; 4] }
    }

    /// Tells the robot how its ports are and what has come.
    pub fn read(&mut self, robot: &mut Robot, now: Stamp, note: Note<'_>) {
        let mut buffer = [0; READ_BUFFER];
        let read = self.hardware.read_board(&mut buffer);
        match &read {
            Ok(n) => {
                robot.board_port(now, None);
                robot.board_bytes(now, &buffer[..*n]);
            }
            Err(error) => robot.board_port(now, Some((trouble(error), &error.to_string()))),
        }
        self.note(Line::FromBoard, read.map(drop), note);
        let read = self.hardware.read_gyro(&mut buffer);
        match &read {
            Ok(n) => {
                robot.gyro_port(now, None);
                robot.gyro_bytes(now, &buffer[..*n]);
            }
            Err(error) => robot.gyro_port(now, Some((trouble(error), &error.to_string()))),
        }
        self.note(Line::FromGyro, read.map(drop), note);
    }

    /// The robot's turn, and what it has to say to its lines: pulses, the board's set-up and resets,
    /// the gyro's start.
    pub fn write(&mut self, robot: &mut Robot, now: Stamp, note: Note<'_>) {
        if let Some(frame) = robot.turn(now) {
            let written = self.hardware.write_board(frame.as_bytes());
            self.note(Line::ToBoard, written, note);
        }
        while let Some(frame) = robot.board_request(now) {
            let written = self.hardware.write_board(frame.as_bytes());
            let failed = written.is_err();
            self.note(Line::ToBoard, written, note);
            if failed {
                break; // each failed write may cost 2 ms; what was lost is asked for again
            }
        }
        if let Some(command) = robot.gyro_request(now) {
            let written = self.hardware.write_gyro(command);
            self.note(Line::ToGyro, written, note);
        }
    }

    /// The last frame before the end: motor neutral, wheels straight.
    pub fn stand(&mut self, robot: &mut Robot, now: Stamp, note: Note<'_>) {
        let frame = robot.neutral_frame(now);
        let written = self.hardware.write_board(frame.as_bytes());
        self.note(Line::ToBoard, written, note);
    }

    fn note(&mut self, line: Line, result: io::Result<()>, note: Note<'_>) {
        let broken = std::mem::replace(&mut self.broken[line as usize], result.is_err());
        if broken != result.is_err() {
            note(line.name(), result.err().map(|error| error.to_string()));
        }
    }
}

/// What a failed read says about its port.
fn trouble(error: &io::Error) -> PortTrouble {
    match error.kind() {
        io::ErrorKind::NotFound => PortTrouble::Unplugged,
        io::ErrorKind::ResourceBusy => PortTrouble::Busy,
        io::ErrorKind::PermissionDenied => PortTrouble::NoPermission,
        _ => PortTrouble::Broken,
    }
}

#[derive(Clone, Copy)]
enum Line {
    FromBoard = 0,
    ToBoard = 1,
    FromGyro = 2,
    ToGyro = 3,
}

impl Line {
    fn name(self) -> &'static str {
        match self {
            Self::FromBoard => "line from the board",
            Self::ToBoard => "line to the board",
            Self::FromGyro => "line from the gyro",
            Self::ToGyro => "line to the gyro",
        }
    }
}
