//! `map show`: a map as a picture in the terminal.

use super::picture::{Picture, arrow};
use super::{centimetres, rounded, size, size_m};
use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::map_file;
use crate::output::{Output, Tone};
use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use std::io::IsTerminal;
use std::path::PathBuf;
use xtb_client::client::Client;
use xtb_client::map_source;
use xtb_client::{Error, ErrorKind, Result};
use xtb_nav::{Cell, Map, Zone, ZoneKind};
use xtb_protocol::messages::MapHash;

/// Arguments of `map show`.
#[derive(Debug, Clone, Args)]
pub struct MapShowArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE", required_unless_present = "live")]
    pub file: Option<PathBuf>,
    /// The fleet's current map.
    #[arg(long, conflicts_with_all = ["file", "resolution_m"])]
    pub live: bool,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Where there is no terminal to fit.
const PAGE: (usize, usize) = (80, 50);
/// The shell's own line after the picture.
const PROMPT_LINES: usize = 1;
/// Below a picture: an empty line, and the scale after the legend.
const LINES_MORE: usize = 2;
/// Zones that the legend names.
const ZONES_NAMED: usize = 9;
/// Between picture and text.
const GAP: usize = 2;

/// What `--json` prints.
#[derive(Debug, Serialize, JsonSchema)]
struct Shown<'a> {
    name: &'a str,
    hash: MapHash,
    resolution_m: f64,
    origin_m: [f64; 2],
    width: usize,
    height: usize,
    size_m: [f64; 2],
    free_m2: f64,
    occupied_m2: f64,
    unknown_m2: f64,
    zones: &'a [Zone],
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Shown<'_>>];

/// Draws a file's map, or the fleet's.
///
/// # Errors
/// A file that is no map, no router, or nobody who serves a map.
pub(super) async fn run(ctx: &Context, args: &MapShowArgs) -> Result<Exit> {
    let maps = match &args.file {
        Some(file) => vec![map_file::read(file, args.fine.resolution_m)?],
        None => live(ctx).await?,
    };
    for map in &maps {
        ctx.out.result(&shown(map), |_| text(map, page(), &ctx.out))?;
    }
    if maps.len() > 1 && !ctx.out.json {
        ctx.out.note(&format!("warning: {} different maps are served to one fleet", maps.len()));
    }
    Ok(if maps.len() > 1 { Exit::Failed } else { Exit::Done })
}

/// The different maps that are served; one, if all is well.
async fn live(ctx: &Context) -> Result<Vec<Map>> {
    let client = Client::open(&ctx.settings).await?;
    let mut messages = map_source::served(client.bus(), client.keys(), ctx.settings.timeout).await?;
    client.close().await;
    messages.sort_by_key(|message| message.hash);
    messages.dedup_by_key(|message| message.hash);
    if messages.is_empty() {
        return Err(map_source::no_map());
    }
    let broken = |error: xtb_nav::map::wire::WireError| {
        Error::new(ErrorKind::Failed, format!("the served map cannot be used: {error}"))
    };
    messages.iter().map(|message| Map::try_from(message).map_err(broken)).collect()
}

fn page() -> (usize, usize) {
    let size = crossterm::terminal::size().ok().filter(|_| std::io::stdout().is_terminal());
    size.map_or(PAGE, |(columns, rows)| (usize::from(columns), usize::from(rows)))
}

/// Area of the cells of a kind.
fn area_m2(map: &Map, kind: Cell) -> f64 {
    let count = map.grid().cells().iter().filter(|cell| **cell == kind).count();
    rounded(count as f64 * map.grid().resolution_m() * map.grid().resolution_m())
}

fn shown(map: &Map) -> Shown<'_> {
    let grid = map.grid();
    Shown {
        name: map.name(),
        hash: map.hash(),
        resolution_m: grid.resolution_m(),
        origin_m: grid.origin_m(),
        width: grid.width(),
        height: grid.height(),
        size_m: size_m(map),
        free_m2: area_m2(map, Cell::Free),
        occupied_m2: area_m2(map, Cell::Occupied),
        unknown_m2: area_m2(map, Cell::Unknown),
        zones: map.zones(),
    }
}

