//! The emergency stop: robots stand, latched, until somebody resets them. It needs no lease.
//!
//! It is put again and again until each robot has acknowledged it or time is up, and asked beside that: the
//! answer, that the latch is set, is the acknowledgement, and the robot's own state has to show it. For all
//! robots it is put at once on the key that every robot hears, before anybody knows who they are, and asked of all;
//! what a robot answers to that is its acknowledgement. A link that is lost is waited for, up to
//! [`LINK_WITHIN`].

use crate::client::Client;
use crate::confirm::confirm;
use crate::crowd::Crowd;
use crate::heard::{AbortOnDrop, Heard};
use crate::multi_robot::{MissingInfo, MultiRobot, StopOutcome, StopReport, Targets};
use crate::stop::not_sent;
use futures_util::FutureExt;
use futures_util::future::BoxFuture;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::task::JoinSet;
use xtb_identity::Action;
use xtb_protocol::codec::Format;
use xtb_protocol::keys::Channel;
use xtb_protocol::messages::{Estop, Estopped, Latch, RobotState};
use xtb_protocol::{Name, Uuid};

/// Between two puts, and between two questions, at first.
const AGAIN_EVERY: Duration = Duration::from_millis(50);
/// Later, so that repetitions do not fill a slow link.
const AGAIN_MOST: Duration = Duration::from_millis(400);
/// Questions to one robot on their way at most.
const IN_FLIGHT: usize = 16;
/// A question that is not answered for so long is asked anew.
const ANSWER_WITHIN: Duration = Duration::from_millis(500);
/// Of a question to all no answer is taken after so long.
const ALL_ANSWER_WITHIN: Duration = Duration::from_secs(2);
/// Of hundreds each has longer to acknowledge it: this, as much longer as their pauses are.
const LATER: Duration = Duration::from_millis(200);
/// A lost link is waited for so long.
pub const LINK_WITHIN: Duration = Duration::from_secs(60);

/// Calls it for them for so long, and says what came of it; as [`stop`](crate::stop::stop) for who may not.
pub async fn estop(client: &Client, targets: &Targets, within: Duration) -> (StopReport, MissingInfo) {
    if let Err(error) = client.may(Action::EmergencyStop) {
        return not_sent(error);
    }
    let call = Call { id: Uuid::new_v4(), within };
    call.until_linked(client, targets).await
}

/// One emergency stop: the same id in each repetition.
#[derive(Debug, Clone, Copy)]
struct Call {
    id: Uuid,
    within: Duration,
}

impl Call {
    /// Those who are meant; and anew when the link is back, if it was lost meanwhile and somebody has not answered.
    async fn until_linked(self, client: &Client, targets: &Targets) -> (StopReport, MissingInfo) {
        let give_up = Instant::now() + LINK_WITHIN;
        loop {
            let was_linked = client.bus().is_linked().await;
            let (report, missing) = match targets {
                Targets::All { expect, known } => self.everybody(client, expect, known).await,
                Targets::Robots(robots) => (self.these(client, robots).await, MissingInfo::default()),
            };
            let stopped = !report.robots.is_empty() && report.all_stopped();
            if stopped || was_linked && client.bus().is_linked().await || Instant::now() >= give_up {
                return (report, missing);
            }
            tokio::time::sleep(AGAIN_EVERY).await;
        }
    }

    async fn these(self, client: &Client, robots: &[Name]) -> StopReport {
        let mut calls = self.calls(client, &Heard::default());
        calls.call(robots.iter().cloned());
        StopReport::new(calls.outcomes().await, &MissingInfo::default())
    }

    /// Who is told, who is known, who is there, and who answers without being any of these.
    async fn everybody(self, client: &Client, expect: &[Name], known: &[Name]) -> (StopReport, MissingInfo) {
        let (me, heard) = (client.name().clone(), Heard::default());
        let mut calls = self.calls(client, &heard);
        let crowd = Arc::new(calls.crowd());
        let key = client.keys().estop_all(Some(&me));
        let _puts = self.put(client, key, Channel::EstopAll(me), Arc::clone(&crowd), Duration::ZERO);
        let _asking = AbortOnDrop(tokio::spawn(self.ask_everybody(client.clone(), crowd, heard.clone())));
        let missing = calls.call_all(expect, known).await;
        (StopReport::new(calls.outcomes_and_of(&heard).await, &missing), missing)
    }

