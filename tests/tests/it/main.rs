//! End to end over real Zenoh: a module a topic.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod cockpit;
mod commands;
mod dispatch;
mod driving;
mod fetching;
mod fuzz;
mod guide;
mod hardware;
mod hostile;
mod membership;
mod obstacles;
mod operators;
mod processes;
mod recording;
mod style;
mod teleop;
mod traffic;
