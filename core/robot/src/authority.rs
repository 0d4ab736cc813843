//! Who may move a robot: the rules of authority, each in one file.
//!
//! * [`lease`]: who controls the robot, and until when. [`admission`]: whose messages are accepted at all.
//! * [`latch`]: stops that last until somebody resets them.
//! * [`arbitration`]: who writes the motor in this turn.
//! * [`goal`], [`assignments`], [`replies`]: a goal's life, a dispatcher's orders, and requests that repeat.
//! * [`guard`]: every rule by name, so that a test can switch one off.

pub mod admission;
pub mod arbitration;
pub mod assignments;
pub mod goal;
pub mod guard;
pub mod latch;
pub mod lease;
pub mod replies;
