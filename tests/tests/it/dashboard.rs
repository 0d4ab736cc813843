//! The dashboard's server as pages meet it: over real sockets, a real router and simulated robots.

#![allow(clippy::print_stderr)] // measured figures, for whoever runs it with --nocapture

mod commands;
mod driving;
mod entry;
mod page;
mod secure;
mod slow;
mod stalled;

use fleet_cli::context::Context;
use fleet_tests::processes::{Process, Signal, program};
use fleet_tests::{Fleet, PATIENCE, Setup, eventually, name};
use page::Page;
use std::sync::Arc;
use xtb_client::Client;
use xtb_client::scene::live::{Live, Wanted};
use xtb_dashboard::{Running, ServerSettings, Shown};

/// A dashboard in this process, and the fleet that it shows.
struct Rig {
    fleet: Fleet,
    dashboard: Running,
    client: Client,
    _live: Live,
}

impl Rig {
    async fn start(setup: Setup) -> Self {
        Self::with(setup, |_| {}).await
    }

    async fn with(setup: Setup, change: impl FnOnce(&mut ServerSettings)) -> Self {
        let fleet = Fleet::start(setup).await;
        let settings = xtb_client::Settings {
            identity: None,
            connect: vec![fleet.simulator.endpoint().to_owned()],
            fleet: name("lab"),
            client: name("dashboard"),
            timeout: PATIENCE,
            robots: Vec::new(),
            aliases: Default::default(),
        };
        let ctx = Context {
            settings,
            connect_given: true,
            home: None,
            observer: Default::default(),
            out: fleet_cli::Output { json: true, colors: false },
        };
        let client = Client::open(&ctx.settings).await.unwrap();
        let live = Live::open(&client, Wanted { sensors: true, truth: false }).await.unwrap();
        let mut settings = ServerSettings {
            listen: "127.0.0.1:0".parse().unwrap(),
            secure: None,
            token: None,
            insecure: false,
            read_only: false,
            allow_origins: Vec::new(),
            proxies: Vec::new(),
            hz: 20.0,
        };
        change(&mut settings);
        let shown = Shown { scene: Arc::clone(&live.scene), commands: Some(client.clone()), playback: None };
        let dashboard = Running::start(settings, shown).await.unwrap();
        Self { fleet, dashboard, client, _live: live }
    }

    /// A page that sees its robots.
    async fn page(&self) -> Page {
        let mut page = Page::open(self.dashboard.address()).await;
        let robots = self.fleet.simulator.truth().latest().robots.len();
        page.until("the robots", |page| {
            let fresh = page.rows().filter(|row| row["stale"] == false && row["alive"] == true).count();
            (fresh == robots).then_some(())
        })
        .await;
        page
    }

    async fn end(self) {
        self.dashboard.stop().await;
        self.client.close().await;
        self.fleet.end().await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_simulation_serves_the_page_of_its_own_robots() {
    let mut sim = std::process::Command::new(program("fleet-cli"));
    sim.args(["--json", "sim", "--robots", "2", "--listen", "tcp/127.0.0.1:0", "--dashboard", "127.0.0.1:0"]);
    let (mut sim, lines) = Process::start_lines(&mut sim, 2);
    let ready: serde_json::Value = serde_json::from_str(&lines[1]).unwrap();
    let mut page = Page::open(ready["address"].as_str().unwrap().parse().unwrap()).await;
    page.until("both robots", |page| (page.rows().count() == 2).then_some(())).await;
    sim.signal(Signal::Interrupt);
    eventually("the simulation ends", || std::future::ready((!sim.runs()).then_some(()))).await;
}
