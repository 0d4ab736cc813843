//! A robot's connection to the broker: made again and again, with longer and longer pauses.

use super::{BridgeCounters, count};
use rumqttc::{AsyncClient, Event, EventLoop, MqttOptions, Packet, QoS};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;

/// Messages that wait to be read by a robot's session, and to be sent by its connection.
const QUEUE: usize = 64;
/// A connection is given up after this, in s.
const CONNECTS_WITHIN_S: u64 = 5;
const FIRST_PAUSE: Duration = Duration::from_millis(200);
const LONGEST_PAUSE: Duration = Duration::from_secs(5);

/// What comes from the broker.
pub(super) enum News {
    /// It has accepted a new connection.
    Connected,
    /// The connection is lost.
    Lost,
    /// The bytes of a message, and its topic.
    Message(String, Vec<u8>),
}

/// A connection, until it is dropped.
pub(super) struct Link {
    pub(super) client: AsyncClient,
    pub(super) news: mpsc::Receiver<News>,
    polling: JoinHandle<()>,
}

impl Drop for Link {
    fn drop(&mut self) {
        self.polling.abort();
    }
}

impl Link {
    pub(super) fn open(options: MqttOptions, counters: Arc<BridgeCounters>) -> Self {
        let (client, mut events) = AsyncClient::new(options, QUEUE);
        events.network_options.set_connection_timeout(CONNECTS_WITHIN_S);
        let (sender, news) = mpsc::channel(QUEUE);
        let polling = tokio::spawn(poll(events, sender, counters));
        Self { client, news, polling }
    }

    /// Hears on these topics.
    pub(super) fn subscribe(&self, topics: [String; 2]) -> bool {
        topics.into_iter().all(|topic| self.client.try_subscribe(topic, QoS::AtLeastOnce).is_ok())
    }

    /// Says goodbye, and waits until that has left.
    pub(super) async fn close(mut self) {
        if self.client.disconnect().await.is_ok() {
            // The connection ends with what was sent before.
            while let Some(news) = self.news.recv().await {
                if matches!(news, News::Lost) {
                    return;
                }
            }
        }
    }
}

async fn poll(mut events: EventLoop, sender: mpsc::Sender<News>, counters: Arc<BridgeCounters>) {
    let (mut pause, mut said) = (FIRST_PAUSE, String::new());
    let client = events.mqtt_options.client_id();
    loop {
        let news = match events.poll().await {
            Ok(Event::Incoming(Packet::ConnAck(_))) => {
                count(&counters.connected);
                tracing::debug!("{client}: the broker has accepted the connection");
                (pause, said) = (FIRST_PAUSE, String::new());
                News::Connected
            }
            Ok(Event::Incoming(Packet::Publish(publish))) => {
                count(&counters.received);
                let message = News::Message(publish.topic, publish.payload.to_vec());
                if sender.try_send(message).is_err() {
                    count(&counters.dropped);
                }
                continue;
            }
            Ok(_) => continue,
            Err(error) => {
                let error = error.to_string();
                if said != error {
                    tracing::warn!("{client}: no connection to the broker: {error}");
                    said = error;
                }
                if sender.send(News::Lost).await.is_err() {
                    return;
                }
                tokio::time::sleep(pause).await;
                pause = (pause * 2).min(LONGEST_PAUSE);
                continue;
            }
        };
        if sender.send(news).await.is_err() {
            return;
        }
    }
}
