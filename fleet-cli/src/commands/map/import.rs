//! `map import`: a world or a map as map_server files.

use super::size;
use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::map_file;
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::map::ros::Files;
use xtb_protocol::messages::MapHash;

/// Arguments of `map import`.
#[derive(Debug, Clone, Args)]
pub struct MapImportArgs {
    /// World (TOML) or map (map_server YAML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// YAML file to write; the image is written next to it, with the extension .pgm.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Overwrite existing files.
    #[arg(long)]
    pub force: bool,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// What was written.
#[derive(Debug, Serialize, JsonSchema)]
struct Written<'a> {
    yaml: &'a Path,
    image: &'a Path,
    name: &'a str,
    hash: MapHash,
    width: usize,
    height: usize,
    resolution_m: f64,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Written<'_>>];

/// Reads, and writes YAML and PGM.
///
/// # Errors
/// A file that cannot be read or written, or is there already.
pub(super) fn run(ctx: &Context, args: &MapImportArgs) -> Result<Exit> {
    let map = map_file::read(&args.file, args.fine.resolution_m)?;
    let yaml = &args.out;
    if !matches!(yaml.extension().and_then(|ending| ending.to_str()), Some("yaml" | "yml")) {
        let message = format!("{} does not have the extension .yaml", yaml.display());
        return Err(Error::new(ErrorKind::Invalid, message).hint(
            "--out is the YAML file; the image is written \
            next to it",
        ));
    }
    let image = yaml.with_extension("pgm");
    let beside = PathBuf::from(image.file_name().unwrap_or_default());
    let failed = |error: &dyn std::fmt::Display| Error::new(ErrorKind::Failed, error.to_string());
    let files = Files::of(&map, &beside.to_string_lossy()).map_err(|error| failed(&error))?;
    for path in [yaml, &image] {
        if path.exists() && !args.force {
            return Err(Error::new(ErrorKind::Failed, format!("{} already exists", path.display()))
                .hint("--force overwrites it"));
        }
    }
    write(&image, &files.image)?;
    write(yaml, files.yaml.as_bytes())?;
    let (width, height) = (map.grid().width(), map.grid().height());
    let resolution_m = map.grid().resolution_m();
    let written =
        Written { yaml, image: &image, name: map.name(), hash: map.hash(), width, height, resolution_m };
    ctx.out.result(&written, |written| {
        let (yaml, image) = (yaml.display(), image.display());
        format!("wrote {yaml} and {image}: {}, {}, {}", written.name, size(&map), written.hash)
    })?;
    Ok(Exit::Done)
}

fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    std::fs::write(path, bytes).map_err(|error| {
        Error::new(ErrorKind::Failed, format!("cannot write {}: {error}", path.display()))
            .hint("--out needs a file in an existing folder")
    })
}
