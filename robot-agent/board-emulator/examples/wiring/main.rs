//! Draws the wiring of docs/build-a-truck.md, with the pins of the firmware's own source.
//!
//! ```sh
//! cargo run -p xtb-board-emulator --example wiring -- docs/images
//! ```

#![allow(clippy::print_stderr)] // an example's output

mod board;
mod pins;
mod power;
mod svg;

use std::path::PathBuf;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Some(folder) = std::env::args_os().nth(1).map(PathBuf::from) else {
        eprintln!("usage: wiring FOLDER");
        return ExitCode::from(2);
    };
    for (name, drawing) in [("wiring.svg", board::draw(&pins::of_firmware())), ("power.svg", power::draw())] {
        if let Err(error) = std::fs::write(folder.join(name), drawing) {
            eprintln!("error: {}: {error}", folder.join(name).display());
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}
