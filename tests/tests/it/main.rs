//! End to end over real Zenoh: a module a topic.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

mod alerts;
mod attacker;
mod board_firmware;
mod circles;
mod cockpit;
mod commands;
mod dashboard;
mod dispatch;
mod driving;
mod enrolment;
mod fetching;
mod fleet_recording;
mod foreign_files;
#[cfg(feature = "foxglove")]
mod foxglove;
mod fuzz;
mod hardware;
mod homes;
mod hostile;
mod huge_messages;
mod identities;
mod json;
mod keys;
mod logs;
mod membership;
mod nearby;
mod obstacles;
mod operators;
mod params;
mod processes;
mod python;
#[cfg(target_os = "linux")]
mod realtime;
mod recording;
mod ros2;
mod schemas;
mod shared_world;
mod simulator;
mod slow_links;
mod standby;
mod style;
mod tasks;
mod teleop;
mod terminal;
mod traffic;
mod vda5050;
