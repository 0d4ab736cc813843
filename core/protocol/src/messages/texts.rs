//! What people read for the protocol's names: one table for each enum, in plain technical English.
//!
//! A text is a phrase without a full stop, to stand after "stopped: " or in a list. A remedy is what a person
//! does about it; [`ROBOT`] stands in it for the robot's name ([`for_robot`] puts that in).

use super::{Fault, GoalStatus, Latch, LatchState, RobotState, StopReason, TaskState};
use crate::keys::Name;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// Stands for the robot's name in a remedy.
pub const ROBOT: &str = "ROBOT";

/// A remedy with the robot's name in it.
#[must_use]
pub fn for_robot(remedy: &str, robot: &Name) -> String {
    remedy.replace(ROBOT, robot.as_str())
}

/// Makes `ALL`, `text` and, where the rows have one, `remedy` of a table with a row for each variant.
macro_rules! texts {
    ($enum:ident { $($variant:ident => $text:literal;)+ }) => {
        impl $enum {
            /// All of them, in the order of their numbers.
            pub const ALL: [Self; [$(stringify!($variant)),+].len()] = [$(Self::$variant),+];

            /// For people.
            #[must_use]
            pub const fn text(self) -> &'static str {
                match self { $(Self::$variant => $text,)+ }
            }
        }
    };
    ($enum:ident { $($variant:ident => $text:literal, $remedy:expr;)+ } -> $type:ty) => {
        texts! { $enum { $($variant => $text;)+ } }

        impl $enum {
            /// What a person does about it.
            #[must_use]
            pub const fn remedy(self) -> $type {
                match self { $(Self::$variant => $remedy,)+ }
            }
        }
    };
}

const NEW_COMMAND: Option<&str> = Some("give a new command, such as `fleet-cli goto ROBOT X Y`");

texts! {
    StopReason {
        NoCommand => "no command", NEW_COMMAND;
        GoalReached => "goal reached", NEW_COMMAND;
        Stop => "stop requested", NEW_COMMAND;
        Cancelled => "goal cancelled", NEW_COMMAND;
        TimeUp => "goal time limit reached", NEW_COMMAND;
        SetpointExpired => "setpoint timed out",
            Some("hold the key or the joystick; if it was held, check the network connection");
        LinkLost => "connection to the router lost",
            Some("check the network between robot and router: `fleet-cli doctor`");
        SetpointZero => "setpoint is zero", Some("press a key or move the joystick");
        ObstacleFront => "obstacle ahead",
            Some("clear the path ahead; if nothing is there any more, reverse by 5 cm");
        ObstacleRear => "obstacle behind",
            Some("clear the path behind; if nothing is there any more, drive forward by 5 cm");
        WanderPause => "pausing while wandering", None;
        BoardLost => "I/O board not responding", Some(Fault::BoardSilent.remedy());
        GyroLost => "gyro not responding", Some(Fault::GyroSilent.remedy());
        RemoteNeutral => "remote control active, speed stick in neutral",
            Some("drive with the transmitter, or switch its selector to the computer");
        RemoteLost => "remote control signal lost", Some(Fault::RemoteLost.remedy());
        // The remedies of these five are for after the reset: until then their latches say what to do.
        Estop => "emergency stop", NEW_COMMAND;
        RemoteTakeover => "remote control took over", NEW_COMMAND;
        Runaway => "runaway: wheels faster than commanded", NEW_COMMAND;
        SensorFault => "sensor fault", NEW_COMMAND;
        BatteryCritical => "battery nearly empty", NEW_COMMAND;
        LeaseExpired => "controlling client timed out",
            Some("restart the client or check its network connection, then give a new command");
        LeaseTaken => "another client took control",
            Some("agree with whoever has control, or use --take; then give a new command");
        LeaseReleased => "control released", NEW_COMMAND;
        LoopStalled => "control loop stalled",
            Some("find what blocks the robot's computer, then give a new command");
        Stalled => "motor driven, but wheels not turning", Some(Fault::Stalled.remedy());
        OverSpeed => "remote control too fast for obstacle detection",
            Some("drive slower, or away from the obstacle");
        ChangingDirection => "waiting for standstill before reversing", None;
        Coasting => "coasting", None;
        Starting => "starting", None;
        Planning => "planning a path", None;
        WaitingForTraffic => "waiting for traffic clearance",
            Some("none needed while the others move: `fleet-cli status` shows which robot it waits for");
        GivingWay => "giving way to another robot",
            Some("none needed: it continues when the other robot has passed, or drives around it if that one \
                  stands; `fleet-cli traffic serve` coordinates both");
        WayBlocked => "blocked by an unmapped obstacle",
            Some("clear the path; the robot also looks for another one by itself");
        PoseUncertain => "position too uncertain",
            Some("send it pose fixes, or `fleet-cli stop ROBOT`, then set its position: \
                  `fleet-cli set-pose ROBOT X Y --yaw DEGREES`");
        InKeepOut => "inside a keep-out zone", Some("drive it out by hand: `fleet-cli teleop ROBOT`");
        AtCusp => "stopping to change direction", None;
    } -> Option<&'static str>
}

