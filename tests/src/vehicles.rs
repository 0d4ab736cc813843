//! Robots of three kinds under traffic control, goal after goal, and what came of it by ground truth.

use crate::{Fleet, Setup, name};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::task::JoinSet;
use xtb_client::goal::{GoalRequest, drive};
use xtb_client::{Client, Control, Settings};
use xtb_nav::rooms::Draw;
use xtb_nav::{Clearance, Grid};
use xtb_protocol::Name;
use xtb_protocol::messages::{GoalStatus, LinkLoss};
use xtb_services::traffic::TrafficService;
use xtb_sim::World;
use xtb_sim::fixes::FixTruth;
use xtb_simulator::TruthView;

/// From a goal to anything on the map at least, in m: the largest of the three can stand there anyhow.
const ROOM_M: f64 = 0.6;
/// Between the goals of two robots at least, in m.
const APART_M: f64 = 1.5;

/// What came of the goals.
#[derive(Debug, Clone, Default)]
pub struct Drives {
    /// Goals that were reached.
    pub reached: usize,
    /// Those that were not: robot, goal and reason.
    pub failed: Vec<String>,
    /// Robots that touched something, each time.
    pub contacts: u64,
    /// Simulated time, in s.
    pub took_s: f64,
}

struct Shared {
    draw: Draw,
    left: usize,
    /// Where each is sent, by robot.
    goals: Vec<[f64; 2]>,
    drives: Drives,
}

/// An XTB, one of half the wheelbase and one half as long again (configs/vehicles) in worlds/lab.toml with
/// traffic control: so many goals together, each as soon as its robot is done with the last.
///
/// # Panics
/// If something does not start.
pub async fn three_kinds(goals: usize, seed: u64, speed: f64) -> Drives {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let vehicle = |file: &str| {
        let path = root.join("configs/vehicles").join(file);
        fleet_cli::vehicle_file::read(&path).unwrap_or_else(|failure| panic!("{failure}"))
    };
    let world =
        std::fs::read_to_string(root.join("worlds/lab.toml")).unwrap_or_else(|error| panic!("{error}"));
    let fleet = Fleet::start(Setup {
        robots: 3,
        speed,
        seed,
        world: Some(World::from_toml(&world).unwrap_or_else(|error| panic!("{error}"))),
        vehicles: ["xtb.toml", "half-wheelbase.toml", "long.toml"].map(vehicle).to_vec(),
        fixes: FixTruth { rate_hz: 2.0, ..FixTruth::default() },
        ..Setup::default()
    })
    .await;
    let settings =
        Settings { client: name("test"), ..Settings::new("lab").unwrap_or_else(|error| panic!("{error}")) };
    let client = Client::on(&settings, fleet.bus.clone());
    let map = fleet.simulator.map().unwrap_or_else(|| panic!("the world has no map"));
    let traffic = TrafficService::start(&client, map, Duration::from_secs(2)).await;
    let traffic = traffic.unwrap_or_else(|failure| panic!("{failure}"));
    let floor = Arc::new((map.grid_with_keep_outs(), Clearance::of(&map.grid_with_keep_outs())));
    let began_s = fleet.time_s();
    let starts = (1..=3).map(|number| fleet.truth(number)).map(|truck| [truck.x_m, truck.y_m]).collect();
    let shared = Shared { draw: Draw::new(seed), left: goals, goals: starts, drives: Drives::default() };
    let shared = Arc::new(Mutex::new(shared));
    let mut driving = JoinSet::new();
    for index in 0..3 {
        let truth = fleet.simulator.truth().clone();
        driving.spawn(one(client.clone(), truth, index, Arc::clone(&floor), Arc::clone(&shared)));
    }
    driving.join_all().await;
    let mut drives = std::mem::take(&mut shared.lock().unwrap_or_else(PoisonError::into_inner).drives);
    drives.took_s = fleet.time_s() - began_s;
    drives.contacts = (1..=3).map(|number| fleet.truth(number).contacts).sum();
    drop(traffic);
    fleet.end().await;
    drives
}

/// One robot's goals, until none are left.
async fn one(
    client: Client,
    truth: TruthView,
    index: usize,
    floor: Arc<(Grid, Clearance)>,
    shared: Arc<Mutex<Shared>>,
) {
    let robot: Name = name(&format!("xtb-{}", index + 1));
    let control = Control::acquire(&client, &robot, false).await.unwrap_or_else(|error| panic!("{error}"));
    let mut from = "its start".to_owned();
    while let Some([x_m, y_m]) = next_goal(&floor, &shared, index) {
        let request = GoalRequest { on_link_loss: LinkLoss::Finish, ..GoalRequest::to(x_m, y_m) };
        let end = drive(&client, &control, &request).await.map(|end| (end.status, end.reason));
        let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
        match end {
            Ok((GoalStatus::Reached, _)) => {
                shared.drives.reached += 1;
                from = format!("({x_m:.2}, {y_m:.2})");
            }
            other => {
                let truck = truth.latest().robots[&robot];
                let at = [truck.x_m, truck.y_m, truck.yaw_rad.to_degrees()]
                    .map(|value| (value * 100.0).round() / 100.0);
                let from = format!("{from}, at {at:?}");
                shared.drives.failed.push(format!("{robot} from {from} to ({x_m:.2}, {y_m:.2}): {other:?}"));
            }
        }
    }
    control.release().await;
}

/// A free place that nobody else is sent to.
fn next_goal(floor: &(Grid, Clearance), shared: &Mutex<Shared>, index: usize) -> Option<[f64; 2]> {
    let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
    shared.left = shared.left.checked_sub(1)?;
    let (grid, clearance) = floor;
    let [x_m, y_m] = grid.origin_m();
    let side_m = |cells: usize| cells as f64 * grid.resolution_m();
    loop {
        let place = [
            x_m + shared.draw.uniform(0.0, side_m(grid.width())),
            y_m + shared.draw.uniform(0.0, side_m(grid.height())),
        ];
        let mut others = shared.goals.iter().enumerate().filter(|(other, _)| *other != index);
        let apart = others.all(|(_, [x, y])| (place[0] - x).hypot(place[1] - y) >= APART_M);
        if apart && clearance.at_least_m(place[0], place[1]) >= ROOM_M {
            shared.goals[index] = place;
            return Some(place);
        }
    }
}
