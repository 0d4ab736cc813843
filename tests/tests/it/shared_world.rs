//! One world, two simulators: each moves its own robots, and the other's are bodies to them.

use fleet_tests::{eventually, name};
use std::sync::mpsc;
use xtb_client::ErrorKind;
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
async fn a_simulator_of_another_world_does_not_start_beside_the_first() {
    let first = Simulator::start(plan(1, 2, Vec::new())).await.unwrap();
    let refused = Simulator::start(plan(2, 60, vec![first.endpoint().to_owned()])).await;
    let Err(refused) = refused else { panic!("it has started") };
    assert_eq!(refused.kind, ErrorKind::Failed);
    assert!(refused.hint.contains("--fleet-size"), "{refused:?}");
    first.stop().await;
}
