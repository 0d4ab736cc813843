//! Robots that are played: real states and samples over a real router, with made-up poses. As many agents would need
//! more than a small machine has.

#![allow(dead_code)] // tests and measurements each use a part

use fleet_tests::{Fleet, eventually, name};
use std::f64::consts::FRAC_PI_2;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use tokio::task::JoinHandle;
use xtb_bus::{Bus, SessionRole};
use xtb_protocol::codec::Format;
use xtb_protocol::keys::{Channel, FleetKeys};
use xtb_protocol::messages::{RobotState, Sensors};

/// Robots `car-0`, `car-1`, … that go round in circles, as far as anybody can tell: a state of each `every` so long,
/// samples half as often. `change` makes some of them special.
pub(crate) async fn crowd(
    fleet: &Fleet,
    robots: usize,
    every: Duration,
    change: fn(usize, &mut RobotState),
) -> JoinHandle<()> {
    let role = SessionRole::Client { connect: vec![fleet.simulator.endpoint().to_owned()] };
    let bus = xtb_bus::open(&role).await.unwrap();
    let state = fleet.state(1).await;
    let sensors = sensors(&bus, fleet).await;
    tokio::spawn(async move {
        let keys = FleetKeys::new(name("lab"));
        let mut players = Vec::new();
        for number in 0..robots {
            let robot = name(&format!("car-{number}"));
            let keys = keys.robot(&robot);
            let states =
                bus.publisher::<RobotState>(&keys.state(), &Channel::State, Format::Postcard).await.unwrap();
            let samples =
                bus.publisher::<Sensors>(&keys.sensors(), &Channel::Sensors, Format::Postcard).await.unwrap();
            let token = bus.declare_alive(&keys.alive()).await.unwrap();
            players.push((robot, states, samples, token));
        }
        let mut tick = tokio::time::interval(every);
        for n in 0_u64.. {
            tick.tick().await;
            for (number, (robot, states, samples, _)) in players.iter().enumerate() {
                let mut state = on_circle(&state, robot, number, n);
                change(number, &mut state);
                let _ = states.put(&state).await;
                if (n + number as u64).is_multiple_of(2) {
                    let _ = samples.put(&seeing(&sensors, &state)).await;
                }
            }
        }
    })
}

fn on_circle(template: &RobotState, robot: &xtb_protocol::Name, number: usize, n: u64) -> RobotState {
    let mut state = template.clone();
    let angle = n as f64 * 0.01 + number as f64;
    let (cx, cy) = ((number % 10) as f64 * 1.5, (number / 10) as f64 * 1.5);
    (state.robot, state.seq, state.tick_ms) = (robot.clone(), n, n * 50);
    (state.pose.x_m, state.pose.y_m) = (cx + 0.5 * angle.cos(), cy + 0.5 * angle.sin());
    state.pose.yaw_rad = angle + FRAC_PI_2;
    state.speed_mps = Some(0.1);
    state.reference_rpm = 12.0;
    state
}

fn seeing(template: &Sensors, state: &RobotState) -> Sensors {
    let mut sensors = template.clone();
    (sensors.robot, sensors.tick_ms) = (state.robot.clone(), state.tick_ms);
    sensors.ir_front_cm = vec![Some(40.0), Some(35.0), Some(30.0), None, Some(60.0), None];
    sensors
}

/// One of the real robot's samples.
async fn sensors(bus: &Bus, fleet: &Fleet) -> Sensors {
    let heard = Arc::<Mutex<Option<Sensors>>>::default();
    let into = Arc::clone(&heard);
    let key = fleet.robot(1).sensors();
    let _listening =
        bus.subscribe(&key, move |incoming| *into.lock().unwrap() = incoming.decode().ok()).await.unwrap();
    eventually("samples", || async { heard.lock().unwrap().clone() }).await
}
