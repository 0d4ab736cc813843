//! Many robots: bad days, meetings, corridors, tasks.

#![allow(clippy::unwrap_used)]

#[path = "../../../sim/tests/it/draw.rs"]
mod draw;
#[path = "../../../sim/tests/it/drive.rs"]
#[allow(dead_code)] // the simulator's own tests use all of it
mod drive;

mod corridors;
mod days;
mod dispatched;
mod giveway;
mod lifelong;
mod meetings;
mod rooms;
mod together;
mod wandering;
