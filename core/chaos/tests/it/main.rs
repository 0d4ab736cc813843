//! Many robots: bad days, meetings, corridors, tasks.

#![allow(clippy::unwrap_used)]

#[allow(dead_code)] // the simulator's own tests use all of it
#[path = "../../../sim/tests/it/any_car.rs"]
mod any_car;
#[path = "../../../sim/tests/it/draw.rs"]
mod draw;
#[path = "../../../sim/tests/it/drive.rs"]
#[allow(dead_code)] // the simulator's own tests use all of it
mod drive;

mod corridors;
mod days;
mod dispatched;
mod doubts;
mod giveway;
mod lifelong;
mod meetings;
mod rooms;
mod together;
mod unattended;
mod vehicles;
mod wandering;
