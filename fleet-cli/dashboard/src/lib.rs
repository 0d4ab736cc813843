//! The dashboard: a web page that shows the fleet and commands it, served from this binary.
//!
//! One page is one socket: `frames` says what it lacks, `session` when it gets that, `desk` carries
//! out what it asks for. The wire between page and server stands in `docs/dashboard.md`.

mod app;
mod assets;
mod command_session;
mod commands;
mod frames;
mod listener;
mod metrics;
mod orders;
mod places;
mod security;
mod server;
mod session;
mod socket;
pub(crate) mod teleop;

pub use app::Shown;
pub use security::Origin;
pub use server::{Running, Settings};
