//! `map check`: what is wrong with a map, and what to do about it.

use super::{rounded, size, size_m};
use crate::commands::map::ResolutionArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::json::{LineKind, line_of};
use crate::map_file::{self, Doubt};
use crate::output::{Output, Tone};
use crate::vehicle_file;
use clap::Args;
use robot_agent::config::SettingLayers;
use robot_agent::files;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::VehicleConfig;
use xtb_nav::map::check::{MapReport, ZoneFinding, check};
use xtb_nav::{Car, Map};
use xtb_protocol::messages::MapHash;

const CHECK_HELP: &str = "\
Problems (no room for the truck, a zone outside the map, keep-outs that divide the free space) make the \
exit code 1; warnings (several islands, doors too narrow) do not.";

/// Arguments of `map check`.
#[derive(Debug, Clone, Args)]
#[command(after_help = CHECK_HELP)]
pub struct MapCheckArgs {
    /// Map (map_server YAML) or world (TOML).
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Check for the truck of this robot-agent config (TOML) [default: the XTB].
    #[arg(long, value_name = "FILE")]
    pub car_from: Option<PathBuf>,
    /// Check for the truck of this vehicle file, such as configs/vehicles/long.toml.
    #[arg(long, value_name = "FILE", conflicts_with = "car_from")]
    pub vehicle: Option<PathBuf>,
    /// How fine a world is drawn.
    #[command(flatten)]
    pub fine: ResolutionArgs,
}

/// Islands and narrow places that are listed for people; JSON has all.
const LISTED: usize = 5;
const LEVEL_WIDTH: usize = 8;

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum Level {
    /// As it should be.
    Ok,
    /// Worth a look.
    Warning,
    /// The map is broken.
    Problem,
}

/// One thing that was found.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct Finding {
    level: Level,
    text: String,
    /// More of it, a line each.
    detail: Vec<String>,
    /// What to do about it.
    hint: Option<String>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct Place {
    x_m: f64,
    y_m: f64,
    /// Of an island: where the truck's middle can be.
    #[serde(skip_serializing_if = "Option::is_none")]
    area_m2: Option<f64>,
    /// Of a narrow place.
    #[serde(skip_serializing_if = "Option::is_none")]
    width_m: Option<f64>,
}

/// What `--json` prints.
#[derive(Debug, Serialize, JsonSchema)]
struct Found<'a> {
    name: &'a str,
    hash: MapHash,
    size_m: [f64; 2],
    resolution_m: f64,
    free_m2: f64,
    occupied_m2: f64,
    unknown_m2: f64,
    islands: Vec<Place>,
    narrow: Vec<Place>,
    problems: usize,
    warnings: usize,
    findings: Vec<Finding>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Found<'_>>];

/// Checks a map. Problems make it [`Exit::Failed`], warnings do not.
///
/// # Errors
/// A file that is no map, or no config.
pub(super) fn run(ctx: &Context, args: &MapCheckArgs) -> Result<Exit> {
    let vehicle = match (&args.vehicle, &args.car_from) {
        (Some(file), _) => vehicle_file::read(file)?.vehicle,
        (None, Some(config)) => vehicle(config)?,
        (None, None) => VehicleConfig::default(),
    };
    let (map, doubt) = map_file::read_closely(&args.file, args.fine.resolution_m)?;
    let found = found(&map, doubt, &Car::of(&vehicle));
    ctx.out.result(&found, |found| text(found, &map, &ctx.out))?;
    Ok(if found.problems == 0 { Exit::Done } else { Exit::Failed })
}

fn vehicle(path: &Path) -> Result<VehicleConfig> {
    let place = path.display().to_string();
    let invalid = |reason: &dyn std::fmt::Display| {
        Error::new(ErrorKind::Config, format!("{place}: {reason}"))
            .hint("`robot-agent --print-config` prints a config with all settings")
    };
    let text = files::text(path, files::MAX_TEXT).map_err(|error| invalid(&error))?;
    let mut layers = SettingLayers::default();
    layers.file(&place, &text).map_err(|error| invalid(&error))?;
    Ok(layers.finish().map_err(|error| invalid(&error))?.vehicle)
}

fn found<'a>(map: &'a Map, doubt: Option<Doubt>, car: &Car) -> Found<'a> {
    let report = check(map, car);
    let doubtful = doubt.map(|Doubt { text, hint }| finding(Level::Warning, text, hint));
    let findings: Vec<Finding> = doubtful.into_iter().chain(findings(&report, car)).collect();
    let count = |level| findings.iter().filter(|finding| finding.level == level).count();
    let place = |[x_m, y_m]: [f64; 2], area_m2: Option<f64>, width_m: Option<f64>| Place {
        x_m: rounded(x_m),
        y_m: rounded(y_m),
        area_m2: area_m2.map(rounded),
        width_m: width_m.map(rounded),
    };
    Found {
        name: map.name(),
        hash: map.hash(),
        size_m: size_m(map),
        resolution_m: map.grid().resolution_m(),
        free_m2: rounded(report.free_m2),
        occupied_m2: rounded(report.occupied_m2),
        unknown_m2: rounded(report.unknown_m2),
        islands: report.islands.iter().map(|it| place(it.at_m, Some(it.area_m2), None)).collect(),
        narrow: report.narrows.iter().map(|it| place(it.at_m, None, Some(it.width_m))).collect(),
        problems: count(Level::Problem),
        warnings: count(Level::Warning),
        findings,
    }
}

