//! How fast the world really runs: measured here, published and answered for everybody, and told to
//! whoever runs the simulator.

use robot_agent::clock::WorldTime;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::watch;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, Service};
use xtb_client::Result;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::SimStats;
use xtb_sim::{Pace, RealTimeMeter};

/// Between two looks at both clocks.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Every so many looks it is published, and at each change.
const PUBLISH_EVERY: u32 = 5;

/// The latest of it, and whether the world is behind.
#[derive(Debug, Clone, Copy)]
pub struct LatestStats {
    /// As it is published.
    pub stats: SimStats,
    /// The last change; `None` = it has always been in time.
    pub pace: Option<Pace>,
}

/// Measures until it is dropped.
pub(super) struct StatsService {
    told: watch::Receiver<LatestStats>,
    measuring: JoinHandle<()>,
    _answering: Service,
}

impl StatsService {
    /// Begins. `first` is the number of the first robot, where others have the rest of the fleet.
    ///
    /// # Errors
    /// Zenoh would not.
    pub(super) async fn start(
        bus: &Bus,
        keys: &FleetKeys,
        world: Arc<WorldTime>,
        speed: f64,
        first: Option<u32>,
    ) -> Result<Self> {
        let stats = SimStats { t_s: world.now().s(), speed, real_time_factor: None, first };
        let (tell, told) = watch::channel(LatestStats { stats, pace: None });
        let key = keys.sim_stats();
        let publisher = bus.publisher::<SimStats>(&key, &Channel::SimStats, Format::Json).await?;
        let answering = answer(bus, key, told.clone()).await?;
        let measuring = tokio::spawn(async move {
            let (began, mut meter) = (Instant::now(), RealTimeMeter::new(speed));
            let mut tick = tokio::time::interval(LOOK_EVERY);
            tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
            for look in 0_u32.. {
                tick.tick().await;
                let now = world.now();
                let change = meter.moment(began.elapsed(), now);
                let stats = SimStats { t_s: now.s(), real_time_factor: meter.factor(), ..stats };
                tell.send_modify(|told| *told = LatestStats { stats, pace: change.or(told.pace) });
                if (look.is_multiple_of(PUBLISH_EVERY) || change.is_some())
                    && let Err(error) = publisher.put(&stats).await
                {
                    tracing::debug!("{error}");
                }
            }
        });
        Ok(Self { told, measuring, _answering: answering })
    }

    /// Follows it.
    pub(super) fn told(&self) -> watch::Receiver<LatestStats> {
        self.told.clone()
    }
}

impl Drop for StatsService {
    fn drop(&mut self) {
        self.measuring.abort();
    }
}

async fn answer(bus: &Bus, key: String, told: watch::Receiver<LatestStats>) -> Result<Service> {
    let runtime = tokio::runtime::Handle::current();
    let own_key = key.clone();
    let service = bus.serve(&key, move |question| {
        let (own_key, stats) = (own_key.clone(), told.borrow().stats);
        runtime.spawn(async move {
            if let Err(error) = question.reply(&own_key, &stats, Format::Json).await {
                tracing::debug!("cannot send the simulator's statistics: {error}");
            }
        });
    });
    Ok(service.await?)
}
