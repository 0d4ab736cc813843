//! Hands the linker the memory of the chip.

use std::path::PathBuf;
use std::{env, fs, io};

fn main() -> io::Result<()> {
    let pico2 = env::var_os("CARGO_FEATURE_PICO2").is_some();
    let memory = if pico2 { "rp235x.x" } else { "rp2040.x" };
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::copy(memory, out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed={memory}");
    println!("cargo:rustc-link-arg-bins=--nmagic");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    if !pico2 {
        println!("cargo:rustc-link-arg-bins=-Tlink-rp.x");
    }
    Ok(())
}
