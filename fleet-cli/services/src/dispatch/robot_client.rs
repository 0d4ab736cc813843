//! Requests to robots: a task for each one that is on its way, so that no robot waits for another.

use super::DispatcherCounters;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;
use tokio::sync::mpsc;
use xtb_bus::Bus;
use xtb_client::client::Client;
use xtb_protocol::Name;
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{About, Reply, Request};

/// Requests to one robot on their way at most; the dispatcher asks again for what is dropped.
const ON_THEIR_WAY: usize = 16;
/// Answers that wait to be read: as many as may be under way to some hundred robots.
const NEWS: usize = 2048;
/// An answer is waited for this long; the same request is asked again before that.
const ANSWER_WITHIN: Duration = Duration::from_secs(1);

/// A factsheet that does not come is asked for again so often, and this much later.
const FACTSHEET_TRIES: u32 = 5;
const FACTSHEET_AGAIN: Duration = Duration::from_secs(2);

/// What a robot answered.
pub(super) enum News {
    /// To a request.
    Replied(Name, Box<Reply>),
    /// What it can do, and what it is.
    Met(Name, Box<About>),
}

/// The robots, to be asked.
pub(super) struct Fleet {
    client: Client,
    me: Name,
    on_their_way: BTreeMap<Name, Arc<AtomicUsize>>,
    news: mpsc::Sender<News>,
}

impl Fleet {
    /// Nobody has been asked yet.
    pub(super) fn new(client: &Client, me: Name) -> (Self, mpsc::Receiver<News>) {
        let (news, queue) = mpsc::channel(NEWS);
        (Self { client: client.clone(), me, on_their_way: BTreeMap::new(), news }, queue)
    }

    /// Sends a request; the answer comes as news.
    pub(super) fn ask(&mut self, robot: Name, request: Request, counters: &mut DispatcherCounters) {
        let on_its_way = self.on_their_way.entry(robot.clone()).or_default().clone();
        if on_its_way.fetch_add(1, Ordering::Relaxed) >= ON_THEIR_WAY {
            on_its_way.fetch_sub(1, Ordering::Relaxed);
            counters.ask_dropped += 1;
            return;
        }
        counters.asked += 1;
        let (bus, keys) = (self.client.bus().clone(), self.client.keys().clone());
        let (me, news) = (self.me.clone(), self.news.clone());
        tokio::spawn(async move {
            if let Some(reply) = answer(&bus, &keys, &robot, &me, &request).await {
                // No room: as if it had not been answered.
                let _ = news.try_send(News::Replied(robot, Box::new(reply)));
            }
            on_its_way.fetch_sub(1, Ordering::Relaxed);
        });
    }

    /// Asks a robot that has come what it can do, and what car it is.
    pub(super) fn meet(&self, robot: Name) {
        let (client, news) = (self.client.clone(), self.news.clone());
        tokio::spawn(async move {
            for _ in 0..FACTSHEET_TRIES {
                match client.about(&robot).await {
                    Ok(Some(about)) => return drop(news.try_send(News::Met(robot, Box::new(about)))),
                    Ok(None) => tracing::debug!("no factsheet from {robot}"),
                    Err(failure) => tracing::debug!("{robot}: {failure}"),
                }
                tokio::time::sleep(FACTSHEET_AGAIN).await;
            }
        });
    }
}

async fn answer(bus: &Bus, keys: &FleetKeys, robot: &Name, me: &Name, request: &Request) -> Option<Reply> {
    match bus.ask(&keys.robot(robot), me, request, ANSWER_WITHIN).await {
        Ok(reply) => reply,
        Err(error) => {
            tracing::debug!("{robot}: {error}");
            None
        }
    }
}
