//! Who may write the motor: one table, read from the top, the first row that applies decides.
//!
//! ```text
//!   board watchdog   (on the board itself: no frame for 100 ms, neutral)
//!   latched stop     estop, runaway, sensor fault, battery
//!   fault            something that is broken now
//!   remote control   selector on manual
//!   network held     remote takeover, board or gyro lost: the transmitter may, the network may not
//!   teleoperation    a live setpoint under the present lease
//!   goal             one whose policy allows it
//!   nobody           neutral, the default
//! ```
//! The obstacle rule stands beside the table: it holds the motor neutral for whoever writes it.

/// What a turn knows of those who want to drive and of what forbids it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Facts {
    /// A latch is set that holds the transmitter too.
    pub latched: bool,
    /// Something is broken that holds the transmitter too.
    pub broken: bool,
    /// The transmitter's selector is on manual.
    pub manual: bool,
    /// A latch is set, or something is broken, that holds the network.
    pub network_held: bool,
    /// A live setpoint is there.
    pub setpoint: bool,
    /// A goal is under way.
    pub goal: bool,
}

/// Who writes the motor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MotorWriter {
    /// Neutral.
    #[default]
    Nobody,
    /// The R/C transmitter.
    Transmitter,
    /// Teleoperation.
    Setpoint,
    /// The goal.
    Goal,
}

/// One row: its name, when it applies, who then writes.
pub type ArbitrationRow = (&'static str, fn(&Facts) -> bool, MotorWriter);

/// The order of arbitration.
pub const TABLE: [ArbitrationRow; 7] = [
    ("latched stop", |facts| facts.latched, MotorWriter::Nobody),
    ("fault", |facts| facts.broken, MotorWriter::Nobody),
    ("remote control", |facts| facts.manual, MotorWriter::Transmitter),
    ("network held", |facts| facts.network_held, MotorWriter::Nobody),
    ("teleoperation", |facts| facts.setpoint, MotorWriter::Setpoint),
    ("goal", |facts| facts.goal, MotorWriter::Goal),
    ("nobody", |_| true, MotorWriter::Nobody),
];

/// Who writes the motor this turn.
#[must_use]
pub fn writer(facts: &Facts) -> MotorWriter {
    TABLE.iter().find(|(_, applies, _)| applies(facts)).map_or(MotorWriter::Nobody, |(_, _, writer)| *writer)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All 64 combinations, against the rules said the other way round.
    #[test]
    fn whoever_writes_is_allowed_to_and_nobody_above_objects() {
        for bits in 0..64_u8 {
            let bit = |i: u8| bits & (1 << i) != 0;
            let facts = Facts {
                latched: bit(0),
                broken: bit(1),
                manual: bit(2),
                network_held: bit(3),
                setpoint: bit(4),
                goal: bit(5),
            };
            let held = facts.latched || facts.broken;
            let network = !held && !facts.manual && !facts.network_held;
            let expected = match () {
                () if !held && facts.manual => MotorWriter::Transmitter,
                () if network && facts.setpoint => MotorWriter::Setpoint,
                () if network && facts.goal => MotorWriter::Goal,
                () => MotorWriter::Nobody,
            };
            assert_eq!(writer(&facts), expected, "{facts:?}");
        }
    }
}
