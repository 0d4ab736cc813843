//! What is done with the firmware on a computer.
//!
//! ```text
//!   cargo xtask uf2              builds it, and writes the file that is dragged onto a Pico
//!   cargo xtask check [--long]   builds it, and checks it at its pins, in the emulator
//!   cargo xtask faults           plants faults into it, one after the other: each has to be caught
//! ```

mod elf;
mod faults;
mod uf2;

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::{env, fs};

const TARGET: &str = "thumbv6m-none-eabi";
const PACKAGE: &str = "xtb-firmware-pico";

/// What went wrong, for people.
type Failure = String;

fn main() -> ExitCode {
    let args: Vec<String> = env::args().skip(1).collect();
    let args: Vec<&str> = args.iter().map(String::as_str).collect();
    let done = match args.as_slice() {
        ["uf2"] => uf2(),
        ["check", options @ ..] => check(options),
        ["faults", only @ ..] => faults::run(&workspace(), only),
        _ => {
            Err("usage: cargo xtask uf2 | check [--long] [--seed N] [--only NAMES] | faults [NAME …]".into())
        }
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

/// The firmware's folder.
fn workspace() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap_or(Path::new(".")).to_owned()
}

/// Where cargo builds.
fn target_folder(workspace: &Path) -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace.join("target"), PathBuf::from)
}

/// Flags for the compiler, as cargo takes them, so that panic messages do not name this computer's folders: the same
/// source is the same firmware, wherever it is built.
fn without_folders(workspace: &Path) -> OsString {
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::var_os("HOME").map(|home| PathBuf::from(home).join(".cargo")));
    let registries = home.and_then(|home| fs::read_dir(home.join("registry/src")).ok()).into_iter().flatten();
    let folders = registries.flatten().map(|entry| (entry.path(), "registry"));
    let root = workspace.ancestors().nth(2).map(|root| (root.to_owned(), "xtb"));
    let mut flags = OsString::new();
    for (folder, name) in folders.chain(root) {
        let between = if flags.is_empty() { "" } else { "\u{1f}" };
        flags.push(format!("{between}--remap-path-prefix="));
        flags.push(folder);
        flags.push(format!("={name}"));
    }
    flags
}

/// Builds the firmware of a workspace: its ELF file.
fn build(workspace: &Path) -> Result<PathBuf, Failure> {
    let cargo = env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .current_dir(workspace)
        .args(["build", "--quiet", "--locked", "--release", "--package", PACKAGE, "--target", TARGET])
        .env("CARGO_ENCODED_RUSTFLAGS", without_folders(workspace))
        .status();
    match status {
        Ok(status) if status.success() => {
            Ok(target_folder(workspace).join(TARGET).join("release").join(PACKAGE))
        }
        Ok(_) => Err(format!("the firmware does not build; is the target there? rustup target add {TARGET}")),
        Err(error) => Err(format!("cargo does not start: {error}")),
    }
}

fn uf2() -> Result<bool, Failure> {
    let workspace = workspace();
    let elf = build(&workspace)?;
    let bytes = fs::read(&elf).map_err(|error| format!("{}: {error}", elf.display()))?;
    let program = elf::Program::read(&bytes).ok_or("the linker's file is not what was expected")?;
    let file = target_folder(&workspace).join("xtb-board-pico.uf2");
    let blocks = uf2::blocks(&program.image);
    fs::write(&file, &blocks).map_err(|error| format!("{}: {error}", file.display()))?;
    println!("{}", file.display());
    println!(
        "version {}, hash {:08x}, {} bytes of flash",
        env!("CARGO_PKG_VERSION"),
        program.hash,
        program.image.len()
    );
    Ok(true)
}

/// Runs the checks at the pins of a firmware; false if a row misses its limit.
fn pins(workspace: &Path, elf: &Path, options: &[&str], quiet: bool) -> Result<bool, Failure> {
    let emulator = workspace.join("emulator");
    if !emulator.join("node_modules/rp2040js").exists() {
        let installed = Command::new("npm")
            .current_dir(&emulator)
            .args(["ci", "--ignore-scripts", "--no-fund", "--no-audit", "--silent"])
            .status();
        if !installed.is_ok_and(|status| status.success()) {
            return Err("the emulator's packages were not installed: npm ci in emulator/".into());
        }
    }
    let mut node = Command::new("node");
    node.arg(emulator.join("check.mjs")).arg(elf).args(options);
    if quiet {
        return match node.output() {
            Ok(output) => Ok(output.status.success()),
            Err(error) => Err(format!("node does not start: {error}")),
        };
    }
    match node.status() {
        Ok(status) => Ok(status.success()),
        Err(error) => Err(format!("node does not start: {error}")),
    }
}

fn check(options: &[&str]) -> Result<bool, Failure> {
    let workspace = workspace();
    let elf = build(&workspace)?;
    pins(&workspace, &elf, options, false)
}
