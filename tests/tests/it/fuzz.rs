//! The fuzz targets on the stable toolchain: each from its corpus, then from seeded mutations of it.
//!
//! `XTB_FUZZ_SECONDS=60` goes on for that long, `XTB_FUZZ_SEED` begins elsewhere. Nothing is written:
//! an input that fails is printed as hexadecimal and belongs into the corpus, in `tests/src/fuzz/seeds.rs`.

use fleet_tests::fuzz::{Mutator, TARGETS, Target, corpus};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

fn number(variable: &str) -> Option<u64> {
    std::env::var(variable).ok().map(|text| text.parse().unwrap())
}

/// The files of a target's corpus in the order of their names.
fn files(target: &Target) -> Vec<(String, Vec<u8>)> {
    let folder = std::fs::read_dir(corpus().join(target.name)).unwrap();
    let mut files: Vec<_> = folder
        .map(|entry| entry.unwrap())
        .map(|entry| (entry.file_name().into_string().unwrap(), std::fs::read(entry.path()).unwrap()))
        .collect();
    files.sort();
    files
}

fn check(target: &Target, from: &str, input: &[u8]) -> bool {
    catch_unwind(AssertUnwindSafe(|| (target.check)(input))).unwrap_or_else(|_| {
        let hex: String = input.iter().map(|byte| format!("{byte:02x}")).collect();
        panic!("fuzz target {}, {from}: {} bytes: {hex}", target.name, input.len());
    })
}

#[allow(clippy::print_stderr)] // for those who measure
fn drive(name: &str) {
    let target = TARGETS.iter().find(|target| target.name == name).unwrap();
    let files = files(target);
    for (file, bytes) in &files {
        check(target, file, bytes);
    }
    let seed = number("XTB_FUZZ_SEED").unwrap_or(1);
    let seconds = number("XTB_FUZZ_SECONDS").map(Duration::from_secs);
    let mut inputs = Mutator::new(seed, files.into_iter().map(|(_, bytes)| bytes).collect());
    let (begin, mut rounds, mut accepted) = (Instant::now(), 0_u64, 0_u64);
    while seconds.map_or(rounds < target.rounds, |seconds| begin.elapsed() < seconds) {
        rounds += 1;
        let from = format!("seed {seed}, round {rounds}");
        accepted += u64::from(check(target, &from, &inputs.next_input()));
    }
    let rate = rounds as f64 / begin.elapsed().as_secs_f64();
    eprintln!("{name}: {rounds} inputs, {accepted} with something accepted, {rate:.0} a second");
    // Inputs that are all refused, or all accepted, would try only half of what is behind the door.
    assert!(accepted > rounds / 100 && accepted < rounds, "{accepted} of {rounds}");
}

#[test]
fn any_request_is_read_or_refused() {
    drive("command");
}

#[test]
fn any_question_to_the_dispatcher_is_read_or_refused() {
    drive("dispatch");
}

#[test]
fn any_setpoint_is_read_or_refused() {
    drive("teleop");
}

#[test]
fn any_emergency_stop_is_read_or_refused() {
    drive("estop");
}

#[test]
fn any_bytes_on_the_boards_line_leave_the_next_frame_readable() {
    drive("board");
}

#[test]
fn any_bytes_on_the_gyros_line_leave_the_next_frame_readable() {
    drive("gyro");
}

#[test]
fn any_fleet_config_is_read_or_refused() {
    drive("fleet_config");
}

#[test]
fn any_agent_config_is_read_or_refused() {
    drive("agent_config");
}

#[test]
fn any_pose_fix_is_read_or_refused() {
    drive("fix");
}

#[test]
fn any_route_is_read_or_refused() {
    drive("route");
}

#[test]
fn anything_from_a_robot_nearby_is_read_or_refused() {
    drive("near");
}

#[test]
fn any_word_of_traffic_control_is_read_or_refused() {
    drive("traffic");
}

#[test]
fn any_robot_state_is_read_or_refused() {
    drive("robot_state");
}

#[test]
fn any_fleet_map_is_read_or_refused() {
    drive("fleet_map");
}

#[test]
fn any_map_file_is_read_or_refused() {
    drive("ros_map");
}

#[test]
fn any_line_of_a_trace_is_read_or_refused() {
    drive("trace");
}

#[test]
fn the_corpus_holds_what_its_generator_makes_and_is_small() {
    let (mut count, mut size) = (0, 0);
    for target in TARGETS {
        let files = files(&target);
        for seed in (target.seeds)() {
            assert!(files.contains(&seed), "{}/{}: run the example fuzz_corpus", target.name, seed.0);
        }
        count += files.len();
        size += files.iter().map(|(_, bytes)| bytes.len()).sum::<usize>();
    }
    assert!(count <= 220 && size <= 300_000, "{count} files, {size} bytes");
}
