//! Limits that no input and no valid configuration breaks, stage by stage, then the whole controller.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod any;
mod bumpers;
mod follow;
mod goto;
mod infrared;
mod obstacle;
mod odometry;
mod platform;
mod remote;
mod speed;
mod tpu;
mod wander;
mod whole;
