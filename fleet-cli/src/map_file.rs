//! Maps from files: as map_server writes them, or drawn from a world.

use robot_agent::files::{self, FileError};
use std::path::Path;
use std::time::Duration;
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::Map;
use xtb_nav::map::ros::Description;
use xtb_protocol::messages::is_map_name;
use xtb_services::map_server::MapService;
use xtb_sim::World;

/// How often a served file is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Reads a map (YAML and image) or draws a world (TOML) in cells of `resolution_m`.
///
/// # Errors
/// [`ErrorKind::Config`]: a file cannot be read, or is no map and no world.
pub(crate) fn read(path: &Path, resolution_m: f64) -> Result<Map> {
    let broken = |reason: String| Error::new(ErrorKind::Config, format!("{}: {reason}", path.display()));
    let text = files::text(path, files::MAX_TEXT).map_err(|error| unreadable(path, &error))?;
    let named = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match named {
        "toml" => {
            let hint = "worlds/ has examples; for a large world use larger cells with --resolution";
            let world = World::from_toml(&text).map_err(|error| broken(error.to_string()).hint(hint))?;
            let world = named_by_file(world, path);
            world.chart(resolution_m).map_err(|error| broken(error.to_string()).hint(hint))
        }
        "yaml" | "yml" => {
            let hint = "docs/maps.md describes the supported maps";
            let description =
                Description::from_yaml(&text).map_err(|error| broken(error.to_string()).hint(hint))?;
            let image_path = path.parent().unwrap_or(Path::new("")).join(description.image());
            let image = files::bytes(&image_path, files::MAX_IMAGE)
                .map_err(|error| unreadable(&image_path, &error))?;
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("map");
            description.map(stem, &image).map_err(|error| broken(error.to_string()).hint(hint))
        }
        _ => Err(broken("neither a map nor a world, judging by the extension".to_owned())
            .hint("maps have the extension .yaml (as written by map_server), worlds .toml")),
    }
}

/// Whoever changes the file's places changes those that are served; for another floor or other zones the server is to
/// be started again, and says so.
pub(crate) async fn follow(path: &Path, resolution_m: f64, served: &Map, service: &MapService) {
    let changed = || std::fs::metadata(path).and_then(|file| file.modified()).ok();
    let (mut seen, mut places) = (changed(), served.places().to_vec());
    let mut tick = tokio::time::interval(LOOK_EVERY);
    loop {
        tick.tick().await;
        let now = changed();
        if now == seen || now.is_none() {
            continue;
        }
        seen = now;
        match read(path, resolution_m) {
            Ok(map) if map.hash() != served.hash() => {
                tracing::warn!(
                    "{}: its floor or its zones are others now; start again to serve them",
                    path.display()
                );
            }
            Ok(map) if map.places() != places => {
                places = map.places().to_vec();
                tracing::info!("{}: {} places", path.display(), places.len());
                service.set_places(places.clone());
            }
            Ok(_) => {}
            Err(error) => tracing::warn!("{error}; its places stay as they were"),
        }
    }
}

/// A world without a name is called as its file is, as a map is.
pub(crate) fn named_by_file(world: World, path: &Path) -> World {
    match path.file_stem().and_then(|stem| stem.to_str()).filter(|stem| is_map_name(stem)) {
        Some(stem) => world.or_named(stem),
        None => world,
    }
}

fn unreadable(path: &Path, error: &FileError) -> Error {
    Error::new(ErrorKind::Config, format!("cannot read {}: {error}", path.display()))
        .hint("a map is a YAML file and the image named in it; worlds/ has worlds")
}
