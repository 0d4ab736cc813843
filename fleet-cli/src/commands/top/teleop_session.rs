//! The hand at a robot's wheel, beside the screen. As in `teleop`, every way out ends in zero, a stop and
//! a lease that is given back; and a screen that hangs is silence, which the robot's own clock ends.

use super::execute::is_held;
use crate::commands::teleop::ticks;
use crate::tui::top::TeleopStatus;
use std::time::{Duration, Instant};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinHandle;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::state_feed::StateFeed;
use xtb_client::teleop::{CAUTIOUS_RPM, SEND_EVERY, StickPosition, TeleopSession, lost};
use xtb_client::{Error, Result};
use xtb_protocol::Name;

/// A setpoint that waited longer for the line is not sent any more.
const FRESH: Duration = Duration::from_millis(100);

/// What to send once; the latest wins.
type Order = Option<(Instant, StickPosition)>;

/// A robot whose wheel was asked for.
pub(super) struct Hand {
    /// `None` = let go.
    orders: Option<watch::Sender<Order>>,
    held: mpsc::Receiver<f64>,
    steering: JoinHandle<TeleopStatus>,
}

impl Hand {
    /// Asks for control, beside the screen.
    pub(super) fn take(client: Client, robot: Name, take: bool) -> Self {
        let (orders, waiting) = watch::channel(None);
        let (holding, held) = mpsc::channel(1);
        let steering = tokio::spawn(async move {
            let begun = begin(&client, &robot, take).await;
            match begun {
                Ok(begun) => steer(&client, &robot, begun, waiting, &holding).await,
                Err(failure) => TeleopStatus::Refused { held: is_held(&failure), text: failure.to_string() },
            }
        });
        Self { orders: Some(orders), held, steering }
    }

    /// Sends this once.
    pub(super) fn drive(&self, drive: StickPosition) {
        if let Some(orders) = &self.orders {
            orders.send_replace(Some((Instant::now(), drive)));
        }
    }

    /// Zero, stop, and give the lease back.
    pub(super) fn let_go(&mut self) {
        self.orders = None;
    }
}

/// What becomes of the hand; it is gone once that is its end.
pub(super) async fn news(hand: &mut Option<Hand>) -> TeleopStatus {
    let Some(at_wheel) = hand else { return std::future::pending().await };
    let ended = tokio::select! {
        Some(max_rpm) = at_wheel.held.recv() => return TeleopStatus::Held { max_rpm },
        ended = &mut at_wheel.steering => ended,
    };
    *hand = None;
    ended.unwrap_or_else(|error| TeleopStatus::Lost(format!("internal error ({error})")))
}

async fn begin(client: &Client, robot: &Name, take: bool) -> Result<(Control, StateFeed, f64)> {
    let control = Control::acquire(client, robot, take).await?;
    let rest = async {
        let limit = client.about(robot).await?.map_or(CAUTIOUS_RPM, |about| about.limits.max_rpm);
        Ok::<_, Error>((StateFeed::open(client, &client.keys().robot(robot)).await?, limit))
    };
    match rest.await {
        Ok((feed, limit)) => Ok((control, feed, limit)),
        Err(failure) => {
            control.release().await;
            Err(failure)
        }
    }
}

async fn steer(
    client: &Client,
    robot: &Name,
    (control, feed, max_rpm): (Control, StateFeed, f64),
    mut orders: watch::Receiver<Order>,
    holding: &mpsc::Sender<f64>,
) -> TeleopStatus {
    let mut wheel = TeleopSession::new(client, &control, robot, max_rpm);
    let mut look = ticks(SEND_EVERY);
    // There is room: it is the only message.
    let _ = holding.try_send(max_rpm);
    let broken = loop {
        tokio::select! {
            ordered = orders.changed() => {
                if ordered.is_err() {
                    break None;
                }
                let order = *orders.borrow_and_update();
                let order = order.filter(|(at, _)| at.elapsed() <= FRESH);
                if let Some((_, drive)) = order
                    && let Err(failure) = wheel.send(drive, &feed).await
                {
                    break Some(failure);
                }
            }
            _ = look.tick() => {
                if let Some(failure) = control.lost() {
                    break Some(lost(&wheel, &feed, failure));
                }
                if let Some(failure) = wheel.given_up(&feed) {
                    break Some(failure);
                }
            }
        }
    };
    let stopped = wheel.let_go(&feed).await;
    control.release().await;
    match broken {
        None => TeleopStatus::Ended(stopped),
        Some(failure) => TeleopStatus::Lost(failure.to_string()),
    }
}

#[cfg(test)]
mod tests;
