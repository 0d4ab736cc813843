//! The world that a simulator has: from its file, or from a map.

use crate::map_file;
use crate::output::Output;
use robot_agent::files;
use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_sim::{MAP_RESOLUTION_M, World};

/// Reads a world, or makes one of a map.
///
/// # Errors
/// The file cannot be read, or the world is impossible.
pub(crate) fn read_world(out: &Output, path: &Path) -> Result<World> {
    if matches!(path.extension().and_then(|ending| ending.to_str()), Some("yaml" | "yml")) {
        let map = map_file::load(out, path, MAP_RESOLUTION_M)?;
        return World::of_map(&map).map_err(|error| {
            Error::new(ErrorKind::Config, format!("{}: {error}", path.display()))
                .hint("docs/simulator.md says what a world can be made of")
        });
    }
    let text = files::text(path, files::MAX_TEXT).map_err(|error| {
        Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display()))
            .hint("worlds/ has examples")
    })?;
    let world = World::from_toml(&text).map_err(|error| {
        Error::new(ErrorKind::Config, format!("{}: {error}", path.display())).hint("worlds/ has examples")
    })?;
    Ok(map_file::named_by_file(world, path))
}
