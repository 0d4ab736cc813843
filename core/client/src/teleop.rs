//! Driving by hand: setpoints for one robot, hold-to-run.
//!
//! Every way out ends in zero: [`TeleopSession::let_go`] on this side; silence for 200 ms on the robot's own
//! clock if this side is gone altogether. Screen, cockpit and page send through here; which keys or fingers
//! make a setpoint is theirs.

mod lateness;

use crate::client::Client;
use crate::control::Control;
use crate::error::{Error, ErrorKind, Result};
use crate::state_feed::StateFeed;
use lateness::Lateness;
use std::time::Duration;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{Body, Setpoint};
use xtb_protocol::{Name, Uuid};

/// Setpoints are sent at 20 Hz.
pub const SEND_EVERY: Duration = Duration::from_millis(50);
/// Full throttle at most, in rpm, if the robot does not say what it accepts.
pub const CAUTIOUS_RPM: f64 = 20.0;
/// A session whose setpoints have all come too late for this long ends and says so.
const REFUSED_MOST_MS: u64 = 2_000;

/// Where the hand is.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StickPosition {
    /// −1..=1, + = ahead.
    pub throttle: f64,
    /// −1..=1, + = right.
    pub steering: f64,
}

/// Somebody else took control: what is said of it.
pub fn lost(session: &TeleopSession<'_>, feed: &StateFeed, failure: Error) -> Error {
    let Some(message) = session.control.taken_by(feed) else { return failure };
    Error { message, ..failure }.hint("use `fleet-cli teleop … --take` to take control again")
}

/// A robot under control, and how many setpoints it was sent.
pub struct TeleopSession<'a> {
    /// The session with the fleet.
    pub client: &'a Client,
    /// Control of the robot.
    pub control: &'a Control,
    /// Which robot.
    pub robot: &'a Name,
    /// Full throttle.
    pub max_rpm: f64,
    /// Setpoints that were sent.
    pub sent: u64,
    late: Lateness,
}

impl<'a> TeleopSession<'a> {
    /// Nothing sent yet.
    pub fn new(client: &'a Client, control: &'a Control, robot: &'a Name, max_rpm: f64) -> Self {
        Self { client, control, robot, max_rpm, sent: 0, late: Lateness::default() }
    }

    /// Why the robot takes no setpoint of this link, if it takes none or the link is known to be too slow.
    pub fn refused(&mut self, feed: &StateFeed) -> Option<String> {
        let round_trip = self.client.round_trip().smoothed();
        let late = self.late_for_ms(feed).is_some() || lateness::is_too_long(round_trip);
        late.then(|| lateness::words(self.robot, round_trip))
    }

    /// The same, once it has taken none for long.
    pub fn given_up(&mut self, feed: &StateFeed) -> Option<Error> {
        let long = self.late_for_ms(feed).is_some_and(|ms| ms > REFUSED_MOST_MS);
        let words = || lateness::words(self.robot, self.client.round_trip().smoothed());
        long.then(|| Error::new(ErrorKind::Failed, words()))
    }

    fn late_for_ms(&mut self, feed: &StateFeed) -> Option<u64> {
        let now_ms = self.client.now().ms();
        if let Some(seen) = feed.last(self.robot) {
            self.late.saw(now_ms, &seen.state);
        }
        self.late.for_ms(now_ms)
    }

    /// Sends a setpoint, unless the robot has not been heard yet: without an echo of its clock it
    /// would accept none.
    pub async fn send(&mut self, drive: StickPosition, feed: &StateFeed) -> Result<()> {
        let Some(seen) = feed.last(self.robot) else { return Ok(()) };
        self.sent += 1;
        let setpoint = Setpoint {
            lease: self.control.lease(),
            // From 1 within a grant; a lost one is never acquired again here.
            seq: self.sent,
            echo_tick_ms: Some(seen.state.tick_ms),
            rpm: drive.throttle * self.max_rpm,
            steering: drive.steering,
        };
        let me = self.client.name();
        let key = self.client.keys().robot(self.robot).teleop(Some(me));
        let channel = Channel::Teleop(me.clone());
        Ok(self.client.bus().put(&key, &channel, &setpoint, Format::Postcard).await?)
    }

    /// Zero and stop, whatever ended it. Who only watched does not end another's goal, nor does who has
    /// lost control: then it is `None`, else whether the robot has confirmed. If the message is lost, the
    /// robot's own clock ends the setpoint.
    pub async fn let_go(&mut self, feed: &StateFeed) -> Option<bool> {
        if self.sent == 0 || self.control.is_lost() {
            return None;
        }
        let zero = self.send(StickPosition::default(), feed).await;
        let stop = self.control.request(Uuid::new_v4(), Body::Stop {}).await;
        let both = zero.and(stop.map(drop)).inspect_err(|failure| tracing::debug!("cannot stop: {failure}"));
        Some(both.is_ok())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{FakeRobot, name};

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn nothing_is_sent_before_a_state_and_numbers_rise_from_1() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let fake = FakeRobot::start(&client, "xtb-1").await;
        let robot = name("xtb-1");
        let control = Control::acquire(&client, &robot, false).await.unwrap();
        let (sender, mut setpoints) = tokio::sync::mpsc::unbounded_channel();
        let each = move |incoming: xtb_bus::Incoming| {
            sender.send(incoming.decode::<Setpoint>().unwrap()).unwrap_or_default();
        };
        let teleop = client.keys().robot(&robot).teleop(None);
        let _watch = client.bus().subscribe(&teleop, each).await.unwrap();
        let mut session = TeleopSession::new(&client, &control, &robot, 30.0);
        let unheard = StateFeed::open(&client, &client.keys().robot(&name("xtb-2"))).await.unwrap();
        session.send(StickPosition::default(), &unheard).await.unwrap();
        assert_eq!(session.sent, 0);
        let feed = StateFeed::open(&client, &client.keys().robot(&robot)).await.unwrap();
        while feed.last(&robot).is_none() {
            feed.news().await;
        }
        for seq in 1..=3 {
            session.send(StickPosition { throttle: 1.0, steering: 0.0 }, &feed).await.unwrap();
            let setpoint = setpoints.recv().await.unwrap();
            assert_eq!((setpoint.seq, setpoint.rpm), (seq, 30.0));
            assert_eq!(setpoint.lease, fake.lock().lease.as_ref().map(|(_, lease)| *lease));
            assert!(setpoint.echo_tick_ms.is_some());
        }
    }
}
