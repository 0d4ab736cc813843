//! The grammar of the dashboard.

use clap::Args;
use std::net::SocketAddr;

/// Arguments of `dashboard`.
#[derive(Debug, Clone, Args)]
pub struct DashboardArgs {
    /// Where to listen; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080")]
    pub listen: SocketAddr,
    /// Frames a second at most.
    #[arg(long, value_name = "HZ", default_value_t = 20.0, value_parser = rate)]
    pub hz: f64,
}

fn rate(text: &str) -> Result<f64, String> {
    super::number(text, 1.0, 20.0, "Hz")
}
