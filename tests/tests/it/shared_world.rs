//! One world, two simulators: each moves its own robots, and the other's are bodies to them.

use fleet_tests::{Pilot, eventually, name};
use std::sync::mpsc;
use xtb_bus::SessionRole;
use xtb_client::ErrorKind;
use xtb_control::frames::MapPose;
use xtb_protocol::messages::{Body, LinkLoss, Via};
use xtb_sim::fixes::FixTruth;
use xtb_simulator::{SimulationPlan, Simulator};

fn plan(first: usize, fleet_size: usize, connect: Vec<String>) -> SimulationPlan {
    SimulationPlan {
        fleet: name("lab"),
        robots: 1,
        first,
        fleet_size: Some(fleet_size),
        world: None,
        vehicles: Vec::new(),
        starts: Vec::new(),
        seed: 1,
        speed: 1.0,
        listen: "tcp/127.0.0.1:0".into(),
        connect,
        pki: None,
        identity: None,
        pty: None,
        board: None,
        truth_log: None,
        fixes: FixTruth::default(),
        record: None,
        ros2: None,
    }
}

/// The robots of others in a simulator's world.
async fn foreign(simulator: &Simulator) -> Vec<String> {
    let (told, names) = mpsc::channel();
    simulator.world().change(move |world| {
        let _ = told.send(world.foreign().map(str::to_owned).collect());
    });
    eventually("the world", || async { names.try_recv().ok() }).await
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_of_two_simulators_are_bodies_to_each_other_until_one_of_them_ends() {
    let first = Simulator::start(plan(1, 2, Vec::new())).await.unwrap();
    let second = Simulator::start(plan(2, 2, vec![first.endpoint().to_owned()])).await.unwrap();
    for (simulator, other) in [(&first, "xtb-2"), (&second, "xtb-1")] {
        eventually("the other one", || async { (foreign(simulator).await == [other]).then_some(()) }).await;
    }
    assert_eq!(
        second.truth().latest().robots.keys().map(|robot| robot.as_str()).collect::<Vec<_>>(),
        ["xtb-2"]
    );
    second.stop().await;
    eventually("it is gone", || async { foreign(&first).await.is_empty().then_some(()) }).await;
    first.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_stops_before_one_of_another_simulator_and_drives_on_when_that_has_ended() {
    let at = |x_m| vec![MapPose { x_m, y_m: 0.0, yaw_rad: 0.0 }];
    let first = SimulationPlan { starts: at(0.0), ..plan(1, 2, Vec::new()) };
    let first = Simulator::start(first).await.unwrap();
    let connect = vec![first.endpoint().to_owned()];
    let second = SimulationPlan { starts: at(1.6), ..plan(2, 2, connect.clone()) };
    let second = Simulator::start(second).await.unwrap();
    eventually("the other one", || async { (foreign(&first).await == ["xtb-2"]).then_some(()) }).await;
    let bus = xtb_bus::open(&SessionRole::Client { connect }).await.unwrap();
    let (on_link_loss, finish_s, via) = (LinkLoss::Finish, 60.0, Some(Via::Direct));
    let goal = Body::Goto { x_m: 3.0, y_m: 0.0, yaw_rad: None, via, on_link_loss, finish_s };
    Pilot::new(&bus, "lab", "xtb-1", "test").await.ask(goal).await;
    let truth = || *first.truth().latest().robots.first_key_value().unwrap().1;
    let stands = || async { Some(truth()).filter(|truth| truth.x_m > 0.3 && truth.speed_mps.abs() < 1e-3) };
    let stands = eventually("it stands before the other one", stands).await;
    assert!(stands.x_m < 1.1 && stands.contacts == 0, "{stands:?}");
    second.stop().await;
    eventually("it drives on", || async { (truth().x_m > 1.6).then_some(()) }).await;
    assert_eq!(truth().contacts, 0);
    first.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_simulator_of_another_world_does_not_start_beside_the_first() {
    let first = Simulator::start(plan(1, 2, Vec::new())).await.unwrap();
    let refused = Simulator::start(plan(2, 60, vec![first.endpoint().to_owned()])).await;
    let Err(refused) = refused else { panic!("it has started") };
    assert_eq!(refused.kind, ErrorKind::Failed);
    assert!(refused.hint.contains("--fleet-size"), "{refused:?}");
    first.stop().await;
}
