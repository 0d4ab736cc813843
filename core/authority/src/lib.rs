//! Who may move a robot, and what it does about it: state machines without I/O.
//!
//! * [`agent`]: the robot's brain. Requests, setpoints and time go in; replies, at most one
//!   [`Command`](xtb_control::Command) a turn, state and events come out.
//! * [`robot`]: brain, controller and line codecs in one turn: what `robot-agent` runs against real
//!   time and the simulator in lockstep.
//! * [`mod@line`], [`monitor`], [`faults`]: what is broken, by name, and whether it must stop the robot.
//! * [`arbitration`], [`assigned`], [`lease`], [`latch`], [`guard`]: the rules it goes by, each in one place.
//! * [`operator`], [`round_trip`]: the client's side: acquire, retain, retry, and how long to wait for an answer.

pub mod agent;
pub mod arbitration;
pub mod assigned;
pub mod faults;
pub mod gate;
pub mod goal;
pub mod guard;
pub mod latch;
pub mod lease;
pub mod line;
pub mod monitor;
pub mod operator;
pub mod replies;
pub mod robot;
pub mod round_trip;
pub mod tape;

pub use agent::{Agent, Identity};
pub use guard::{Guard, Guards};
pub use operator::Operator;
pub use robot::Robot;
pub use round_trip::RoundTrip;
