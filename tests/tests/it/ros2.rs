//! ROS 2: what rmw_zenoh's sessions need of our router, and a robot that is a node, by the ground truth.

mod judges;
mod nodes;

use crate::attacker;
use fleet_tests::{Fleet, Setup, eventually};
use nodes::{Caller, DOMAIN, Talker};
use rand_core::Rng;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use xtb_bus::SessionRole;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::Body;
use xtb_ros2::cdr::from_bytes;
use xtb_ros2::convert::planar_pose;
use xtb_ros2::offer::{self, Channel};
use xtb_ros2::types::{
    CancelGoal, CancelGoalRequest, DiagnosticArray, Distro, EmptyRequest, GetResult, GetResultRequest,
    GoalInfo, Header, PoseStamped, SendGoal, SendGoalRequest, Status, Time, Trigger, Verdict,
};
use xtb_ros2::{Key, RosName};
use xtb_ros2_node::now_ns;
use zenoh::Session;

/// A peer that knows the router alone, as rmw_zenoh opens its sessions.
async fn peer(router: &str) -> Session {
    let mut config = zenoh::Config::default();
    for (name, value) in [
        ("mode", "\"peer\"".to_owned()),
        ("connect/endpoints", format!("[{router:?}]")),
        ("listen/endpoints", "[\"tcp/127.0.0.1:0\"]".to_owned()),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "true".to_owned()),
    ] {
        config.insert_json5(name, &value).unwrap();
    }
    zenoh::open(config).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn two_peers_that_know_only_our_router_hear_each_other() {
    let role = SessionRole::Router { listen: vec!["tcp/127.0.0.1:0".into()], connect: Vec::new() };
    let router = xtb_bus::open(&role).await.unwrap();
    let endpoint = router.locators().await.remove(0);
    let (talker, listener) = (peer(&endpoint).await, peer(&endpoint).await);
    let heard = Arc::new(AtomicBool::new(false));
    let flag = heard.clone();
    let hear = move |_| flag.store(true, Ordering::Relaxed);
    let _listening = listener.declare_subscriber("0/chatter/**").callback(hear).await.unwrap();
    eventually("a message of the other peer", || async {
        attacker::put(&talker, "0/chatter/string", "application/cdr", vec![0, 1, 0, 0]).await;
        heard.load(Ordering::Relaxed).then_some(())
    })
    .await;
}

async fn robot() -> Fleet {
    let setup = Setup { speed: 1.0, ros2: Some(DOMAIN), ..Setup::default() };
    Fleet::start(setup).await
}

fn drives(fleet: &Fleet) -> bool {
    fleet.truth(1).speed_mps > 0.1
}

/// Since when it stands, once it has stood for a second.
async fn neutral_since_s(fleet: &Fleet) -> f64 {
    eventually("neutral for a second", || async {
        fleet.truth(1).neutral_since_s.filter(|since_s| fleet.time_s() > since_s + 1.0)
    })
    .await
}

