//! The dashboard: a web page that shows the fleet and commands it, served from this binary.
//!
//! One page is one socket: `frames` says what it lacks, `session` when it gets that, `command_session` carries
//! out what it asks for. The wire between page and server stands in `docs/dashboard.md`.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod access;
mod app;
mod assets;
mod command_session;
mod commands;
mod execute;
mod files;
#[cfg(feature = "foxglove")]
pub mod foxglove;
mod frames;
mod guesses;
mod hello;
mod listener;
mod metrics;
mod orders;
mod people;
mod places;
mod playback;
mod playback_routes;
mod security;
mod server;
mod session;
mod sign_in;
mod socket;
mod teleop;
mod teleop_session;
mod tls;

pub use app::Shown;
pub use playback::{Playback, PlaybackPosition};
pub use security::Origin;
pub use server::{Running, ServerSettings};
pub use tls::Secure;
