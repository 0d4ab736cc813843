//! A page's hand on a robot's wheel: takes control, passes setpoints on, lets go.
//!
//! Every way out ends in zero and gives control back: the page's word, a closed socket, silence, an
//! error. If this program is gone altogether, the robot's own clock ends the last setpoint.

use crate::teleop::{DeadMan, Hand};
use std::time::Duration;
use tokio::sync::{oneshot, watch};
use tokio::time::MissedTickBehavior;
use xtb_client::client::Client;
use xtb_client::control::Control;
use xtb_client::state_feed::StateFeed;
use xtb_client::teleop::{CAUTIOUS_RPM, StickPosition, TeleopSession, lost};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;

/// How often it is looked whether control is lost, or nobody has had a hand on the wheel for long.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// A hand and how old the picture was that it acted on, in ms; `None` = nobody knows.
pub(crate) type Steered = (Hand, Option<u64>);

/// Control of a robot, ready to drive.
pub(crate) struct PageSession {
    client: Client,
    robot: Name,
    control: Control,
    feed: StateFeed,
    max_rpm: f64,
}

impl PageSession {
    /// Takes control.
    ///
    /// # Errors
    /// As [`Control::acquire`].
    pub(crate) async fn take(client: &Client, robot: Name, take: bool) -> Result<Self> {
        let feed = StateFeed::open(client, &client.keys().robot(&robot)).await?;
        let control = Control::acquire(client, &robot, take).await?;
        let about = client.about(&robot).await;
        let max_rpm = about.ok().flatten().map_or(CAUTIOUS_RPM, |about| about.limits.max_rpm);
        Ok(Self { client: client.clone(), robot, control, feed, max_rpm })
    }

    /// From whom control was taken.
    pub(crate) fn taken_from(&self) -> Option<&str> {
        self.control.taken_from()
    }

    /// Gives control back without having driven.
    pub(crate) async fn leave(self) {
        self.control.release().await;
    }

    /// Passes each hand on once, as soon as it comes, until `end` is said or dropped; then says why it
    /// has ended.
    pub(crate) async fn drive(
        self,
        mut hands: watch::Receiver<Option<Steered>>,
        mut end: oneshot::Receiver<()>,
    ) -> Option<String> {
        let Self { client, robot, control, feed, max_rpm } = self;
        let mut wheel = TeleopSession::new(&client, &control, &robot, max_rpm);
        let mut dead_man = DeadMan::new(ms(&client));
        let mut look = tokio::time::interval(LOOK_EVERY);
        look.set_missed_tick_behavior(MissedTickBehavior::Skip);
        let why = loop {
            tokio::select! {
                biased;
                _ = &mut end => break None,
                changed = hands.changed() => {
                    if changed.is_err() {
                        break None;
                    }
                    let steered = *hands.borrow_and_update();
                    let drive = steered.and_then(|(hand, age_ms)| dead_man.hand(ms(&client), hand, age_ms));
                    let Some((throttle, steering)) = drive else { continue };
                    if let Err(failure) = wheel.send(StickPosition { throttle, steering }, &feed).await {
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
                    if let Some(failure) = dead_man.is_idle(ms(&client)).then(idle) {
                        break Some(failure);
                    }
                }
            }
        };
        wheel.let_go(&feed).await;
        control.release().await;
        why.map(|failure| failure.to_string())
    }
}

fn ms(client: &Client) -> u64 {
    client.now().ns() / 1_000_000
}

fn idle() -> Error {
    let message = "no input for 30 s";
    Error::new(ErrorKind::Idle, message)
}
