//! An hour of virtual fleet time, recorded and played: the figures of docs/fleet-recordings.md.
//! `cargo run -p fleet-tests --example hour [ROBOTS] [MINUTES]`
//!
//! Whole robots on whole trucks in lockstep, half of them wander, half drive to planned goals; what they
//! would publish goes through the same recorder, files and player as over Zenoh.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use fleet_cli::recording::playback_worker::{PlaySettings, PlaybackWorker};
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::path::Path;
use std::time::{Duration, Instant};
use xtb_bus::Incoming;
use xtb_client::subscription::Item;
use xtb_control::VehicleConfig;
use xtb_protocol::codec::{Format, encode, encoding};
use xtb_protocol::keys::FleetKeys;
use xtb_protocol::messages::{Body, FleetMap, LinkLoss, Message, Request, Via};
use xtb_protocol::{Name, Uuid};
use xtb_recording::fleet::mcap_writer::{McapSettings, McapWriter};
use xtb_recording::fleet::recorder::Recorder;
use xtb_sim::{Lockstep, Simulation, TruckParameters, World};

/// 2026-01-01 in ns since 1970: any would do.
const BEGAN_NS: u64 = 1_767_225_600_000_000_000;
const STATE_EVERY_NS: u64 = 50_000_000;
/// Goals are at least this far from the walls.
const WALL_M: f64 = 1.0;
const FLUSH_EVERY_NS: u64 = 1_000_000_000;