// Those of board and gyro stand in docs/io-board.md too, and a test compares them.
const POWER_CYCLE: &str = "power-cycle it";
const PLUG_IN: &str = "plug it in, or name the right port (`robot-agent ports` lists them)";
const PORT_BUSY: &str = "end the other program that holds the port";
const PERMISSION: &str = "let this user open the port: often the group dialout";
const OTHER_PORT: &str = "read the system's words; try another port";
const BAUD_RATE: &str = "check the baud rate and the ground wire";
const BYTES_LOST: &str =
    "bytes are being lost: check the cable, and that the baud rate is not too high for it";
const SWAPPED: &str = "another device is at this port: are the two lines swapped?";

texts! {
    Fault {
        BoardUnplugged => "I/O board: port not found", PLUG_IN;
        BoardBusy => "I/O board: port in use by another program", PORT_BUSY;
        BoardNoPermission => "I/O board: no permission to open the port", PERMISSION;
        BoardPortBroken => "I/O board: port cannot be used", OTHER_PORT;
        BoardSilent => "I/O board: no data", "check power, and the wire from the board to the computer";
        BoardGarbage => "I/O board: unreadable data", BAUD_RATE;
        BoardHalfFrames => "I/O board: incomplete frames", BYTES_LOST;
        BoardWrongDevice => "I/O board: another device at its port", SWAPPED;
        BoardNotSetUp => "I/O board: set-up not confirmed",
            "check the wire from the computer to the board, or flash the firmware of this agent's release";
        GyroUnplugged => "gyro: port not found", PLUG_IN;
        GyroBusy => "gyro: port in use by another program", PORT_BUSY;
        GyroNoPermission => "gyro: no permission to open the port", PERMISSION;
        GyroPortBroken => "gyro: port cannot be used", OTHER_PORT;
        GyroSilent => "gyro: no data", "check its power and its wires: a 3DM-G speaks only when asked, a BNO085 only in UART-RVC mode";
        GyroGarbage => "gyro: unreadable data", BAUD_RATE;
        GyroHalfFrames => "gyro: incomplete frames", BYTES_LOST;
        GyroWrongDevice => "gyro: another device at its port", SWAPPED;
        EncoderSilent => "encoder: no data from the I/O board",
            "the board's encoder channel does not run: power-cycle the board";
        ConverterSilent => "A/D converter: no data from the I/O board",
            "the board's converter does not run: power-cycle the board";
        RemoteLost => "remote control: signal lost", "switch the transmitter on, or bring it nearer";
        TiltOutOfRange => "tilt sensor: voltage out of range", "check the tilt sensor's wires and its supply";
        RecordingFailed => "recorder: cannot write", "check the disk's free space and its speed";
        BoardFrozen => "I/O board: frozen, repeats one frame", POWER_CYCLE;
        GyroFrozen => "gyro: frozen, clock or angles do not change", POWER_CYCLE;
        EncoderOutOfRange => "encoder: more pulses than the motor can turn",
            "check the encoder's wires and their shielding";
        ConverterFrozen => "A/D converter: frozen, no channel changes", POWER_CYCLE;
        InfraredFrozen => "range finder: frozen, reading does not change while driving",
            "check it and its wire: `robot-agent check-hardware` shows each reading";
        InfraredOutOfRange => "range finder: reading out of range, broken wire or short circuit",
            "check its wire: `robot-agent check-hardware` shows each reading";
        Runaway => "drive: runaway, wheels faster than commanded",
            "switch the motor's power off, then check speed control and encoder";
        Stalled => "drive: motor driven, but wheels not turning",
            "check what holds the wheels; if nothing does, check the encoder's wire, and raise \
             vehicle.guard.stall_counts for an ESC with a larger dead band";
        BatteryLow => "battery: low", "bring it home and charge it";
        BatteryCritical => "battery: nearly empty", "switch it off and charge it";
        OdometryScale => "odometry: distances at least 15 % off, by the pose fixes",
            "check the settings encoder.pulses_per_rev and geometry.wheel_diameter_m, and the encoder's wire";
        FixesFrozen => "pose fixes: frozen, one pose is repeated while the wheels turn",
            "restart what sends the fixes; until then the pose is the odometry's";
        FixesContradict => "pose fixes: contradict the odometry",
            "check that its fixes are not another robot's (`fleet-cli doctor`), then `fleet-cli set-pose`";
    } -> &'static str
}

