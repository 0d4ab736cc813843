//! A dispatcher in a simulator's process: what `sim --dispatch` and `demo` run beside their robots.

use crate::config;
use crate::context::Context;
use crate::output::{Output, Tone};
use crate::table::{Table, TableCell};
use std::time::Duration;
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::fleet_view::by_number;
use xtb_dispatch::HomeRules;
use xtb_services::alert_outlets::OutletSettings;
use xtb_services::dispatch::store::Store;
use xtb_services::dispatch::usage::Usage;
use xtb_services::dispatch::{DispatchService, Floor, ObserverSettings, Standing};
use xtb_simulator::Simulator;

/// It is looked this often whether all is done.
const LOOK_EVERY: Duration = Duration::from_millis(500);

/// A dispatcher and its session.
pub(crate) struct EmbeddedDispatcher {
    client: Client,
    service: DispatchService,
}

impl EmbeddedDispatcher {
    /// Starts it on the simulator's router.
    ///
    /// # Errors
    /// As [`DispatchService::start`].
    pub(crate) async fn start(
        ctx: &Context,
        simulator: &Simulator,
        store: Store,
        home: Option<HomeRules>,
    ) -> Result<Self> {
        let robots = simulator.roster().robots.clone();
        let own = ctx
            .with(|settings| (settings.connect, settings.robots) = (simulator.endpoints().to_vec(), robots));
        let client = Client::open(&own.settings).await?;
        // A simulation calls nobody.
        let outlets = OutletSettings::default();
        let observer = ObserverSettings { outlets, ..config::observer(&ctx.observer.0, ctx.observer.1)? };
        let floor = Floor { own: simulator.maps(), home };
        let service = DispatchService::start(&client, store, floor, observer, ctx.settings.timeout).await?;
        Ok(Self { client, service })
    }

    /// How it stands.
    #[must_use]
    pub(crate) fn standing(&self) -> Standing {
        self.service.standing()
    }

    /// Resolves when it has ended by itself.
    pub(crate) async fn ended(&mut self) -> xtb_client::Error {
        self.service.ended().await
    }

    /// Resolves once there were tasks and all have ended, also those that no robot ever had.
    ///
    /// # Errors
    /// It has ended by itself.
    pub(crate) async fn until_done(&mut self) -> Result<()> {
        let mut look = tokio::time::interval(LOOK_EVERY);
        let mut any = false;
        loop {
            tokio::select! {
                failure = self.service.ended() => return Err(failure),
                _ = look.tick() => {
                    let Standing { status, usage, .. } = self.service.standing();
                    let open = status.open;
                    any |= open > 0 || usage.ended > 0;
                    if any && open == 0 {
                        return Ok(());
                    }
                }
            }
        }
    }

    /// Ends it before its robots end.
    ///
    /// # Errors
    /// As [`DispatchService::stop`].
    pub(crate) async fn stop(self) -> Result<Standing> {
        let standing = self.service.stop().await;
        self.client.close().await;
        standing
    }
}

/// What each robot did, as a table.
#[must_use]
pub(crate) fn table(out: &Output, usage: &Usage) -> String {
    let mut table = Table::new(&["robot", "done", "failed", "distance", "busy", "waiting", "idle", "used"]);
    let mut robots: Vec<_> = usage.robots.iter().collect();
    robots.sort_by_cached_key(|(robot, _)| by_number(robot));
    for (robot, spent) in robots {
        let whole_s = spent.busy_s + spent.waiting_s + spent.idle_s;
        let used = if whole_s > 0.0 { 100.0 * spent.busy_s / whole_s } else { 0.0 };
        let failed = if spent.failed > 0 { Tone::Bad } else { Tone::Plain };
        table.row(vec![
            TableCell::new(robot.as_str(), Tone::Strong),
            spent.done.to_string().into(),
            TableCell::new(spent.failed.to_string(), failed),
            format!("{:.1} m", spent.distance_m).into(),
            format!("{:.0} s", spent.busy_s).into(),
            format!("{:.0} s", spent.waiting_s).into(),
            format!("{:.0} s", spent.idle_s).into(),
            format!("{used:.0} %").into(),
        ]);
    }
    table.render(out)
}
