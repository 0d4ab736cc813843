//! What can be otherwise from a moment on, and for whom.

use crate::time::Turn;
use std::fmt;
use xtb_sim::faults::{DriveFault, InjectedLineFault, SensorFaults};
use xtb_sim::receiver::Transmitter;

/// Most robots of a scenario.
pub(crate) const ROBOTS: u64 = 5;

/// Which link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum End {
    Person(u8),
    Robot(u8),
}

/// Who sent something: the person, and the name that it bore.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Sender {
    pub(crate) person: u8,
    pub(crate) name: u8,
}

impl fmt::Display for Sender {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.person == self.name {
            true => write!(f, "person-{}", self.name),
            false => write!(f, "person-{} as person-{}", self.person, self.name),
        }
    }
}

/// Something that is otherwise from now on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Change {
    /// `kill -9`; a new one boots after so many turns.
    KillAgent { robot: u8, turns: Turn },
    /// The control loop gets no processor; its session lives.
    HoldLoop { robot: u8, turns: Turn },
    /// SIGSTOP: loop and session.
    FreezeAgent { robot: u8, turns: Turn },
    /// The agent's clock jumps, ahead or back.
    JumpClock { robot: u8, ms: i64 },
    /// The agent's clock shows the same time for some turns.
    StickClock { robot: u8, turns: Turn },
    /// A link stalls; longer than two seconds its session ends.
    HoldLink { end: End, turns: Turn },
    /// A link is closed.
    CloseLink { end: End, turns: Turn },
    /// The router dies.
    KillRouter { turns: Turn },
    /// What is wrong with the line from the board.
    BoardLine { robot: u8, fault: InjectedLineFault },
    /// What is wrong with the line from the gyro.
    GyroLine { robot: u8, fault: InjectedLineFault },
    /// A line is unplugged, both ways, or plugged in again.
    Plug { robot: u8, board: bool, plugged: bool },
    /// The board is switched off and on again.
    PowerCycle { robot: u8 },
    /// What somebody does with the transmitter.
    Sticks { robot: u8, transmitter: Transmitter },
    /// What is wrong with a truck's sensors.
    Sensors { robot: u8, faults: SensorFaults },
    /// What is wrong with its drive.
    Drive { robot: u8, fault: DriveFault },
    /// So much of its battery's charge is left.
    Battery { robot: u8, left: f64 },
    /// A person's program dies without a word.
    KillPerson { person: u8 },
    /// A person's program gets no processor.
    FreezePerson { person: u8, turns: Turn },
    /// So many messages a turn from this person to this robot.
    Flood { person: u8, robot: u8, a_turn: u8, turns: Turn },
    /// A stranger repeats what it has heard.
    Replay { person: u8, messages: u8 },
    /// Bytes that are no message, or a damaged one.
    Damaged { person: u8, robot: u8 },
}
