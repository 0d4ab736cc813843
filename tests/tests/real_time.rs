//! Kills, stops and floods with real processes at real time, a few times each; the bench `safety` counts
//! to hundreds. A binary of its own, one test at a time: beside sixty others a world would stand still
//! long enough to look like broken lines.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use fleet_tests::identities::{Access, Pki};
use fleet_tests::load::{self, Flood};
use fleet_tests::mesh::{Cut, Cuts, Mesh};
use fleet_tests::processes::RouterProcess;
use fleet_tests::slow_link::{LinkQuality, SlowLink};
use fleet_tests::{Rig, eventually, name};
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio::sync::Mutex;
use xtb_bus::{Incoming, Opening, SessionRole};
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{GoalState, GoalStatus};

/// Held by the test that runs.
static MACHINE: Mutex<()> = Mutex::const_new(());

/// Somebody who hears what is published.
#[derive(Clone)]
struct Listener(Arc<std::sync::Mutex<Heard>>);

#[derive(Clone, Copy)]
struct Heard {
    count: usize,
    last: Instant,
    /// The longest time without a message.
    silent: Duration,
}

impl Listener {
    fn new() -> Self {
        Self(Arc::new(std::sync::Mutex::new(Heard::nothing())))
    }

    fn hears(&self) -> impl Fn(Incoming) + Send + Sync + use<> {
        let heard = self.0.clone();
        move |_| {
            let mut heard = heard.lock().unwrap();
            *heard = Heard { count: heard.count + 1, ..heard.until_now() };
        }
    }

    /// Since it was last told to begin.
    fn heard(&self) -> Heard {
        let heard = *self.0.lock().unwrap();
        Heard { silent: heard.until_now().silent, ..heard }
    }

    fn begin(&self) {
        *self.0.lock().unwrap() = Heard::nothing();
    }
}

impl Heard {
    fn nothing() -> Self {
        Self { count: 0, last: Instant::now(), silent: Duration::ZERO }
    }