// What ends the cause of a latch; the reset comes after it.
texts! {
    Latch {
        Estop => "emergency stop", "release the emergency stop switch";
        RemoteTakeover => "remote control took over", "switch the transmitter's selector back to the computer";
        BoardLost => "I/O board lost", Fault::BoardSilent.remedy();
        GyroLost => "gyro lost", Fault::GyroSilent.remedy();
        Runaway => "runaway: wheels faster than commanded", Fault::Runaway.remedy();
        SensorFault => "sensor fault", "check the sensor: `robot-agent check-hardware` shows each reading";
        BatteryCritical => "battery nearly empty", Fault::BatteryCritical.remedy();
    } -> &'static str
}

texts! {
    GoalStatus {
        Accepted => "accepted, not started";
        Running => "in progress";
        Blocked => "blocked by an obstacle";
        Reached => "reached";
        Cancelled => "cancelled";
        Replaced => "replaced by a newer goal";
        Failed => "failed";
        Interrupted => "interrupted by a restart of the robot";
    }
}

texts! {
    TaskState {
        Queued => "waiting for a robot";
        Assigned => "assigned to a robot, not started";
        Running => "in progress";
        Blocked => "blocked by an obstacle";
        Held => "on hold: robot taken over or stopped";
        Paused => "paused";
        Cancelling => "cancelling: waiting for the robot to confirm";
        Done => "done";
        Failed => "failed";
        Cancelled => "cancelled";
    }
}

impl LatchState {
    /// What a person does about it: about its cause first, while that is present, then the reset.
    #[must_use]
    pub fn remedy(&self, state: &RobotState) -> String {
        let reset = format!(
            "`fleet-cli reset {} --latch {}`, then give a new command (a dispatcher needs none)",
            state.robot, self.latch
        );
        if !self.present {
            return reset;
        }
        let mut faults = state.faults.iter().map(|state| state.fault);
        let fault = faults.find(|fault| self.by.contains(&fault.to_string()));
        let first = fault.map_or_else(|| self.latch.remedy(), Fault::remedy);
        format!("first {first}; then {reset}")
    }
}

/// Why a goal failed whose client was not heard in time; [`is_client_timeout`] knows it.
#[must_use]
pub fn client_timeout(by: &Name) -> String {
    format!("controlling client {by} timed out")
}

/// Why a goal has ended whose assignment was withdrawn.
pub const WITHDRAWN: &str = "assignment withdrawn";

