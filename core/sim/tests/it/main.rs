//! The simulated truck from outside: bytes in, bytes and truth out.

#![allow(clippy::unwrap_used)]

mod agent;
mod calibration;
mod closed_loop;
mod contacts;
mod determinism;
mod faults;
mod motion;
mod platform;
mod remote;
mod sensors;
mod worlds;
