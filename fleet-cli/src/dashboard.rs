//! The dashboard: a web page that shows the fleet and commands it, served from this binary.
//!
//! The wire between page and server stands in `docs/dashboard.md`.

mod assets;
mod commands;
mod frames;
mod server;
mod session;
mod socket;
mod teleop;

pub use server::Running;
