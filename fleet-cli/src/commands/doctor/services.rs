//! Listens for what serves the whole fleet: dispatcher, traffic control, map.

use super::checks::Services;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use xtb_bus::{Incoming, Subscription};
use xtb_client::Result;
use xtb_client::client::Client;
use xtb_client::dispatcher_client::DispatcherClient;
use xtb_protocol::messages::{Message, TaskList, TrafficState};

/// Boots of traffic control that are told apart; there should be one.
const BOOTS: usize = 8;

/// What traffic control says twice a second, from now on.
pub(super) struct Listening {
    heard: Arc<Heard>,
    _subscription: Subscription,
}

#[derive(Default)]
struct Heard {
    services: Mutex<Services>,
    news: Notify,
}

impl Listening {
    /// Begins.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](xtb_client::ErrorKind::Failed): Zenoh would not.
    pub(super) async fn begin(client: &Client) -> Result<Self> {
        let heard = Arc::new(Heard::default());
        let into = Arc::clone(&heard);
        let each = move |incoming: Incoming| into.take(&incoming);
        let subscription = client.bus().subscribe(&client.keys().traffic_state(), each).await?;
        Ok(Self { heard, _subscription: subscription })
    }

    /// Asks dispatcher and map too. Traffic control that is present and was not heard yet is waited for.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`](xtb_client::ErrorKind::Failed): a question could not be sent.
    pub(super) async fn end(self, client: &Client, within: Duration) -> Result<Services> {
        let (bus, keys) = (client.bus(), client.keys());
        let (dispatch, traffic) = (keys.dispatch_alive(), keys.traffic_alive());
        let (dispatcher, traffic) = tokio::join!(bus.alive(&dispatch, within), bus.alive(&traffic, within));
        let (dispatcher, traffic) = (!dispatcher?.is_empty(), !traffic?.is_empty());
        let (tasks, maps) = (keys.dispatch_tasks(), keys.map());
        let (tasks, maps) = tokio::join!(client.get(&tasks), client.get(&maps));
        if traffic {
            // Who is not heard by then says nothing.
            let _ = tokio::time::timeout(within, self.heard.something()).await;
        }
        let (tasks, maps) = (read::<TaskList>(&tasks?), read(&maps?));
        // Only the first page of very many tasks is read: their number is asked for.
        let status = match tasks.iter().flatten().any(|list| list.left_out > 0) {
            true => DispatcherClient::of(client).status().await.ok().map(|status| status.dispatcher),
            false => None,
        };
        let heard = std::mem::take(&mut *self.heard.lock());
        Ok(Services { dispatcher, traffic, tasks, status, maps, ..heard })
    }
}

impl Heard {
    fn lock(&self) -> std::sync::MutexGuard<'_, Services> {
        self.services.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn take(&self, incoming: &Incoming) {
        let mut services = self.lock();
        match incoming.decode::<TrafficState>() {
            Ok(state) if services.traffic_states.len() < BOOTS => {
                services.traffic_states.insert(state.epoch, state);
            }
            Ok(_) => {}
            Err(error) => services.traffic_unreadable = Some(error.to_string()),
        }
        drop(services);
        self.news.notify_one();
    }

    async fn something(&self) {
        loop {
            {
                let services = self.lock();
                if !services.traffic_states.is_empty() || services.traffic_unreadable.is_some() {
                    return;
                }
            }
            self.news.notified().await;
        }
    }
}

fn read<M: Message>(answers: &[Incoming]) -> Vec<std::result::Result<M, String>> {
    answers.iter().map(|answer| answer.decode().map_err(|error| error.to_string())).collect()
}
