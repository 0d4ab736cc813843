//! The drawings of docs/navigation.md: a plan in a cluttered room, and a run among things that are not on
//! the map, the whole robot on the whole vehicle. `cargo run -p xtb-sim --example pictures` writes
//! docs/images/plan.svg and docs/images/run.svg; both are the same on every machine.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

#[path = "drawing/mod.rs"]
mod drawing;
#[allow(dead_code)]
#[path = "../tests/it/drive.rs"]
mod drive;
#[path = "pictures/plan.rs"]
mod plan;
#[path = "pictures/run.rs"]
mod run;

use std::path::Path;

fn main() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/images");
    plan::draw(&folder.join("plan.svg"));
    run::draw(&folder.join("run.svg"));
}