/// The picture with the text beside it or below, whichever leaves more room for the picture.
fn text(map: &Map, (columns, rows): (usize, usize), out: &Output) -> String {
    let legend = legend(map, out);
    let widest = legend.iter().map(|(_, width)| *width).max().unwrap_or(0);
    let rows = rows.saturating_sub(PROMPT_LINES);
    let beside = Picture::fit(map, columns.saturating_sub(widest + GAP), rows);
    let below = Picture::fit(map, columns, rows.saturating_sub(legend.len() + LINES_MORE));
    let (picture, is_beside) = match (beside, below) {
        (Some(beside), Some(below)) if beside.cells_per_dot() <= below.cells_per_dot() => (beside, true),
        (Some(beside), None) => (beside, true),
        (_, Some(below)) => (below, false),
        (None, None) => return legend.into_iter().map(|(line, _)| line).collect::<Vec<_>>().join("\n"),
    };
    let mut lines = picture.lines(map, out);
    let scale =
        format!("a dot is {}, north is up", centimetres(picture.cells_per_dot() * map.grid().resolution_m()));
    let scale = out.paint(Tone::Dim, &scale);
    let legend = legend.into_iter().map(|(line, _)| line).chain([scale]);
    if !is_beside {
        lines.push(String::new());
        lines.extend(legend);
        return lines.join("\n");
    }
    let width = picture.columns();
    for (i, line) in legend.enumerate() {
        if i == lines.len() {
            lines.push(" ".repeat(width));
        }
        lines[i].push_str(&format!("{:GAP$}{line}", ""));
    }
    lines.join("\n")
}

/// The lines of text, and how wide each is.
fn legend(map: &Map, out: &Output) -> Vec<(String, usize)> {
    let mut lines = Vec::new();
    let mut line = |tone, text: String| {
        let width = text.chars().count();
        lines.push((out.paint(tone, &text), width));
    };
    let [x_m, y_m] = map.grid().origin_m();
    let [width_m, depth_m] = size_m(map);
    line(Tone::Strong, map.name().to_owned());
    line(Tone::Plain, size(map));
    line(Tone::Plain, format!("x {x_m:.2} to {:.2}, y {y_m:.2} to {:.2} m", x_m + width_m, y_m + depth_m));
    line(Tone::Plain, format!("{:.1} m² free", area_m2(map, Cell::Free)));
    line(Tone::Dim, format!("hash {}", map.hash()));
    line(Tone::Plain, String::new());
    line(Tone::Plain, "⣿ occupied".to_owned());
    if map.grid().cells().contains(&Cell::Unknown) {
        line(Tone::Dim, "· unknown".to_owned());
    }
    for zone in map.zones().iter().take(ZONES_NAMED) {
        match zone.kind() {
            ZoneKind::KeepOut => line(Tone::Bad, format!("▒ keep-out {}", zone.name())),
            ZoneKind::OneWay { heading_rad } => {
                line(Tone::Good, format!("{} one-way {}", arrow(heading_rad), zone.name()));
            }
        }
    }
    if map.zones().len() > ZONES_NAMED {
        line(Tone::Dim, format!("{} more zones", map.zones().len() - ZONES_NAMED));
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::map::raster;
    use xtb_nav::{Grid, MapPose};

    const PLAIN: Output = Output { json: false, colors: false };

    /// 4 × 2 m in cells of 5 cm, with a wall along its west side, a keep-out and a one-way.
    fn hall() -> Map {
        let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 40).unwrap();
        let wall = MapPose { x_m: 0.05, y_m: 1.0, yaw_rad: 0.0 };
        raster::rectangle(&mut grid, &wall, 0.1, 2.0, Cell::Occupied);
        let zone = |name: &str, kind, west: f64, east: f64| {
            let points = vec![[west, 0.0], [east, 0.0], [east, 2.0], [west, 2.0]];
            Zone::new(name, kind, points).unwrap()
        };
        let zones = vec![
            zone("charger", ZoneKind::KeepOut, 1.0, 2.0),
            zone("lane", ZoneKind::OneWay { heading_rad: -1.57 }, 3.0, 4.0),
        ];
        Map::new("hall", grid, zones).unwrap()
    }

    #[test]
    fn walls_zones_and_free_floor_are_told_apart() {
        let text = text(&hall(), (200, 11), &PLAIN);
        let first = text.lines().next().unwrap();
        assert_eq!(first, format!("⣿{}▒▒▒▒▒▒▒▒▒▒{}↓↓↓↓↓↓↓↓↓↓  hall", " ".repeat(9), " ".repeat(10)));
        for part in ["4.00 × 2.00 m, cells of 5 cm", "▒ keep-out charger", "↓ one-way lane", "a dot is 5 cm"]
        {
            assert!(text.contains(part), "{part}\n{text}");
        }
    }

    #[test]
    fn the_picture_fits_the_terminal() {
        let map = xtb_sim::World::default().to_map(0.05).unwrap();
        for size in [(80, 24), (120, 40), (40, 60), (30, 12)] {
            let text = text(&map, size, &PLAIN);
            let widest = text.lines().map(|line| line.chars().count()).max().unwrap();
            let legend = legend(&map, &PLAIN).iter().map(|(_, width)| *width).max().unwrap();
            assert!(widest <= size.0.max(legend) && text.lines().count() < size.1, "{size:?}\n{text}");
        }
    }

    #[test]
    fn json_has_size_hash_and_zones() {
        let json = serde_json::to_value(shown(&hall())).unwrap();
        assert_eq!((&json["width"], &json["zones"][1]["kind"]), (&80.into(), &"one_way".into()));
        assert_eq!(json["hash"].as_str().unwrap(), hall().hash().to_string());
    }
}
