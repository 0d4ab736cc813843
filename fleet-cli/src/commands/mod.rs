//! One verb a file.

pub mod completions;
pub mod demo;
mod goal;
pub mod goto;
pub mod list;
pub mod router;
pub mod sim;
pub mod status;
pub mod stop;
pub mod teleop;
pub mod wander;
pub mod watch;