/// Whether a goal's reason says that, in these words or in those of robots with an older program.
#[must_use]
pub fn is_withdrawn(reason: &str) -> bool {
    reason == WITHDRAWN || reason == "its assignment was withdrawn"
}

/// Whether a goal's reason says that its client was not heard in time, in these words or in those of robots
/// with an older program.
#[must_use]
pub fn is_client_timeout(reason: &str) -> bool {
    reason.contains("fell silent")
        || reason.starts_with("controlling client ") && reason.ends_with(" timed out")
}

/// All tables, for a program that shows them itself: `{"stop_reason": {"no_command": {"text", "remedy"}}}`.
/// A remedy may hold [`ROBOT`]; it is null where nothing is to be done, and for a status, which has none.
#[must_use]
pub fn tables() -> Value {
    fn table<T: Serialize>(rows: impl IntoIterator<Item = (T, &'static str, Option<&'static str>)>) -> Value {
        let rows = rows.into_iter().filter_map(|(name, text, remedy)| {
            let Ok(Value::String(name)) = serde_json::to_value(name) else { return None };
            Some((name, json!({ "text": text, "remedy": remedy })))
        });
        Value::Object(rows.collect::<Map<_, _>>())
    }
    json!({
        "stop_reason": table(StopReason::ALL.map(|it| (it, it.text(), it.remedy()))),
        "fault": table(Fault::ALL.map(|it| (it, it.text(), Some(it.remedy())))),
        "latch": table(Latch::ALL.map(|it| (it, it.text(), Some(it.remedy())))),
        "goal_status": table(GoalStatus::ALL.map(|it| (it, it.text(), None))),
        "task_state": table(TaskState::ALL.map(|it| (it, it.text(), None))),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_a_text_that_stands_in_a_line() {
        let tables = tables();
        let lengths = tables.as_object().unwrap().values().map(|table| table.as_object().unwrap().len());
        assert_eq!(lengths.sum::<usize>(), 36 + 35 + 7 + 8 + 10, "no name stands twice");
        for (name, row) in tables.as_object().unwrap().values().flat_map(|table| table.as_object().unwrap()) {
            let remedy = row["remedy"].as_str().unwrap_or("none");
            for text in [row["text"].as_str().unwrap(), remedy] {
                assert!(!text.is_empty() && !text.ends_with('.') && !text.contains('\n'), "{name}: {text:?}");
                assert!(text.trim() == text && !text.contains("  "), "{name}: {text:?}");
            }
        }
    }

    #[test]
    fn a_remedy_is_missing_only_where_nobody_has_to_act() {
        use StopReason::{AtCusp, ChangingDirection, Coasting, Planning, Starting, WanderPause};
        let none: Vec<_> = StopReason::ALL.into_iter().filter(|reason| reason.remedy().is_none()).collect();
        assert_eq!(none, [WanderPause, ChangingDirection, Coasting, Starting, Planning, AtCusp]);
    }

    #[test]
    fn the_order_is_that_of_the_numbers() {
        for (number, reason) in StopReason::ALL.into_iter().enumerate() {
            assert_eq!(postcard::to_allocvec(&reason).unwrap(), [number as u8]);
        }
        for (number, fault) in Fault::ALL.into_iter().enumerate() {
            assert_eq!(postcard::to_allocvec(&fault).unwrap(), [number as u8]);
        }
    }

    #[test]
    fn a_remedy_names_the_robot() {
        let robot = Name::new("xtb-1").unwrap();
        let remedy = StopReason::InKeepOut.remedy().unwrap();
        assert_eq!(for_robot(remedy, &robot), "drive it out by hand: `fleet-cli teleop xtb-1`");
    }

    #[test]
    fn a_client_timeout_is_known_in_old_and_new_words() {
        assert!(is_client_timeout(&client_timeout(&Name::new("dispatch").unwrap())));
        assert!(is_client_timeout("its client dispatch fell silent, and its policy is halt"));
        assert!(!is_client_timeout("the goal's time was up"));
    }
}
