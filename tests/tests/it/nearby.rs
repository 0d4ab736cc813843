//! Robots that drive alone hear those near them, and nobody else.

use fleet_tests::{Fleet, Setup, eventually, name};
use std::sync::{Arc, Mutex};
use xtb_bus::{Bus, Incoming, Subscription};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys, FloorCell};
use xtb_protocol::messages::{Body, LinkLoss, NearRole, NearState, Outcome, RobotState, Via};

type Told = Arc<Mutex<Vec<NearState>>>;

fn keys() -> FleetKeys {
    FleetKeys::new(name("lab"))
}

async fn listen(bus: &Bus, cell: FloorCell) -> (Told, Subscription) {
    let told = Told::default();
    let theirs = told.clone();
    let each = move |incoming: Incoming| theirs.lock().unwrap().push(incoming.decode().unwrap());
    let subscription = bus.subscribe(&keys().any_robot().near(cell), each).await.unwrap();
    (told, subscription)
}

/// A stranger tells that it stands somewhere, in a square.
async fn tell(bus: &Bus, robot: &str, (x_m, y_m): (f64, f64), cell: FloorCell) {
    let said = NearState {
        robot: name(robot),
        x_m,
        y_m,
        yaw_rad: 0.0,
        speed_mps: 0.0,
        role: NearRole::Parked,
        way: None,
        waits_for: None,
    };
    let key = keys().robot(&said.robot).near(cell);
    bus.put(&key, &Channel::Near(cell), &said, Format::Postcard).await.unwrap();
}

fn planned(x_m: f64, y_m: f64) -> Body {
    let (on_link_loss, finish_s) = (LinkLoss::Finish, 300.0);
    Body::Goto { x_m, y_m, yaw_rad: None, via: Some(Via::Planned), on_link_loss, finish_s }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_tells_where_it_is_in_its_own_square_alone() {
    let fleet = Fleet::start(Setup::default()).await;
    let state = fleet.state(1).await;
    let own = FloorCell::at(state.pose.x_m, state.pose.y_m);
    let (told, _subscription) = listen(&fleet.bus, own).await;
    let far = FloorCell { column: own.column + 2, row: own.row };
    let (elsewhere, _far) = listen(&fleet.bus, far).await;
    let three = || async { (told.lock().unwrap().len() >= 3).then_some(()) };
    eventually("three messages", three).await;
    let said = told.lock().unwrap()[0].clone();
    assert_eq!((said.robot, said.role, said.way), (name("xtb-1"), NearRole::Parked, None));
    assert!((said.x_m - state.pose.x_m).abs() < 0.1 && (said.y_m - state.pose.y_m).abs() < 0.1);
    assert!(elsewhere.lock().unwrap().is_empty());
    fleet.end().await;
}

/// What cannot be true is counted by those who hear it: so they show whom they hear.
#[tokio::test(flavor = "multi_thread")]
async fn a_robot_hears_the_squares_around_it_and_only_while_it_drives_alone() {
    let fleet = Fleet::start(Setup { speed: 1.0, starts: vec![(0.5, -3.0, 1.57)], ..Setup::default() }).await;
    fleet.until(1, "a map", |state| state.nav.map.is_some()).await;
    let (beside, far) = (FloorCell::at(0.5 - 8.0, -3.0), FloorCell::at(0.5 + 24.0, -3.0));
    let impossible = (500.0, 500.0);
    for cell in [beside, far] {
        tell(&fleet.bus, "ghost", impossible, cell).await;
    }
    fleet.simulated(0.5).await;
    assert_eq!(fleet.state(1).await.rejected.out_of_range, 0, "it does not drive");
    assert!(matches!(fleet.ask(1, planned(0.5, 2.5)).await, Outcome::Ok(_)));
    let counted = |state: &RobotState| state.rejected.out_of_range > 0;
    eventually("it hears the square beside it", || async {
        tell(&fleet.bus, "ghost", impossible, beside).await;
        counted(&fleet.state(1).await).then_some(())
    })
    .await;
    fleet.simulated(0.5).await;
    let before = fleet.state(1).await.rejected.out_of_range;
    tell(&fleet.bus, "ghost", impossible, far).await;
    tell(&fleet.bus, "ghost", impossible, beside).await;
    let more = |state: &RobotState| state.rejected.out_of_range > before;
    fleet.until(1, "it hears on", more).await;
    fleet.simulated(0.5).await;
    let after = fleet.state(1).await.rejected.out_of_range;
    assert_eq!(after, before + 1, "it hears what is far away");
    fleet.end().await;
}
