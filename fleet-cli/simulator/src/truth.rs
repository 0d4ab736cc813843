//! Ground truth: where the trucks really are, for people, tests and logs.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use tokio::task::JoinHandle;
use tokio::time::MissedTickBehavior;
use xtb_bus::Bus;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{Roster, Truth};
use xtb_sim::Simulation;

const PUBLISH_EVERY: Duration = Duration::from_millis(50);

/// The latest truth, shared.
#[derive(Debug, Clone)]
pub struct TruthView(Arc<Mutex<Truth>>);

impl TruthView {
    /// A copy of it.
    #[must_use]
    pub fn latest(&self) -> Truth {
        self.look(Truth::clone)
    }

    /// The world's time, in s.
    #[must_use]
    pub fn now_s(&self) -> f64 {
        self.look(|truth| truth.t_s)
    }

    /// Looks at it; the world waits meanwhile.
    pub(super) fn look<T>(&self, at: impl FnOnce(&Truth) -> T) -> T {
        at(&self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Sees every step of the world.
pub(super) struct Observer {
    names: Vec<Name>,
    /// The trucks' indices in the order of their names, as the view has them.
    order: Vec<usize>,
    view: TruthView,
    log: Option<BufWriter<File>>,
}

/// A view, and the observer that keeps it up to date and writes the log.
pub(super) fn view(roster: &Roster, log: Option<&Path>) -> Result<(TruthView, Observer)> {
    let names: Vec<Name> = roster.robots.iter().map(|robot| robot.name.clone()).collect();
    let mut order: Vec<usize> = (0..roster.robots.len()).collect();
    order.sort_by_key(|index| &names[*index]);
    let view = TruthView(Arc::new(Mutex::new(Truth { t_s: 0.0, real_s: None, robots: BTreeMap::new() })));
    let log = log
        .map(|path| {
            File::create(path).map(BufWriter::new).map_err(|error| {
                Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display()))
                    .hint("--truth-log needs a writable file")
            })
        })
        .transpose()?;
    Ok((view.clone(), Observer { names, order, view, log }))
}

impl Observer {
    pub(super) fn step(&mut self, simulation: &Simulation) {
        let mut truth = self.view.0.lock().unwrap_or_else(PoisonError::into_inner);
        truth.t_s = simulation.now().s();
        let trucks = simulation.trucks();
        if truth.robots.is_empty() {
            truth.robots = self.names.iter().cloned().zip(simulation.truths()).collect();
        }
        for (robot, &index) in truth.robots.values_mut().zip(&self.order) {
            *robot = trucks[index].truth();
        }
        if let Some(log) = &mut self.log {
            let written = serde_json::to_writer(&mut *log, &*truth).map_err(std::io::Error::from);
            if let Err(error) = written.and_then(|()| log.write_all(b"\n")) {
                tracing::warn!("truth log stopped: {error}");
                self.log = None;
            }
        }
    }
}

/// Publishes at 20 Hz until aborted.
pub(super) fn publish(bus: Bus, key: String, view: TruthView) -> JoinHandle<()> {
    tokio::spawn(async move {
        let publisher = match bus.publisher::<Truth>(&key, &Channel::SimTruth, Format::Json).await {
            Ok(publisher) => publisher,
            Err(error) => return tracing::warn!("cannot send ground truth: {error}"),
        };
        let (began, mut tick) = (Instant::now(), tokio::time::interval(PUBLISH_EVERY));
        tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
        loop {
            tick.tick().await;
            // Of a thousand trucks it is 200 kB.
            if !publisher.has_listeners().await {
                continue;
            }
            let truth = Truth { real_s: Some(began.elapsed().as_secs_f64()), ..view.latest() };
            if let Err(error) = publisher.put(&truth).await {
                tracing::debug!("{error}");
            }
        }
    })
}