    fn calls(
        self,
        client: &Client,
        heard: &Heard<()>,
    ) -> MultiRobot<impl Fn(Client, Name, Crowd) -> BoxFuture<'static, StopOutcome> + use<>> {
        let heard = heard.clone();
        MultiRobot::new(client, move |client, robot, crowd| {
            self.one(client, robot, crowd, heard.clone()).boxed()
        })
    }

    async fn ask_everybody(self, client: Client, crowd: Arc<Crowd>, heard: Heard<()>) {
        let (mut asking, mut pause) = (JoinSet::new(), AGAIN_EVERY);
        loop {
            if asking.len() < IN_FLIGHT {
                let (client, heard) = (client.clone(), heard.clone());
                let key_expr = client.keys().any_robot().estop(Some(client.name()));
                let within = crowd.pause(ALL_ANSWER_WITHIN).min(self.within(&crowd));
                asking.spawn(async move { self.ask(&client, &key_expr, within, &heard).await });
            }
            tokio::time::sleep(crowd.pause(pause)).await;
            pause = (pause * 2).min(AGAIN_MOST);
            while asking.try_join_next().is_some() {}
        }
    }

    /// One robot, until it has acknowledged or time is up, and then until its state shows it.
    async fn one(self, client: Client, robot: Name, crowd: Crowd, heard: Heard<()>) -> StopOutcome {
        let key = client.keys().robot(&robot).estop(Some(client.name()));
        let crowd = Arc::new(crowd); // two tasks, but one robot
        // What goes to all reaches it too.
        let first = crowd.head_start(AGAIN_EVERY);
        let channel = Channel::Estop(client.name().clone());
        let puts = self.put(&client, key.clone(), channel, Arc::clone(&crowd), first);
        let within = client.round_trip().patience(self.within(&crowd));
        let mut to_all = heard.answers(&robot);
        let acknowledged = async {
            tokio::select! {
                Ok(answers) = to_all.wait_for(|answers| !answers.is_empty()) => answers.len(),
                voices = self.acknowledged(&client, key, &robot, &crowd, first) => voices,
            }
        };
        let Ok(voices) = tokio::time::timeout(within, acknowledged).await else {
            return StopOutcome::Unknown;
        };
        drop(puts);
        if voices > 1 {
            return StopOutcome::Ambiguous;
        }
        let outcome = confirm(&client, &robot, &crowd, is_latched).await;
        // A second voice may have come later.
        if to_all.borrow().len() > 1 { StopOutcome::Ambiguous } else { outcome }
    }

    /// How many programs say in the robot's name that it is latched, once one does; asked after `first`. A question is
    /// asked again before those before are answered: a slow link costs one round trip.
    async fn acknowledged(
        self,
        client: &Client,
        key: String,
        robot: &Name,
        crowd: &Crowd,
        first: Duration,
    ) -> usize {
        let mut asking = JoinSet::new();
        let (mut next, mut pause) = (tokio::time::Instant::now() + first, AGAIN_EVERY);
        loop {
            tokio::select! {
                biased;
                Some(latched) = asking.join_next() => {
                    let latched: BTreeMap<Name, Vec<()>> = latched.unwrap_or_default();
                    if let Some(answers) = latched.get(robot) {
                        return answers.len();
                    }
                }
                () = tokio::time::sleep_until(next), if asking.len() < IN_FLIGHT => {
                    let (client, key) = (client.clone(), key.clone());
                    let within = crowd.pause(ANSWER_WITHIN).min(self.within(crowd));
                    asking.spawn(async move { self.ask(&client, &key, within, &Heard::default()).await });
                    next = tokio::time::Instant::now() + crowd.pause(pause);
                    pause = longer(pause);
                }
            }
        }
    }

    /// Who is said to be latched, and by how many; `heard` is told as they come.
    async fn ask(
        self,
        client: &Client,
        key_expr: &str,
        within: Duration,
        heard: &Heard<()>,
    ) -> BTreeMap<Name, Vec<()>> {
        let mut latched = BTreeMap::new();
        let channel = Channel::Estop(client.name().clone());
        let estop = Estop { id: self.id };
        let within = client.round_trip().patience(within);
        let each = |answer: xtb_bus::Incoming| match answer.decode::<Estopped>() {
            Ok(Estopped { robot, latched: true }) => {
                let answers: &mut Vec<()> = latched.entry(robot.clone()).or_default();
                answers.push(());
                heard.says(&robot, answers);
            }
            Ok(Estopped { robot, .. }) => tracing::debug!("{robot} has received it, but is not latched"),
            Err(error) => tracing::warn!("on {}: {error}", answer.key),
        };
        if let Err(error) = client.bus().ask_each(key_expr, &channel, &estop, within, each).await {
            tracing::debug!("{error}");
        }
        latched
    }

    /// Of many robots each has longer to acknowledge.
    fn within(self, crowd: &Crowd) -> Duration {
        self.within + crowd.head_start(LATER)
    }

    /// Puts it after `first` and again and again, in a task of its own: a full queue holds up no question.
    fn put(
        self,
        client: &Client,
        key: String,
        channel: Channel,
        crowd: Arc<Crowd>,
        first: Duration,
    ) -> AbortOnDrop {
        let bus = client.bus().clone();
        AbortOnDrop(tokio::spawn(async move {
            let mut pause = AGAIN_EVERY;
            tokio::time::sleep(first).await;
            loop {
                if let Err(error) = bus.put(&key, &channel, &Estop { id: self.id }, Format::Postcard).await {
                    tracing::debug!("{error}");
                }
                tokio::time::sleep(crowd.pause(pause)).await;
                pause = longer(pause);
            }
        }))
    }
}

