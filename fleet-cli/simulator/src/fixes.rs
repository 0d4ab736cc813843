//! Pose fixes for the simulated robots, as a tracker in the ceiling would send them.

use super::TruthView;
use std::time::Duration;
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::{Bus, Publisher};
use xtb_control::Stamp;
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{Fix, Roster, Truth};
use xtb_sim::fixes::{FixMaker, FixTruth};

/// The truth is looked at this often.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Publishes fixes of every robot until aborted; none with a rate of 0.
pub(super) fn publish(
    bus: Bus,
    keys: FleetKeys,
    roster: &Roster,
    truth: TruthView,
    settings: &FixTruth,
    seed: u64,
) -> JoinHandle<()> {
    let names: Vec<_> = roster.robots.iter().map(|robot| robot.name.clone()).collect();
    let makers = (0..names.len()).map(|truck| FixMaker::new(settings.clone(), seed, truck));
    let mut makers: Vec<FixMaker> = makers.collect();
    let wanted = settings.rate_hz > 0.0;
    tokio::spawn(async move {
        if !wanted {
            return;
        }
        let mut publishers: Vec<Publisher<Fix>> = Vec::with_capacity(names.len());
        for name in &names {
            match bus.publisher::<Fix>(&keys.robot(name).fix(), &Channel::Fix, Format::Postcard).await {
                Ok(publisher) => publishers.push(publisher),
                Err(error) => return tracing::warn!("cannot send pose fixes: {error}"),
            }
        }
        let mut tick = tokio::time::interval(LOOK_EVERY);
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            tick.tick().await;
            let made = truth.look(|latest| make(latest, &names, &mut makers));
            for (truck, fix) in made {
                if let Err(error) = publishers[truck].put(&fix).await {
                    tracing::debug!("{error}");
                }
            }
        }
    })
}

/// What is due by now, with the number of its truck.
fn make(latest: &Truth, names: &[Name], makers: &mut [FixMaker]) -> Vec<(usize, Fix)> {
    let now = Stamp::from_s(latest.t_s);
    let mut made = Vec::new();
    for (number, (name, maker)) in names.iter().zip(makers).enumerate() {
        let Some(truck) = latest.robots.get(name) else { continue };
        maker.step(now, truck);
        while let Some(fix) = maker.take(now) {
            made.push((number, fix.message(now)));
        }
    }
    made
}
