//! The grammar of the dashboard.

use crate::dashboard::Origin;
use clap::Args;
use std::net::{IpAddr, SocketAddr};

const DASHBOARD_HELP: &str = "\
Another address than 127.0.0.1 needs a token: whoever gets in may drive robots. What travels can be read and \
changed on its way unless a proxy with TLS stands in front (--allow-origin names its address).

Examples:
  fleet-cli dashboard
  fleet-cli dashboard --listen 0.0.0.0:8080 --token \"$(openssl rand -hex 16)\"
  fleet-cli dashboard --allow-origin https://fleet.example";

/// Arguments of `dashboard`.
#[derive(Debug, Clone, Args)]
#[command(after_help = DASHBOARD_HELP)]
pub struct DashboardArgs {
    /// Where to listen; port 0 takes a free one.
    #[arg(long, value_name = "ADDRESS", default_value = "127.0.0.1:8080", value_parser = address)]
    pub listen: SocketAddr,
    /// Who does not know it stays out; 16 characters or more. In the environment nobody else sees it.
    #[arg(long, env = "XTB_DASHBOARD_TOKEN", value_name = "TOKEN", hide_env_values = true)]
    pub token: Option<String>,
    /// Show only: no page can command anything.
    #[arg(long)]
    pub read_only: bool,
    /// Where the page is seen from outside, such as behind a proxy; several: repeat it.
    #[arg(long, value_name = "URL")]
    pub allow_origin: Vec<Origin>,
    /// A proxy in front, on another machine: as many people come from its address; several: repeat it.
    #[arg(long, value_name = "IP")]
    pub proxy: Vec<IpAddr>,
    /// Frames a second at most.
    #[arg(long, value_name = "HZ", default_value_t = HZ, value_parser = rate)]
    pub hz: f64,
    /// Serve the live scene for the Foxglove app too [default: 127.0.0.1:8765].
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
