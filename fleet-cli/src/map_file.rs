//! Maps from files: as map_server writes them, or drawn from a world; and changes of them.

mod write;

pub(crate) use write::write;

use crate::output::Output;
use robot_agent::files::{self, FileError};
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::path::{Path, PathBuf};
use std::time::Duration;
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::Map;
use xtb_nav::map::ros::Description;
use xtb_protocol::messages::is_map_name;
use xtb_services::map_server::{KeptMap, MapService, MapStore, MapVersions};
use xtb_sim::World;

/// How often a served file is looked at.
const LOOK_EVERY: Duration = Duration::from_secs(1);

/// Reads a map (YAML and image) or draws a world (TOML) in cells of `resolution_m`.
///
/// # Errors
/// [`ErrorKind::Config`]: a file cannot be read, or is no map and no world.
pub(crate) fn read(path: &Path, resolution_m: f64) -> Result<Map> {
    read_closely(path, resolution_m).map(|(map, _)| map)
}

/// The same to be used: with a warning on standard error about what is doubtful.
///
/// # Errors
/// As [`read`].
pub(crate) fn load(out: &Output, path: &Path, resolution_m: f64) -> Result<Map> {
    let (map, doubt) = read_closely(path, resolution_m)?;
    if let Some(Doubt { text, hint }) = doubt {
        out.note(&format!("warning: {}: {text}\nhint: {hint}", path.display()));
    }
    Ok(map)
}

/// What is probably not meant so.
#[derive(Debug)]
pub(crate) struct Doubt {
    /// In words.
    pub(crate) text: String,
    /// What to do about it.
    pub(crate) hint: &'static str,
}

fn doubt(description: &Description, image: &[u8]) -> Option<Doubt> {
    // An image that cannot be read is refused where the map is made.
    let cells = description.unknown_as_free(image).ok().filter(|cells| *cells > 0)?;
    let free_thresh = description.free_thresh();
    Some(Doubt {
        text: format!(
            "{cells} cells that map_saver has written as unknown are free by free_thresh {free_thresh}"
        ),
        hint: "free_thresh 0.196 leaves them unknown",
    })
}

/// As [`read`], with what is doubtful about it.
///
/// # Errors
/// As [`read`].
pub(crate) fn read_closely(path: &Path, resolution_m: f64) -> Result<(Map, Option<Doubt>)> {
    let broken = |reason: String| Error::new(ErrorKind::Config, format!("{}: {reason}", path.display()));
    let text = files::text(path, files::MAX_TEXT).map_err(|error| unreadable(path, &error))?;
    let named = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    match named {
        "toml" => {
            let hint = "worlds/ has examples; for a large world use larger cells with --resolution";
            let world = World::from_toml(&text).map_err(|error| broken(error.to_string()).hint(hint))?;
            let world = named_by_file(world, path);
            let map = world.to_map(resolution_m).map_err(|error| broken(error.to_string()).hint(hint))?;
            Ok((map, None))
        }
        "yaml" | "yml" => {
            if is_instance(&text) {
                return Err(broken("an instance of `fleet-cli plan`, neither a map nor a world".to_owned())
                    .hint(format!("`fleet-cli plan {} --out FILE` plans it", path.display())));
            }
            let hint = "docs/maps.md describes the supported maps";
            let description =
                Description::from_yaml(&text).map_err(|error| broken(error.to_string()).hint(hint))?;
            let image_path = path.parent().unwrap_or(Path::new("")).join(description.image());
            let image = files::bytes(&image_path, files::MAX_IMAGE)
                .map_err(|error| unreadable(&image_path, &error))?;
            let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("map");
            let doubt = doubt(&description, &image);
            let map = description.map(stem, &image).map_err(|error| broken(error.to_string()).hint(hint))?;
            Ok((map, doubt))
        }
        _ => Err(broken("neither a map nor a world, judging by the extension".to_owned())
            .hint("maps have the extension .yaml (as written by map_server), worlds .toml")),
    }
}

/// Whether a file of this text is probably an instance of `plan`.
fn is_instance(text: &str) -> bool {
    #[derive(Deserialize)]
    struct WithAgents {
        #[serde(rename = "agents")]
        _agents: Vec<IgnoredAny>,
    }
    serde_saphyr::from_str::<WithAgents>(text).is_ok()
}

/// A map or a world on the disk, which is changed through the map server.
struct MapFile {
    path: PathBuf,
    resolution_m: f64,
}

impl MapStore for MapFile {
    fn read(&mut self) -> std::result::Result<Map, String> {
        read(&self.path, self.resolution_m).map_err(|error| error.to_string())
    }

    fn write(&mut self, map: &Map) -> std::result::Result<(), String> {
        write(&self.path, Some(map.zones()), map.places()).map_err(|error| error.to_string())
    }
}

/// Where the map of this file and its history are kept, for whoever serves it.
///
/// # Errors
/// [`ErrorKind::Config`]: there is a history that cannot be read.
fn kept(path: &Path, resolution_m: f64) -> Result<KeptMap> {
    let history = MapVersions::beside(path);
    let history = MapVersions::open(&history).map_err(|error| {
        Error::new(ErrorKind::Config, error.to_string())
            .hint("move it away to begin another history of the map")
    })?;
    Ok(KeptMap { store: Box::new(MapFile { path: path.to_owned(), resolution_m }), history })
}

/// A map and where it and its history are kept, for whoever serves it.
///
/// # Errors
/// As [`load`] and [`kept`].
pub(crate) fn to_serve(out: &Output, path: &Path, resolution_m: f64) -> Result<(Map, KeptMap)> {
    Ok((load(out, path, resolution_m)?, kept(path, resolution_m)?))
}

/// As [`follow`] where a file's map is served; else it never ends.
pub(crate) async fn follow_if_any(path: Option<&Path>, resolution_m: f64, service: Option<&MapService>) {
    match (path, service) {
        (Some(path), Some(service)) => follow(path, resolution_m, service).await,
        _ => std::future::pending().await,
    }
}

/// Whoever changes the file's zones and places changes those that are served.
pub(crate) async fn follow(path: &Path, resolution_m: f64, service: &MapService) {
    let changed = || std::fs::metadata(path).and_then(|file| file.modified()).ok();
    let (mut seen, mut broken) = (changed(), None);
    let mut tick = tokio::time::interval(LOOK_EVERY);
    loop {
        tick.tick().await;
        let now = changed();
        if now == seen || now.is_none() {
            continue;
        }
        match read(path, resolution_m) {
            Ok(map) => {
                seen = now;
                service.file_holds(map).await;
            }
            // It may be half written: it is read again.
            Err(error) if std::mem::replace(&mut broken, now) != now => {
                tracing::warn!("{error}; the map stays as it was");
            }
            Err(_) => {}
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
