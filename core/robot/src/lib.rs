//! One robot without its I/O: who may move it, what is broken, what it does next. State machines, no clock.
//!
//! * [`robot`]: agent, controller and line codecs in one turn: what `robot-agent` runs against real
//!   time and the simulator in lockstep.
//! * [`agent`]: requests, setpoints and time go in; replies, at most one
//!   [`Command`](xtb_control::Command) a turn, state and events come out.
//! * [`authority`]: the rules it goes by, each in one file.
//! * [`mod@line`], [`monitor`], [`faults`]: what is broken, by name, and whether it must stop the robot.
//! * [`step_log`]: every step of the controller, for the recorder. [`motion`]: its odometry in a frame that never jumps.
//! * [`operator`], [`round_trip`]: the client's side: acquire, retain, retry, and how long to wait for an answer.

pub mod agent;
pub mod authority;
pub mod faults;
pub mod line;
pub mod monitor;
pub mod motion;
pub mod operator;
pub mod robot;
pub mod round_trip;
pub mod step_log;

pub use agent::{Agent, RobotIdentity};
pub use authority::guard::{Guard, Guards};
pub use operator::Operator;
pub use robot::Robot;
pub use round_trip::RoundTrip;