async fn trigger(fleet: &Fleet, channel: &Channel) -> Verdict {
    let caller = Caller::new(fleet.simulator.endpoint(), "cli", channel).await;
    caller.call::<Trigger>(channel, &EmptyRequest::default()).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_publisher_drives_and_the_truck_stands_when_it_falls_silent_and_when_its_token_goes() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let mut teleop = Talker::new(&bus, "teleop_twist").await;
    teleop.hold(0.3, || drives(&fleet)).await;
    let state = fleet.state(1).await;
    assert_eq!(state.lease.unwrap().holder.as_str(), "ros-teleop-twist");
    let silent_s = fleet.time_s();
    let took_s = neutral_since_s(&fleet).await - silent_s;
    assert!(took_s <= 0.25, "neutral {took_s} s after the last command");

    // Its pause was long enough to count as letting go.
    teleop.hold(0.3, || drives(&fleet)).await;
    let gone_s = fleet.time_s();
    teleop.vanish();
    let took_s = neutral_since_s(&fleet).await - gone_s;
    assert!(took_s <= 0.15, "neutral {took_s} s after its token went");
    assert_eq!(fleet.state(1).await.lease, None);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stick_that_is_held_while_the_agent_restarts_drives_only_when_it_was_let_go() {
    let mut fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let teleop = Talker::new(&bus, "teleop").await;
    let began = fleet.time_s();
    teleop.hold(0.3, || drives(&fleet) && fleet.time_s() > began + 3.0).await;
    let restart = async {
        fleet.simulator.stop_agent(0).await;
        fleet.simulator.restart_agent(0);
        fleet.until(1, "the agent back", |state| state.tick_ms > 0).await;
        fleet.simulated(3.0).await;
        assert!(fleet.truth(1).speed_mps < 0.02, "it drove by itself");
        assert_eq!(fleet.state(1).await.lease, None);
    };
    tokio::select! {
        () = restart => {}
        () = teleop.hold(0.3, || false) => {}
    }
    let began = fleet.time_s();
    teleop.hold(0.0, || fleet.time_s() > began + 0.3).await;
    teleop.hold(0.3, || drives(&fleet)).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_burst_that_was_held_up_moves_nothing() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let teleop = Talker::new(&bus, "teleop").await;
    // On time, standing; so its clock is known.
    let began = fleet.time_s();
    teleop.hold(0.0, || fleet.time_s() > began + 1.0).await;
    let (made_ns, before) = (now_ns(), fleet.truth(1));
    fleet.simulated(2.0).await;
    for sample in 0..20 {
        teleop.say_at(made_ns + sample * 100_000_000, 0.5, 0.0).await;
    }
    fleet.simulated(1.0).await;
    let after = fleet.truth(1);
    assert!((after.x_m - before.x_m).hypot(after.y_m - before.y_m) < 0.005, "{before:?} {after:?}");
    assert_eq!(fleet.state(1).await.lease, None);
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_second_publisher_is_fenced_and_named_in_diagnostics() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let (first, second) = (Talker::new(&bus, "first").await, Talker::new(&bus, "second").await);
    let fenced = Arc::new(AtomicBool::new(false));
    let flag = fenced.clone();
    let key = Key::new(DOMAIN, RosName::new("/diagnostics").unwrap(), offer::DIAGNOSTICS.ros_type);
    let _heard = bus
        .subscribe_attached(&key.to_string(), 1 << 16, move |attached| {
            let attached = attached.unwrap();
            assert_eq!(attached.attachment.len(), 33);
            let message: DiagnosticArray = from_bytes(&attached.payload).unwrap();
            let named = message
                .status
                .iter()
                .flat_map(|status| &status.values)
                .any(|value| value.key == "fenced cmd_vel" && value.value == "/second");
            flag.fetch_or(named, Ordering::Relaxed);
        })
        .await
        .unwrap();
    first.hold(0.2, || drives(&fleet)).await;
    let both = async {
        tokio::join!(
            first.hold(0.2, || fenced.load(Ordering::Relaxed)),
            second.hold(-0.5, || fenced.load(Ordering::Relaxed))
        )
    };
    let () = tokio::select! {
        _ = both => (),
        () = async { loop { tokio::task::yield_now().await; assert!(fleet.truth(1).speed_mps > -0.05) } } => (),
    };
    assert_eq!(fleet.state(1).await.lease.unwrap().holder.as_str(), "ros-first");
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn after_an_emergency_stop_nothing_moves_until_it_is_reset_and_the_stick_was_let_go() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let teleop = Talker::new(&bus, "teleop").await;
    teleop.hold(0.3, || drives(&fleet)).await;
    let stopped = async {
        let verdict = trigger(&fleet, &offer::ESTOP).await;
        assert!(verdict.success, "{}", verdict.message);
        neutral_since_s(&fleet).await;
        // Its lease has run out meanwhile, so whoever resets may have it.
        let verdict = eventually("reset", || async {
            Some(trigger(&fleet, &offer::RESET).await).filter(|verdict| verdict.success)
        });
        verdict.await;
        let reset_s = fleet.time_s();
        fleet.simulated(2.0).await;
        assert!(neutral_since_s(&fleet).await < reset_s, "a stick that was held drove after the reset");
    };
    tokio::select! {
        () = stopped => {}
        () = teleop.hold(0.3, || false) => {}
    }
    let held_s = fleet.time_s();
    teleop.hold(0.0, || fleet.time_s() > held_s + 0.3).await;
    teleop.hold(0.3, || drives(&fleet)).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_held_lease_is_not_taken_but_by_the_service_that_takes_it() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let (teleop, pilot) = (Talker::new(&bus, "teleop").await, fleet.pilot(1).await);
    pilot.ask(Body::Acquire { take: false }).await;
    let keep = async {
        let mut tick = tokio::time::interval(std::time::Duration::from_millis(100));
        loop {
            tick.tick().await;
            pilot.ask(Body::Retain {}).await;
        }
    };
    let refused = async {
        let began = fleet.time_s();
        teleop.hold(0.3, || fleet.time_s() > began + 1.5).await;
        assert!(!drives(&fleet));
        assert_eq!(fleet.state(1).await.lease.unwrap().holder.as_str(), "test");
        let verdict = trigger(&fleet, &offer::TAKE_CONTROL).await;
        assert!(verdict.success, "{}", verdict.message);
    };
    tokio::select! {
        () = refused => {}
        () = keep => {}
    }
    teleop.hold(0.3, || drives(&fleet)).await;
    assert_eq!(fleet.state(1).await.lease.unwrap().holder.as_str(), "ros-teleop");
    let verdict = trigger(&fleet, &offer::RELEASE_CONTROL).await;
    assert!(verdict.success, "{}", verdict.message);
    neutral_since_s(&fleet).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn goals_are_reached_cancelled_and_preempted() {
    let fleet = Fleet::start(Setup { speed: 1.0, ros2: Some(DOMAIN), ..Setup::default() }).await;
    fleet.until(1, "a map", |state| state.nav.map.is_some()).await;
    let endpoint = fleet.simulator.endpoint();
    let client = Caller::new(endpoint, "navigator", &offer::SEND_GOAL).await;
    let here = fleet.state(1).await.pose;
    let ahead = |m: f64| {
        let yaw_rad = here.yaw_rad;
        let (x_m, y_m) = (here.x_m + m * yaw_rad.cos(), here.y_m + m * yaw_rad.sin());
        let header = Header { frame_id: "map".into(), ..Header::default() };
        PoseStamped { header, pose: planar_pose(&MapPose { x_m, y_m, yaw_rad }) }
    };
    let send = async |id: u8, pose: PoseStamped| {
        let request = SendGoalRequest { goal_id: [id; 16], pose, behavior_tree: String::new() };
        client.call::<SendGoal>(&offer::SEND_GOAL, &request).await.unwrap().accepted
    };
    let result = async |id: u8| {
        let request = GetResultRequest { goal_id: [id; 16] };
        client.call::<GetResult>(&offer::GET_RESULT, &request).await.unwrap()
    };
    assert!(send(1, ahead(1.0)).await);
    let reached = result(1).await;
    assert_eq!((reached.status, reached.error_code), (Status::Succeeded as i8, 0), "{}", reached.error_msg);
    let truth = fleet.truth(1);
    let goal = ahead(1.0).pose.position;
    assert!((truth.x_m - goal.x).hypot(truth.y_m - goal.y) < 0.35, "{truth:?}");

    assert!(send(2, ahead(3.0)).await);
    let goal_info = GoalInfo { goal_id: [2; 16], stamp: Time::default() };
    let cancelled =
        client.call::<CancelGoal>(&offer::CANCEL_GOAL, &CancelGoalRequest { goal_info }).await.unwrap();
    assert_eq!((cancelled.return_code, cancelled.goals_canceling.len()), (0, 1));
    assert_eq!(result(2).await.status, Status::Canceled as i8);

    assert!(send(3, ahead(3.0)).await);
    assert!(send(4, ahead(1.5)).await);
    let replaced = result(3).await;
    assert_eq!((replaced.status, replaced.error_code), (Status::Aborted as i8, 9000));
    assert!(replaced.error_msg.contains("newer goal"), "{}", replaced.error_msg);
    assert_eq!(result(4).await.status, Status::Succeeded as i8);

    let odom = PoseStamped { header: Header { frame_id: "odom".into(), ..Header::default() }, ..ahead(1.0) };
    assert!(!send(5, odom).await);
    assert!(!send(4, ahead(1.0)).await, "an id is used once");
    fleet.until(1, "the lease free", |state| state.lease.is_none()).await;
    fleet.end().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn no_bytes_move_a_robot_or_end_its_node() {
    let fleet = robot().await;
    let bus = nodes::session(fleet.simulator.endpoint()).await;
    let before = fleet.truth(1);
    let mut random = rand_pcg::Pcg32::new(7, 7);
    let mut bytes = |most: u32| {
        let length = random.next_u32() % most;
        (0..length).map(|_| random.next_u32() as u8).collect::<Vec<u8>>()
    };
    let namespace = RosName::new("/xtb_1").unwrap();
    for channel in offer::robot(Distro::Kilted) {
        let key = Key::new(DOMAIN, namespace.resolve(channel.name).unwrap(), channel.ros_type).to_string();
        let publisher = bus.attached_publisher(&key, None).await.unwrap();
        for _ in 0..50 {
            publisher.put(bytes(400), &bytes(66)).await.unwrap();
        }
    }
    fleet.simulated(1.0).await;
    let after = fleet.truth(1);
    assert!((after.x_m - before.x_m).hypot(after.y_m - before.y_m) < 0.005, "{before:?} {after:?}");
    assert!(trigger(&fleet, &offer::STOP).await.success);
    fleet.end().await;
}