fn findings(report: &MapReport, car: &Car) -> Vec<Finding> {
    let at = |[x_m, y_m]: [f64; 2]| format!("({x_m:.2}, {y_m:.2})");
    let width_m = 2.0 * car.half_width_m;
    let mut all = Vec::new();
    match report.islands.as_slice() {
        [] => all.push(finding(
            Level::Problem,
            format!("no free space is wide enough for a truck of {width_m:.2} m"),
            "check the resolution, and that free space is white",
        )),
        [one] => {
            let text = format!("one island: the truck's centre can reach {:.1} m²", one.area_m2);
            all.push(finding(Level::Ok, text, ""));
        }
        several => {
            let each = |island: &xtb_nav::map::check::Island| {
                format!("{:.1} m² around {}", island.area_m2, at(island.at_m))
            };
            let mut listed: Vec<String> = several.iter().take(LISTED).map(each).collect();
            if several.len() > LISTED {
                listed.push(format!("{} smaller ones", several.len() - LISTED));
            }
            let text = format!("{} islands, with no path for a truck between them", several.len());
            let hint = "a goal on an island other than the truck's cannot be reached";
            all.push(Finding { detail: listed, ..finding(Level::Warning, text, hint) });
        }
    }
    for narrow in report.narrows.iter().take(LISTED) {
        let text =
            format!("too narrow for {width_m:.2} m at {}: about {:.2} m", at(narrow.at_m), narrow.width_m);
        all.push(finding(Level::Warning, text, "widen it, or draw it closed"));
    }
    all.extend(report.zones.iter().map(zone_finding));
    all
}

fn zone_finding(found: &ZoneFinding) -> Finding {
    let (level, text, hint) = match found {
        ZoneFinding::Outside { zone } => {
            (Level::Problem, format!("zone {zone} is outside the map"), "points are (x, y) in m, x east")
        }
        ZoneFinding::PartlyOutside { zone } => (
            Level::Warning,
            format!("zone {zone} extends beyond the map"),
            "it is cut off at the map's \
                                      border",
        ),
        ZoneFinding::Cut { zones, pieces } => {
            let who = match zones.as_slice() {
                [] => "keep-outs divide".to_owned(),
                [one] => format!("keep-out {one} divides"),
                several => format!("keep-outs {} divide", several.join(", ")),
            };
            let text = format!("{who} an island into {pieces} pieces");
            (Level::Problem, text, "leave more than the truck's width beside keep-outs")
        }
    };
    finding(level, text, hint)
}

fn finding(level: Level, text: String, hint: &str) -> Finding {
    Finding { level, text, detail: Vec::new(), hint: (!hint.is_empty()).then(|| hint.to_owned()) }
}

fn text(found: &Found<'_>, map: &Map, out: &Output) -> String {
    let mut lines = vec![
        format!("{}  {}  {}", out.paint(Tone::Strong, found.name), size(map), found.hash),
        format!(
            "{:.1} m² free, {:.1} m² occupied, {:.1} m² unknown",
            found.free_m2, found.occupied_m2, found.unknown_m2
        ),
    ];
    for finding in &found.findings {
        let (word, tone) = match finding.level {
            Level::Ok => ("ok", Tone::Good),
            Level::Warning => ("warning", Tone::Warning),
            Level::Problem => ("problem", Tone::Bad),
        };
        lines.push(format!("{} {}", out.paint(tone, &format!("{word:LEVEL_WIDTH$}")), finding.text));
        lines.extend(finding.detail.iter().map(|line| format!("{:LEVEL_WIDTH$}   {line}", "")));
        if let Some(hint) = &finding.hint {
            lines.push(format!("{:LEVEL_WIDTH$} {}", "", out.paint(Tone::Dim, &format!("→ {hint}"))));
        }
    }
    let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    lines.push(format!("{}, {}", count(found.problems, "problem"), count(found.warnings, "warning")));
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::map::raster;
    use xtb_nav::{Cell, Grid, Zone, ZoneKind};

    fn report(zones: Vec<Zone>) -> (usize, String) {
        let mut grid = Grid::free(0.05, [0.0, 0.0], 120, 80).unwrap();
        raster::polyline(&mut grid, &[[3.0, 0.0], [3.0, 1.8]], 0.1, Cell::Occupied);
        raster::polyline(&mut grid, &[[3.0, 2.2], [3.0, 4.0]], 0.1, Cell::Occupied);
        let map = Map::new("hall", grid, zones).unwrap();
        let found = found(&map, None, &Car::of(&VehicleConfig::default()));
        (found.problems, text(&found, &map, &Output { json: false, colors: false }))
    }

    #[test]
    fn a_narrow_door_is_a_warning_with_place_and_width() {
        let (problems, text) = report(Vec::new());
        assert!(text.starts_with("hall  6.00 × 4.00 m, cells of 5 cm  "), "{text}");
        assert!(text.contains("warning  2 islands, with no path"), "{text}");
        assert!(text.contains("warning  too narrow for 0.40 m at (3."), "{text}");
        assert!(problems == 0 && text.ends_with("0 problems, 2 warnings"), "{text}");
    }

    #[test]
    fn a_zone_off_the_map_and_a_keep_out_that_cuts_are_problems() {
        let zone = |name: &str, west: f64, east: f64| {
            let points = vec![[west, 0.0], [east, 0.0], [east, 4.0], [west, 4.0]];
            Zone::new(name, ZoneKind::KeepOut, points).unwrap()
        };
        let (problems, text) = report(vec![zone("far", 9.0, 10.0), zone("across", 1.2, 1.4)]);
        assert!(text.contains("problem  zone far is outside the map"), "{text}");
        assert!(text.contains("problem  keep-out across divides an island into 2 pieces"), "{text}");
        assert_eq!(problems, 2, "{text}");
    }
}
