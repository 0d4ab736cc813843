//! The table of docs/navigation.md: lifelong goals in narrow rooms at random, the whole robots on the whole
//! vehicles, with traffic control and alone. `cargo run -p xtb-chaos --example corridors [ROOMS] [FIRST SEED]
//! [SECONDS]`; with `ONLY=led` or `ONLY=alone` only these, with `SHOW=5` everybody is shown each 5 s. The exit
//! code is 1 if anything was touched, a room stood still for too long, a goal failed to which there was a way,
//! or traffic control reached too few.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../../sim/tests/it/draw.rs"]
mod draw;
#[allow(dead_code)]
#[path = "../../sim/tests/it/drive.rs"]
mod drive;
#[path = "corridors/judge.rs"]
mod judge;
#[allow(dead_code)]
#[path = "../tests/it/lifelong.rs"]
mod lifelong;
#[allow(dead_code)]
#[path = "../tests/it/meetings.rs"]
mod meetings;
#[allow(dead_code)]
#[path = "../tests/it/rooms.rs"]
mod rooms;

use judge::{Judge, Verdict};
use lifelong::{Fleet, Life};
use rooms::Room;
use std::process::ExitCode;

/// Longest standstill of a whole room, and longest time until somebody moves or a goal ends, in s.
const STOOD_MAX_S: f64 = 30.0;
/// Least part of what robots alone reach in a room.
const LEAST_PART: f64 = 0.9;

fn main() -> ExitCode {
    let argument = |n, default| std::env::args().nth(n).and_then(|text| text.parse().ok()).unwrap_or(default);
    let (rooms, first, seconds) = (argument(1, 5), argument(2, 1), argument(3, 300));
    let only = std::env::var("ONLY").ok();
    let runs = |name: &str| only.as_ref().is_none_or(|only| only == name);
    println!(
        "| seed | room | width | robots | reached | failed | wrongly | contacts | stood | alone: reached | failed | contacts | stood | part |"
    );
    println!(
        "| ---: | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    );
    let mut sum = Sum::default();
    for seed in first..first + rooms {
        let room = Room::of(seed);
        let led = if runs("led") { live(&room, seed, true, seconds) } else { Life::default() };
        let alone = if runs("alone") { live(&room, seed, false, seconds) } else { Life::default() };
        let judge = Judge::new(&room.world);
        let judged = led.failed.iter().filter(|_| only.is_none());
        let verdicts: Vec<Verdict> = judged.map(|failed| judge.of(failed)).collect();
        let wrongly = verdicts.iter().filter(|verdict| matches!(verdict, Verdict::Way { .. })).count();
        let part = f64::from(led.reached) / f64::from(alone.reached.max(1));
        println!(
            "| {seed} | {:?} | {:.2} m | {} | {} | {} | {wrongly} | {} | {:.1} s | {} | {} | {} | {:.1} s | {part:.2} |",
            room.kind,
            room.width_m,
            room.robots,
            led.reached,
            led.failed.len(),
            led.contacts,
            led.stood_s,
            alone.reached,
            alone.failed.len(),
            alone.contacts,
            alone.stood_s,
        );
        for (failed, verdict) in led.failed.iter().zip(&verdicts) {
            let goal = failed.goals[failed.robot];
            println!(
                "  {:.0} s xtb-{} to {goal:.2?}: {} ({verdict})",
                failed.at_s,
                failed.robot + 1,
                failed.reason
            );
        }
        led.touched.iter().chain(&alone.touched).for_each(|words| println!("  {words}"));
        sum.add(&led, &alone, wrongly, part);
    }
    sum.end(only.is_none())
}

fn live(room: &Room, seed: u64, led: bool, seconds: u64) -> Life {
    let every_s: Option<f64> = std::env::var("SHOW").ok().and_then(|text| text.parse().ok());
    if every_s.is_some() {
        println!("{}", room.world);
    }
    let mut fleet = Fleet::new(&room.world, room.robots, seed, led);
    let mut show = |fleet: &mut Fleet, at_s: f64| {
        if every_s.is_some_and(|every_s| (at_s / every_s).fract() < 0.19 / every_s) {
            println!("{at_s:.1} s\n{}", meetings::scene(&mut fleet.drive));
        }
    };
    fleet.run(seconds as f64, true, &mut show);
    fleet.life
}

/// Over all rooms.
#[derive(Debug, Default)]
struct Sum {
    rooms: u32,
    led: u32,
    alone: u32,
    failed: usize,
    alone_failed: usize,
    wrongly: usize,
    contacts: u64,
    alone_contacts: u64,
    stood_s: f64,
    alone_stood_s: f64,
    least_part: f64,
    rooms_below: u32,
    rooms_stood: u32,
}

impl Sum {
    fn add(&mut self, led: &Life, alone: &Life, wrongly: usize, part: f64) {
        self.least_part = if self.rooms == 0 { part } else { self.least_part.min(part) };
        self.rooms += 1;
        self.led += led.reached;
        self.alone += alone.reached;
        self.failed += led.failed.len();
        self.alone_failed += alone.failed.len();
        self.wrongly += wrongly;
        self.contacts += led.contacts;
        self.alone_contacts += alone.contacts;
        self.stood_s = self.stood_s.max(led.stood_s);
        self.alone_stood_s = self.alone_stood_s.max(alone.stood_s);
        self.rooms_below += u32::from(part < LEAST_PART);
        self.rooms_stood += u32::from(led.stood_s > STOOD_MAX_S);
    }

    fn end(&self, both: bool) -> ExitCode {
        println!(
            "| {} rooms | | | | {} | {} | {} | {} | {:.1} s | {} | {} | {} | {:.1} s | {:.2} at least |",
            self.rooms,
            self.led,
            self.failed,
            self.wrongly,
            self.contacts,
            self.stood_s,
            self.alone,
            self.alone_failed,
            self.alone_contacts,
            self.alone_stood_s,
            self.least_part,
        );
        println!(
            "\n{} rooms below {LEAST_PART} of what robots alone reach, {} stood still for more than {STOOD_MAX_S} s",
            self.rooms_below, self.rooms_stood
        );
        let few = both && (self.led < self.alone || self.rooms_below > 0);
        let breach = self.contacts > 0 || self.rooms_stood > 0 || self.wrongly > 0 || few;
        ExitCode::from(u8::from(breach))
    }
}
