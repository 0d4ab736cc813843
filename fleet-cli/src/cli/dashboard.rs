//! The grammar of the dashboard.

use crate::dashboard::Origin;
use clap::Args;
use std::net::{IpAddr, SocketAddr};

const DASHBOARD_HELP: &str = "\
Any address other than 127.0.0.1 needs a token: everyone with access can drive robots. The connection is not \
encrypted; to encrypt it, use a proxy with TLS (--allow-origin gives its address).

Examples:
  fleet-cli dashboard
  fleet-cli dashboard --listen 0.0.0.0:8080 --token \"$(openssl rand -hex 16)\"
  fleet-cli dashboard --allow-origin https://fleet.example";

/// Arguments of `dashboard`.
#[derive(Debug, Clone, Args)]
#[command(after_help = DASHBOARD_HELP)]
pub struct DashboardArgs {
    /// Address to listen on; port 0 picks a free port.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = address)]
    pub listen: SocketAddr,
    /// Access token (at least 16 characters). Safer in the environment, where other users cannot see it.
    #[arg(long, env = "XTB_DASHBOARD_TOKEN", value_name = "TOKEN", hide_env_values = true)]
    pub token: Option<String>,
    /// View only: no page can send commands.
    #[arg(long)]
    pub read_only: bool,
    /// Address of the page as browsers see it, such as behind a proxy; for several, repeat it.
    #[arg(long, value_name = "URL")]
    pub allow_origin: Vec<Origin>,
    /// Address of a proxy on another machine: the limit on connections per address does not apply to it; for
    /// several, repeat it.
    #[arg(long, value_name = "IP")]
    pub proxy: Vec<IpAddr>,
    /// Maximum frames per second.
    #[arg(long, value_name = "HZ", default_value_t = HZ, value_parser = rate)]
    pub hz: f64,
    /// Also serve the live scene for the Foxglove app [default: 127.0.0.1:8765].
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8765", value_parser = address)]
    pub foxglove: Option<SocketAddr>,
}

/// Times a second that a page gets a frame, if nobody says otherwise.
const HZ: f64 = 20.0;

impl DashboardArgs {
    /// Everything as it is by default, but for the address.
    #[must_use]
    pub fn at(listen: SocketAddr) -> Self {
        let (allow_origin, proxy) = (Vec::new(), Vec::new());
        Self { listen, token: None, read_only: false, allow_origin, proxy, hz: HZ, foxglove: None }
    }
}

pub(super) fn address(text: &str) -> Result<SocketAddr, String> {
    let numbers = text.replacen("localhost:", "127.0.0.1:", 1);
    numbers.parse().map_err(|_| "expected IP:PORT, such as 127.0.0.1:8080 or 0.0.0.0:8080".to_owned())
}

/// Driving by hand needs a picture that is not older than 300 ms.
fn rate(text: &str) -> Result<f64, String> {
    super::values::number(text, 5.0, 20.0, "Hz")
}
