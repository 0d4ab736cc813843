//! A map of the robot's own, from a file.

use crate::{AgentError, files};
use std::path::Path;
use xtb_nav::map::{Map, ros};

/// Reads a map of ROS's map_server: the YAML file and the image that it names.
///
/// # Errors
/// [`AgentError::Map`], with the file and what is wrong with it.
pub(crate) fn read(path: &Path) -> Result<Map, AgentError> {
    let wrong = |path: &Path, reason: String| AgentError::Map { path: path.display().to_string(), reason };
    let text = files::text(path, files::MAX_TEXT).map_err(|error| wrong(path, error.to_string()))?;
    let header = ros::Description::from_yaml(&text).map_err(|error| wrong(path, error.to_string()))?;
    let image = path.parent().unwrap_or(Path::new("")).join(header.image());
    let bytes = files::bytes(&image, files::MAX_IMAGE).map_err(|error| wrong(&image, error.to_string()))?;
    let name = path.file_stem().map_or_else(|| "map".into(), |stem| stem.to_string_lossy());
    header.map(&name, &bytes).map_err(|error| wrong(&image, error.to_string()))
}