fn longer(pause: Duration) -> Duration {
    (pause * 5 / 4).min(AGAIN_MOST)
}

fn is_latched(state: &RobotState) -> bool {
    state.latches.iter().any(|set| set.latch == Latch::Estop)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::{self, FakeRobot, name};

    fn call(within: Duration) -> Call {
        Call { id: Uuid::from_u128(1), within }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn only_who_acknowledges_is_stopped_and_a_missing_one_leaves_it_incomplete() {
        let client = Client::alone(Duration::from_secs(1)).await;
        let there = FakeRobot::start(&client, "xtb-1").await;
        let silent = FakeRobot::start(&client, "xtb-2").await;
        silent.lock().mute = true;
        let expect = ["xtb-1", "xtb-2", "xtb-3"].map(name);
        let (report, _) = call(Duration::from_secs(1)).everybody(&client, &expect, &[]).await;
        let outcomes = [StopOutcome::Stopped, StopOutcome::Unknown, StopOutcome::Unknown];
        assert_eq!(report.robots, expect.into_iter().zip(outcomes).collect::<BTreeMap<_, _>>());
        assert!(!report.complete);
        assert_eq!(there.lock().state.latches[0].latch, Latch::Estop);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn what_a_robot_answers_to_all_acknowledges_it_and_its_state_has_to_show_it() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().mute = true; // it does not answer the questions to itself
        for (voices, latched, outcome) in [
            (1, false, StopOutcome::Unconfirmed),
            (1, true, StopOutcome::Stopped),
            (2, true, StopOutcome::Ambiguous),
        ] {
            if latched {
                robot.lock().state.latches = vec![fake::latch(Latch::Estop, "me", false)];
            }
            let heard = Heard::default();
            heard.says(&name("xtb-1"), &vec![(); voices]);
            assert_eq!(heard.robots(), [name("xtb-1")]);
            let one =
                call(Duration::from_secs(30)).one(client.clone(), name("xtb-1"), Crowd::default(), heard);
            assert_eq!(one.await, outcome);
        }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn nobody_acknowledges_for_another_robot() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let keys = client.keys().robot(&name("xtb-2"));
        let (own_key, runtime) = (keys.estop(Some(client.name())), tokio::runtime::Handle::current());
        let liar = move |question: xtb_bus::Question| {
            let own_key = own_key.clone();
            runtime.spawn(async move {
                let reply = Estopped { robot: name("xtb-1"), latched: true };
                question.reply(&own_key, &reply, Format::Postcard).await.unwrap();
            });
        };
        let _liar = client.bus().serve(&keys.estop(None), liar).await.unwrap();
        let _robot = FakeRobot::start(&client, "xtb-3").await;
        let key_expr = client.keys().any_robot().estop(Some(client.name()));
        let within = Duration::from_secs(30);
        let latched = call(within).ask(&client, &key_expr, within, &Heard::default()).await;
        assert_eq!(latched, BTreeMap::from([(name("xtb-3"), vec![()])]));
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn a_roster_that_has_acknowledged_is_complete_and_nobody_knows_without_one() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let _robot = FakeRobot::start(&client, "xtb-1").await;
        let (report, _) = call(Duration::from_secs(30)).everybody(&client, &[name("xtb-1")], &[]).await;
        assert!(report.complete);
        let (report, missing) = call(Duration::from_secs(30)).everybody(&client, &[], &[]).await;
        assert!(missing.no_roster);
        assert_eq!(report.robots, BTreeMap::from([(name("xtb-1"), StopOutcome::Stopped)]));
        assert!(!report.complete);
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn who_is_known_by_sight_is_asked_though_the_router_knows_nobody() {
        let client = Client::alone(Duration::from_millis(300)).await;
        let known = [name("xtb-7")];
        let (report, missing) = call(Duration::from_millis(300)).everybody(&client, &[], &known).await;
        assert_eq!(report.robots, BTreeMap::from([(name("xtb-7"), StopOutcome::Unknown)]));
        assert!(missing.no_roster && !report.complete, "known is not all that there should be");
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn it_waits_for_a_lost_link_and_then_stops_who_is_there() {
        let robot = || vec![name("xtb-1")];
        for targets in [Targets::All { expect: Vec::new(), known: robot() }, Targets::Robots(robot())] {
            let client = Client::alone(Duration::from_secs(1)).await;
            let mut calling =
                std::pin::pin!(call(Duration::from_millis(200)).until_linked(&client, &targets));
            let early = tokio::time::timeout(Duration::from_millis(600), &mut calling).await;
            assert!(early.is_err(), "there is neither link nor robot: {early:?}");
            let robot = FakeRobot::start(&client, "xtb-1").await;
            let (report, _) = calling.await;
            assert_eq!(report.robots, BTreeMap::from([(name("xtb-1"), StopOutcome::Stopped)]));
            assert_eq!(robot.lock().state.latches[0].latch, Latch::Estop);
        }
    }

    #[tokio::test(flavor = "multi_thread", worker_threads = 2)]
    async fn it_is_put_again_with_its_id_until_it_is_acknowledged() {
        let client = Client::alone(Duration::from_secs(30)).await;
        let robot = FakeRobot::start(&client, "xtb-1").await;
        robot.lock().mute = true;
        let (sender, mut puts) = tokio::sync::mpsc::unbounded_channel();
        let each = move |incoming: xtb_bus::Incoming| {
            sender.send((incoming.key.clone(), incoming.decode::<Estop>().unwrap())).unwrap_or_default();
        };
        let _watch = client.bus().subscribe(xtb_protocol::keys::any::ESTOP, each).await.unwrap();
        let deaf_at_first = async {
            let mut heard = BTreeMap::<String, usize>::new();
            while heard.len() < 2 || heard.values().any(|count| *count < 3) {
                let (key, estop) = puts.recv().await.unwrap();
                assert_eq!(estop.id, Uuid::from_u128(1));
                *heard.entry(key).or_default() += 1;
            }
            robot.lock().mute = false;
            heard
        };
        let calling = call(Duration::from_secs(30));
        let expect = [name("xtb-1")];
        let (heard, (report, _)) = tokio::join!(deaf_at_first, calling.everybody(&client, &expect, &[]));
        assert!(report.complete, "{report:?}");
        let keys = ["xtb/lab/all/estop/me", "xtb/lab/xtb-1/estop/me"];
        assert_eq!(heard.into_keys().collect::<Vec<_>>(), keys);
    }
}
