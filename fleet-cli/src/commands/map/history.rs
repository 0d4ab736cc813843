//! `map history`: the versions of a map, with who made them, when and why.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use clap::Args;
use std::path::PathBuf;
use std::time::{Duration, UNIX_EPOCH};
use xtb_client::client::Client;
use xtb_client::{Error, ErrorKind, Result, map_edit};
use xtb_protocol::messages::{MapHistory, MapVersion};
use xtb_services::map_server::MapVersions;

/// The last moment that can be written, in ms since 1970: the end of the year 9999.
const LAST_MS: u64 = 253_402_300_799_000;

/// Arguments of `map history`.
#[derive(Debug, Clone, Args)]
pub struct MapHistoryArgs {
    /// Map (map_server YAML) or world (TOML) [default: the fleet's map].
    #[arg(value_name = "FILE")]
    pub file: Option<PathBuf>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<MapHistory>];

/// Prints them, the newest last.
///
/// # Errors
/// A history that cannot be read, no router, or nobody who serves a map.
pub(super) async fn run(ctx: &Context, args: &MapHistoryArgs) -> Result<Exit> {
    let history = match &args.file {
        Some(file) => {
            let read = MapVersions::open(&MapVersions::beside(file))
                .map_err(|error| Error::new(ErrorKind::Config, error.to_string()))?;
            MapHistory { name: file.display().to_string(), stored: true, versions: read.versions() }
        }
        None => {
            let client = Client::open(&ctx.settings).await?;
            let history = map_edit::history(&client).await;
            client.close().await;
            history?
        }
    };
    ctx.out.result(&history, text)?;
    Ok(Exit::Done)
}

fn text(history: &MapHistory) -> String {
    if history.versions.is_empty() {
        return format!(
            "{}: no history; it begins with the first change through the map server",
            history.name
        );
    }
    let by = history.versions.iter().map(|version| version.by.as_str().len()).max().unwrap_or(0);
    let line = |version: &MapVersion| {
        let at = UNIX_EPOCH + Duration::from_millis(version.at_ms.min(LAST_MS));
        let at = humantime::format_rfc3339_seconds(at);
        format!("{:4}  {at}  {:by$}  {}", version.number, version.by, version.why)
    };
    let lines = history.versions.iter().map(line).collect::<Vec<_>>().join("\n");
    match history.stored {
        true => lines,
        false => format!("{lines}\nchanges of this map end with the program that serves it"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_protocol::Name;
    use xtb_protocol::messages::{MapContent, MapHash};

    #[test]
    fn each_version_is_a_line_with_who_when_and_why() {
        let content = MapContent { map: MapHash::new(1), places: MapHash::new(2) };
        let version = |number, by: &str, why: &str| {
            let (by, why) = (Name::new(by).unwrap(), why.to_owned());
            MapVersion { number, at_ms: 1_700_000_000_000, by, why, content }
        };
        let versions = vec![version(1, "file", "as found"), version(2, "web-alice-3f9a1c", "a crane")];
        let history = MapHistory { name: "lab".to_owned(), stored: false, versions };
        let expected = "   1  2023-11-14T22:13:20Z  file              as found\n   \
                        2  2023-11-14T22:13:20Z  web-alice-3f9a1c  a crane\n\
                        changes of this map end with the program that serves it";
        assert_eq!(text(&history), expected);
        assert!(text(&MapHistory { versions: Vec::new(), ..history }).contains("no history"));
    }
}
