//! The simulated truck from outside: bytes in, bytes and truth out.

#![allow(clippy::unwrap_used)]

mod agent;
mod closed_loop;
mod contacts;
mod determinism;
mod motion;
mod sensors;
mod worlds;