fn main() {
    let number = |n, default: u64| std::env::args().nth(n).map_or(default, |text| text.parse().unwrap());
    let (robots, minutes) = (number(1, 4) as usize, number(2, 60));
    let folder = std::env::temp_dir().join(format!("xtb-hour-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("hour.mcap");
    let began = Instant::now();
    let (writing, messages) = record(&path, robots, minutes);
    let whole = began.elapsed();
    let bytes = std::fs::metadata(&path).unwrap().len();
    let robot_hours = robots as f64 * minutes as f64 / 60.0;
    println!("{robots} robots, {minutes} min: {messages} messages, {:.1} MB", bytes as f64 / 1e6);
    println!("{:.1} MB a robot-hour", bytes as f64 / 1e6 / robot_hours);
    println!(
        "written in {:.1} s (and simulated in {:.1} s)",
        writing.as_secs_f64(),
        (whole - writing).as_secs_f64()
    );
    play(&path, minutes * 30_000);
    std::fs::remove_dir_all(&folder).unwrap();
}

/// Time that recorder and files took, and how many messages they kept.
fn record(path: &Path, robots: usize, minutes: u64) -> (Duration, u64) {
    let mut fleet = Drive::new(robots);
    let settings = McapSettings {
        path: path.to_owned(),
        force: true,
        max_bytes: u64::MAX,
        fleet: "lab".into(),
        keys: Vec::new(),
    };
    let mut writer = McapWriter::create(settings, BEGAN_NS).unwrap();
    let mut recorder = Recorder::default();
    let mut took = Duration::ZERO;
    let (mut next_ns, mut flush_ns) = (0, 0);
    while fleet.lockstep.now().ns() < minutes * 60_000_000_000 {
        fleet.lockstep.step();
        let now_ns = fleet.lockstep.now().ns();
        if now_ns < next_ns {
            continue;
        }
        next_ns += STATE_EVERY_NS;
        let items = fleet.said();
        let began = Instant::now();
        for item in &items {
            writer.write(recorder.take(BEGAN_NS + now_ns, item)).unwrap();
        }
        if now_ns >= flush_ns {
            flush_ns += FLUSH_EVERY_NS;
            let counts = recorder.counts();
            writer.flush(&mut recorder, counts, BEGAN_NS + now_ns).unwrap();
        }
        took += began.elapsed();
    }
    writer.finish(recorder.counts()).unwrap();
    (took, recorder.counts().messages)
}

fn play(path: &Path, middle_ms: u64) {
    let began = Instant::now();
    let playing = PlaybackWorker::open(path, PlaySettings { speed: 1e9, ..Default::default() }).unwrap();
    wait(|| playing.status().ended);
    let status = playing.status();
    assert_eq!((status.unreadable, status.failed), (0, None));
    println!("played from end to end in {:.1} s", began.elapsed().as_secs_f64());
    playing.pause(true);
    let began = Instant::now();
    playing.seek(middle_ms);
    wait(|| playing.status().caught_up);
    println!("went to the middle in {:.1} s", began.elapsed().as_secs_f64());
}

fn wait(mut is: impl FnMut() -> bool) {
    while !is() {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// A fleet in a room for all.
struct Drive {
    lockstep: Lockstep,
    keys: FleetKeys,
    names: Vec<Name>,
    map: Option<FleetMap>,
    /// Where it begins and how long it is, along x and y.
    room_m: [(f64, f64); 2],
    dice: Pcg32,
    asked: u128,
    turn: u64,
}

impl Drive {
    fn new(robots: usize) -> Self {
        let parameters = TruckParameters::default();
        let names: Vec<String> = (1..=robots).map(|n| format!("xtb-{n}")).collect();
        let world = World::for_robots(robots, &parameters.body);
        let map = world.to_map(0.05).unwrap();
        let grid = map.grid();
        let span_m = |origin_m: f64, cells: usize| (origin_m, cells as f64 * grid.resolution_m());
        let room_m = [span_m(grid.origin_m()[0], grid.width()), span_m(grid.origin_m()[1], grid.height())];
        let simulation = Simulation::new(world, &parameters, &names, 1).unwrap();
        let lab = Name::new("lab").unwrap();
        let mut lockstep = Lockstep::new(simulation, &lab, &VehicleConfig::default()).unwrap();
        lockstep.set_map(&map);
        for _ in 0..100 {
            lockstep.step();
        }
        let names = names.iter().map(|name| Name::new(name).unwrap()).collect();
        let (keys, map) = (FleetKeys::new(lab), Some(FleetMap::from(&map)));
        let dice = Pcg32::new(1, 1);
        Self { lockstep, keys, names, map, room_m, dice, asked: 0, turn: 0 }
    }

    /// What everybody says now: states at 20 Hz, samples at 10 Hz, the map and presence once.
    fn said(&mut self) -> Vec<Item> {
        let mut items: Vec<Item> = self.map.take().iter().map(|map| item(self.keys.map(), map)).collect();
        for index in 0..self.names.len() {
            let keys = self.keys.robot(&self.names[index]);
            let state = self.lockstep.state(index).unwrap();
            if self.turn == 0 {
                items.push(Item::Presence(keys.alive(), true));
            }
            if state.goal.as_ref().is_none_or(|goal| goal.status.is_final()) {
                self.send(index);
            }
            items.push(item(keys.state(), &state));
            let now = self.lockstep.now();
            if self.turn.is_multiple_of(2) {
                let sensors = self.lockstep.robot_mut(index).and_then(|robot| robot.sensors(now));
                items.extend(sensors.map(|sensors| item(keys.sensors(), &sensors)));
            }
        }
        self.turn += 1;
        items
    }

    /// Every other robot wanders for minutes, the others drive to some point along a planned path.
    fn send(&mut self, index: usize) {
        let (on_link_loss, finish_s) = (LinkLoss::Finish, 300.0);
        let [x_m, y_m] = self.room_m.map(|(from_m, long_m)| {
            let part = f64::from(self.dice.next_u32()) / f64::from(u32::MAX);
            from_m + WALL_M + part * (long_m - 2.0 * WALL_M)
        });
        let body = match index % 2 {
            0 => Body::Wander { for_s: Some(240.0), on_link_loss, finish_s },
            _ => Body::Goto { x_m, y_m, yaw_rad: None, via: Some(Via::Planned), on_link_loss, finish_s },
        };
        self.asked += 1;
        let request = Request { id: Uuid::from_u128(self.asked), lease: None, body };
        self.lockstep.request(index, &Name::new("hour").unwrap(), &request);
    }
}

fn item<M: Message>(key: String, message: &M) -> Item {
    let payload = encode(message, Format::Postcard).unwrap();
    Item::Message(Incoming { key, encoding: encoding::<M>(Format::Postcard), payload })
}