    fn until_now(self) -> Self {
        let now = Instant::now();
        Self { last: now, silent: self.silent.max(now - self.last), ..self }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_agent_is_neutral_within_200_ms_and_its_successor_does_not_move() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(1, folder.path(), false).await;
    for after_s in [0.0, 0.7] {
        let trial = rig.kill_agent(1, after_s).await;
        assert!(trial.neutral_s <= 0.2 && !trial.moved, "{trial:?}");
    }
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_frozen_agent_is_neutral_within_200_ms_and_does_not_go_on_when_it_is_woken() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(1, folder.path(), false).await;
    for stopped_s in [0.0, 1.5] {
        let trial = rig.freeze_agent(1, stopped_s).await;
        assert!(trial.neutral_s <= 0.2 && !trial.moved, "{trial:?}");
    }
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_dead_router_ends_teleop_and_goals_that_halt_and_no_others() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let mut rig = Rig::start(3, folder.path(), true).await;
    let (teleop, halt, missed) = rig.kill_router().await;
    // The bench holds the limits of 250 and 700 ms; a busy machine delays the agents' own threads.
    assert!(teleop.neutral_s <= 0.5 && !teleop.moved, "{teleop:?}");
    assert!(halt.neutral_s <= 1.4 && !halt.moved, "{halt:?}");
    assert_eq!(missed, None);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_stop_is_lost_under_load() {
    let _alone = MACHINE.lock().await;
    for identities in [false, true] {
        let stops = load::stops(20, 1, identities).await;
        assert_eq!((stops.lost, stops.took.len()), (0, 20), "with identities: {identities}");
        assert!(stops.others_per_s > 0.0);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_strangers_stops_neither_the_robot_nor_its_states() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let rig = Rig::start(1, folder.path(), false).await;
    let flooded =
        load::flood(&rig, async |router| Flood::from(router, 5).await, Duration::from_secs(3)).await;
    assert!(flooded.stood.is_none() && flooded.arrived_per_s > 0.0, "{:?}", flooded.stood);
    assert!(flooded.growth_kib <= 32 * 1024, "{} KiB", flooded.growth_kib);
    rig.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_of_a_dead_router_go_on_at_another_one_and_the_others_do_not_notice() {
    let _alone = MACHINE.lock().await;
    for identities in [false, true] {
        let mut mesh = match Mesh::start(identities).await {
            Ok(mesh) => mesh,
            Err(why) => return skip(&format!("no network namespaces here: {why}")),
        };
        let failover = mesh.kill_router().await;
        assert!(failover.gap_s <= 5.0 && failover.others_gap_s <= 1.0, "{failover:?}");
        let runs = |goal: &GoalState| !goal.status.is_final();
        assert!(runs(&failover.elsewhere) && runs(&failover.finishing), "{failover:?}");
        assert_eq!(failover.halting.status, GoalStatus::Failed, "{failover:?}");
        mesh.lists_all().await;
        mesh.restart_router().await;
    }
}

/// The cable between a dispatcher and its stand-by; its computer, so that the stand-by takes over; and that computer again,
/// now of the stand-by.
#[tokio::test(flavor = "multi_thread")]
async fn of_two_dispatchers_without_a_link_at_most_one_goes_on_and_no_task_is_lost() {
    let _alone = MACHINE.lock().await;
    let folder = tempfile::tempdir().unwrap();
    let long = Duration::from_secs(8);
    let cuts = Cuts(vec![(Cut::Cable(0, 1), long / 2), (Cut::Host(0), long), (Cut::Host(0), long)]);
    match cuts.pass(folder.path(), |_| ()).await {
        Ok(totals) => assert!(totals.is_kept() && totals.term == 1, "{totals}"),
        Err(why) => skip(&format!("no network namespaces here: {why}")),
    }
}

/// A computer that falls asleep, or leaves the radio cell, while it listens to the whole fleet.
#[tokio::test(flavor = "multi_thread")]
async fn who_listens_over_a_dead_link_holds_up_nobody_else() {
    const STATE_BYTES: usize = 8 * 1024;
    /// More than the link and the system's buffers hold, many times.
    const STATES: usize = 4000;
    /// Zenoh waits 5 s for a queue before it closes the link behind it.
    const MOST_SILENT: Duration = Duration::from_secs(3);
    /// Nobody takes the dead link for lost meanwhile.
    const LEASE: Duration = Duration::from_secs(300);
    let _alone = MACHINE.lock().await; // Zenoh's threads belong to the process
    let open = |role| Opening::of(role).link_lease(LEASE);
    let router = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = open(router).once().await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let link = SlowLink::open(&endpoint, LinkQuality::default(), 6).await;
    let client = |endpoint: &str| open(SessionRole::Client { connect: vec![endpoint.to_owned()] });
    let asleep = client(link.endpoint()).once().await.unwrap();
    let awake = client(&endpoint).once().await.unwrap();
    let fleet = FleetKeys::new(name("lab"));
    let estop_all = fleet.estop_all(Some(&name("cli-1")));
    let mut robots = Vec::new();
    for number in 1..=3 {
        let keys = fleet.robot(&name(&format!("xtb-{number}")));
        robots.push((client(&endpoint).once().await.unwrap(), keys));
    }

    let (states, sleeper) = (Listener::new(), Listener::new());
    let _states = awake.subscribe_raw("xtb/lab/*/state", states.hears()).await.unwrap();
    let _all = asleep.subscribe_raw("xtb/lab/**", sleeper.hears()).await.unwrap();
    let speak = async || {
        for (robot, keys) in &robots {
            for _ in 0..8 {
                let state = vec![7; STATE_BYTES];
                robot.put_raw(&keys.state(), &Channel::State, "zenoh/bytes", state).await.unwrap();
            }
            robot.put_raw(&keys.event(), &Channel::Event, "zenoh/bytes", vec![7; 100]).await.unwrap();
            let estop = Channel::EstopAll(name("cli-1")); // as somebody repeats it until all have acknowledged
            robot.put_raw(&estop_all, &estop, "zenoh/bytes", vec![7; 100]).await.unwrap();
        }
    };
    eventually("both listen", || async {
        speak().await;
        (sleeper.heard().count > 0 && states.heard().count > 0).then_some(())
    })
    .await;

    link.stall(true);
    states.begin();
    let silent = eventually("the states", || async {
        speak().await;
        let heard = states.heard();
        (heard.count >= STATES).then_some(heard.silent)
    })
    .await;
    assert!(silent < MOST_SILENT, "{silent:?} without a state");
}

/// A radio cell that fails: what was sent to those in it is never received, and their router gives them up.
#[tokio::test(flavor = "multi_thread")]
async fn links_that_die_together_hold_up_nobody_else() {
    const STATE_BYTES: usize = 8 * 1024;
    const SPEAK_EVERY: Duration = Duration::from_millis(2);
    const LINKS: usize = 10;
    /// The router gives them up after 2 s, and closes them.
    const WATCHED: Duration = Duration::from_secs(6);
    const MOST_SILENT: Duration = Duration::from_secs(1);
    let _alone = MACHINE.lock().await;
    for identities in [false, true] {
        let access = Access::of(identities, 1, &["awake", "asleep"]);
        let router = RouterProcess::start(access.pki().map(Pki::folder));
        let (scheme, address) = router.endpoint().split_once('/').unwrap();
        let cell = SlowLink::open(&format!("tcp/{address}"), LinkQuality::default(), 7).await;
        let inside = cell.endpoint().replace("tcp", scheme);
        let robot = access.session("xtb-1", router.endpoint()).await;
        let key = FleetKeys::new(name("lab")).robot(&name("xtb-1")).state();
        let mut sleepers = Vec::new();
        for _ in 0..LINKS {
            let (session, listener) = (access.session("asleep", &inside).await, Listener::new());
            let states = session.subscribe_raw("xtb/lab/*/state", listener.hears()).await.unwrap();
            sleepers.push((session, listener, states));
        }
        let (awake, states) = (access.session("awake", router.endpoint()).await, Listener::new());
        let _states = awake.subscribe_raw("xtb/lab/*/state", states.hears()).await.unwrap();
        let speaks_until = async |is: &dyn Fn() -> bool| {
            let (began, mut turns) = (Instant::now(), tokio::time::interval(SPEAK_EVERY));
            while !is() {
                assert!(began.elapsed() < Duration::from_secs(60), "with identities: {identities}");
                turns.tick().await;
                let state = vec![7; STATE_BYTES];
                robot.put_raw(&key, &Channel::State, "zenoh/bytes", state).await.unwrap();
            }
        };
        let all_hear =
            || states.heard().count > 0 && sleepers.iter().all(|(_, sleeper, _)| sleeper.heard().count > 0);
        speaks_until(&all_hear).await;

        cell.stall(true);
        states.begin();
        let began = Instant::now();
        speaks_until(&|| began.elapsed() > WATCHED).await;
        let silent = states.heard().silent;
        assert!(silent < MOST_SILENT, "{silent:?} without a state, with identities: {identities}");

        cell.stall(false);
        sleepers.iter().for_each(|(_, sleeper, _)| sleeper.begin());
        speaks_until(&all_hear).await;
    }
}

#[allow(clippy::print_stderr)] // people who run the tests shall see it
fn skip(why: &str) {
    eprintln!("skipped: {why}");
}
