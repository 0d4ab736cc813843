//! The table and the drawing of docs/navigation.md, docs/images/room-of-ten.svg: several robots and traffic control, the whole robots on the whole
//! vehicles. `cargo run -p xtb-chaos --example together [SEEDS] [FIRST] [SCENE]`; with
//! `SHOW=5` everybody is shown each 5 s

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[allow(dead_code)]
#[path = "../../sim/examples/drawing/mod.rs"]
mod drawing;
#[allow(dead_code)]
#[path = "../../sim/tests/it/drive.rs"]
mod drive;
#[allow(dead_code)]
#[path = "../tests/it/meetings.rs"]
mod meetings;
#[path = "together/plot.rs"]
mod plot;

use drive::Drive;
use meetings::{Door, Meeting, Trouble, circle, narrow};
use std::path::Path;

fn main() {
    let argument = |n| std::env::args().nth(n);
    let number = |n, default| argument(n).and_then(|text| text.parse().ok()).unwrap_or(default);
    let seeds = number(2, 1)..number(2, 1) + number(1, 3);
    let wanted = argument(3);
    println!("| scene | seed | reached | contacts | stood | waited | took | |");
    println!("| --- | ---: | ---: | ---: | ---: | ---: | ---: | --- |");
    for (name, rounds, trouble) in [
        ("four", 1, Trouble::None),
        ("ten", 1, Trouble::None),
        ("ten-restart", 1, Trouble::Restart),
        ("ten-loss", 1, Trouble::Loss),
        ("door", 20, Trouble::None),
        ("door-death", 1, Trouble::Death),
        ("door-latch", 1, Trouble::Latch),
        ("door-restart", 2, Trouble::Restart),
        ("door-loss", 5, Trouble::Loss),
        ("narrow", 1, Trouble::None),
        ("narrow-restart", 1, Trouble::Restart),
        ("narrow-loss", 1, Trouble::Loss),
    ] {
        if wanted.as_ref().is_some_and(|wanted| wanted != name) {
            continue;
        }
        for seed in seeds.clone() {
            let every_s: Option<f64> = std::env::var("SHOW").ok().and_then(|text| text.parse().ok());
            let mut trouble = trouble.meddle();
            let mut meddle = |drive: &mut Drive, at_s: f64| {
                if every_s.is_some_and(|every_s| (at_s / every_s).fract() < 0.19 / every_s) {
                    println!("{at_s:.1} s\n{}", meetings::scene(drive));
                }
                trouble(drive, at_s);
            };
            let mut door = name.starts_with("door").then(|| Door::new(seed));
            for _ in 0..rounds {
                let made = match &mut door {
                    Some(door) => door.round(&mut meddle),
                    None if name == "four" => circle(4, seed, &mut meddle),
                    None if name.starts_with("ten") => circle(10, seed, &mut meddle),
                    None => narrow(seed, &mut meddle),
                };
                row(name, seed, &made);
            }
        }
    }
    if wanted.is_none_or(|wanted| wanted == "plot") {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/images/room-of-ten.svg");
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        plot::draw(&path, &circle(10, 1, &mut |_, _| {}));
        println!("\n{}", path.canonicalize().unwrap().display());
    }
}

fn row(name: &str, seed: u64, made: &Meeting) {
    let Meeting { reached, contacts, stood_s, waited_s, took_s, stood_for, ends, .. } = made;
    let why = if *stood_s > 10.0 { stood_for } else { "" };
    println!(
        "| {name} | {seed} | {reached} of {} | {contacts} | {stood_s:.1} s | {waited_s:.1} s | {took_s:.0} s | {why} |",
        ends.len()
    );
    for touched in &made.touched {
        println!("  {touched}");
    }
    if *reached < ends.len() {
        println!("  {ends:?}");
    }
}
