//! The first-level controller of TM 2004-262, *The eXtreme Test Bed vehicle for indoor environments*.
//!
//! On the path of a sample (docs/paths.md): samples come in with their stamps, everything decided goes
//! out as [`Outputs`]. Pure: no clock, no file, no socket, no thread, no allocation in a step.
//! Start reading at [`controller`].

pub mod balance;
pub mod bumper;
pub mod calibration;
pub mod config;
pub mod controller;
pub mod frames;
pub mod goto;
pub mod gp2d12;
pub mod infrared;
pub mod obstacle;
pub mod odometry;
pub mod pid;
pub mod pistons;
pub mod platform_pid;
pub mod range_curve;
pub mod remote;
pub mod signals;
pub mod speed;
pub mod tilt;
pub mod tpu;
pub mod units;
mod validate;
pub mod vehicle;
pub mod wander;

pub use controller::{Command, Controller, Mode, Outputs, Sample};
pub use units::{AdcCount, Heading, PwmCount, Stamp, Steering, WheelRpm};
pub use vehicle::VehicleConfig;
