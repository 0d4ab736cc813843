//! `place`: named points and areas of the map, one verb a function.

use crate::context::Context;
use crate::exit::Exit;
use crate::json::{Verbs, line_of};
use crate::map_file;
use crate::point::PointArgs;
use crate::values::degrees;
use clap::{Args, Subcommand, ValueEnum};
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::fleet_view::by_number;
use xtb_client::text::robot as describe;
use xtb_client::{Client, Error, ErrorKind, Result, map_edit, map_source};
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::messages::{MAX_WHY, MapPlace, PlaceKind, PoseState, Waypoint, place_name};
use xtb_sim::MAP_RESOLUTION_M;

const PLACE_HELP: &str = "\
A place can be used wherever a point is taken: `goto xtb-1 dock-2`, `dispatch route dock-1 dock-2`. A change goes to
the program that serves the fleet's map, which writes the map's file and keeps who changed it and why (`fleet-cli map
history`); with --file it goes into a file, which a running `map serve` takes over by itself.

Examples:
  fleet-cli place list
  fleet-cli place add dock-2 -4.5 6 --yaw 90 --kind dock
  fleet-cli place here bench xtb-1 --why 'the new bench'
  fleet-cli place remove bench --file lab.yaml";

/// Arguments of `place`.
#[derive(Debug, Clone, Args)]
#[command(after_help = PLACE_HELP)]
pub struct PlaceArgs {
    /// What to do with places.
    #[command(subcommand)]
    pub verb: PlaceVerb,
}

/// What to do with places.
#[derive(Debug, Clone, Subcommand)]
pub enum PlaceVerb {
    /// List the places of the fleet's map, or of a file.
    List(PlaceListArgs),
    /// Name a point of the fleet's map, or of a file.
    Add(PlaceAddArgs),
    /// Name the point where a robot stands.
    Here(PlaceHereArgs),
    /// Remove places from the fleet's map, or from a file.
    Remove(PlaceRemoveArgs),
}

/// Arguments of `place list`.
#[derive(Debug, Clone, Args)]
pub struct PlaceListArgs {
    /// Map (map_server YAML) or world (TOML) [default: the fleet's map].
    #[arg(long, value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// Only of this kind.
    #[arg(long, value_enum)]
    pub kind: Option<KindArg>,
    /// Only with this tag.
    #[arg(long, value_name = "TAG")]
    pub tag: Option<Name>,
}

/// Arguments of `place add`.
#[derive(Debug, Clone, Args)]
#[command(allow_negative_numbers = true)]
pub struct PlaceAddArgs {
    /// Its name: a-z, 0-9 and -, a letter first.
    #[arg(value_name = "NAME", value_parser = place_name)]
    pub name: Name,
    /// Where; another place is taken over.
    #[command(flatten)]
    pub at: PointArgs,
    /// Yaw on arrival, in degrees counter-clockwise from east [default: any].
    #[arg(long, value_name = "DEGREES", value_parser = degrees)]
    pub yaw: Option<f64>,
    /// The rest.
    #[command(flatten)]
    pub entry: EntryArgs,
}

/// Arguments of `place here`.
#[derive(Debug, Clone, Args)]
pub struct PlaceHereArgs {
    /// Its name: a-z, 0-9 and -, a letter first.
    #[arg(value_name = "NAME", value_parser = place_name)]
    pub name: Name,
    /// The robot that stands there.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Without the robot's yaw: any.
    #[arg(long)]
    pub any_yaw: bool,
    /// The rest.
    #[command(flatten)]
    pub entry: EntryArgs,
}

/// Arguments of `place remove`.
#[derive(Debug, Clone, Args)]
pub struct PlaceRemoveArgs {
    /// Places.
    #[arg(value_name = "NAME", required = true, value_parser = place_name)]
    pub names: Vec<Name>,
    /// Where the change goes.
    #[command(flatten)]
    pub to: ToArgs,
}

/// What a new place has besides its point.
#[derive(Debug, Clone, Args)]
pub struct EntryArgs {
    /// What it is for.
    #[arg(long, value_enum, default_value_t = KindArg::Place)]
    pub kind: KindArg,
    /// What to group it by; repeat it.
    #[arg(long = "tag", value_name = "TAG")]
    pub tags: Vec<Name>,
    /// Move a place that is there already.
    #[arg(long)]
    pub replace: bool,
    /// Where the change goes.
    #[command(flatten)]
    pub to: ToArgs,
}

/// Where a change goes.
#[derive(Debug, Clone, Args)]
pub struct ToArgs {
    /// Map (map_server YAML) or world (TOML) to change [default: the fleet's map, through its server].
    #[arg(long, value_name = "FILE")]
    pub file: Option<PathBuf>,
    /// Reason, for the map's history [default: what was changed].
    #[arg(long, value_name = "TEXT", conflicts_with = "file")]
    pub why: Option<String>,
}

/// What a place is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum KindArg {
    /// Somewhere that people send robots to.
    Place,
    /// Where a robot is charged.
    Dock,
    /// Where a robot may stand for long.
    Parking,
    /// Where a robot waits for its turn.
    Waiting,
}

impl From<KindArg> for PlaceKind {
    fn from(kind: KindArg) -> Self {
        match kind {
            KindArg::Place => Self::Place,
            KindArg::Dock => Self::Dock,
            KindArg::Parking => Self::Parking,
            KindArg::Waiting => Self::Waiting,
        }
    }
}

impl PlaceArgs {
    /// Whether it talks to a fleet.
    pub(super) fn needs_session(&self) -> bool {
        match &self.verb {
            PlaceVerb::List(args) => args.file.is_none(),
            PlaceVerb::Add(args) => args.at.is_place() || args.entry.to.file.is_none(),
            PlaceVerb::Here(_) => true,
            PlaceVerb::Remove(args) => args.to.file.is_none(),
        }
    }

    /// Whether it changes the map that is served.
    pub(super) fn changes_fleets_map(&self) -> bool {
        match &self.verb {
            PlaceVerb::List(_) => false,
            PlaceVerb::Add(PlaceAddArgs { entry, .. }) | PlaceVerb::Here(PlaceHereArgs { entry, .. }) => {
                entry.to.file.is_none()
            }
            PlaceVerb::Remove(args) => args.to.file.is_none(),
        }
    }
}

/// What `place list` prints with `--json`.
#[derive(Debug, Serialize, JsonSchema)]
struct Listed<'a> {
    places: Vec<&'a MapPlace>,
}

/// What a change prints with `--json`.
#[derive(Debug, Serialize, JsonSchema)]
struct Changed<'a> {
    /// `None` = the fleet's map.
    file: Option<&'a Path>,
    added: Option<&'a MapPlace>,
    removed: &'a [Name],
    /// Of the fleet's map; `None` = a file was changed.
    version: Option<u64>,
    /// Whether it is in a file now.
    stored: bool,
}

impl Changed<'_> {
    /// Where the change is.
    fn place(&self) -> String {
        let ends = if self.stored { "" } else { "; it ends with the map's server" };
        match (self.file, self.version) {
            (Some(file), _) => file.display().to_string(),
            (None, Some(version)) => format!("version {version} of the map{ends}"),
            (None, None) => "the map".to_owned(),
        }
    }
}

/// What its verbs print with `--json`.
pub(super) const JSON: Verbs = &[
    ("place list", &[line_of::<Listed<'_>>]),
    ("place add", &[line_of::<Changed<'_>>]),
    ("place here", &[line_of::<Changed<'_>>]),
    ("place remove", &[line_of::<Changed<'_>>]),
];

/// Carries out one of its verbs.
///
/// # Errors
/// A file that cannot be read or changed, no router, or a name that is taken or not there.
pub async fn run(ctx: &Context, args: &PlaceArgs) -> Result<Exit> {
    match &args.verb {
        PlaceVerb::List(args) => list(ctx, args).await,
        PlaceVerb::Add(args) => {
            let Waypoint { x_m, y_m, yaw_rad } = args.at.resolve(ctx).await?;
            let yaw_rad = args.yaw.map(f64::to_radians).or(yaw_rad);
            add(ctx, &args.entry, &args.name, Waypoint { x_m, y_m, yaw_rad }).await
        }
        PlaceVerb::Here(args) => {
            let PoseState { x_m, y_m, yaw_rad, .. } = pose(ctx, &args.robot).await?;
            let yaw_rad = (!args.any_yaw).then_some(yaw_rad);
            add(ctx, &args.entry, &args.name, Waypoint { x_m, y_m, yaw_rad }).await
        }
        PlaceVerb::Remove(args) => remove(ctx, args).await,
    }
}

async fn list(ctx: &Context, args: &PlaceListArgs) -> Result<Exit> {
    let all = match &args.file {
        Some(file) => map_file::read(file, MAP_RESOLUTION_M)?.places().to_vec(),
        None => {
            let client = Client::open(&ctx.settings).await?;
            let places = map_source::places(client.bus(), client.keys(), ctx.settings.timeout).await;
            client.close().await;
            places?.ok_or_else(map_source::no_map)?
        }
    };
    let kind = args.kind.map(PlaceKind::from);
    let wanted = |place: &&MapPlace| {
        kind.is_none_or(|kind| place.kind == kind)
            && args.tag.as_ref().is_none_or(|tag| place.tags.contains(tag))
    };
    let mut places: Vec<&MapPlace> = all.iter().filter(wanted).collect();
    places.sort_by_cached_key(|place| by_number(&place.name));
    ctx.out.result(&Listed { places }, |listed| table(&listed.places))?;
    Ok(Exit::Done)
}

fn table(places: &[&MapPlace]) -> String {
    if places.is_empty() {
        return "no places; `fleet-cli place add` names one".to_owned();
    }
    let widest = places.iter().map(|place| place.name.as_str().len()).max().unwrap_or(0);
    let line = |place: &&MapPlace| {
        let point = describe::map_point(place.x_m, place.y_m);
        let yaw =
            place.yaw_rad.map_or_else(|| "any yaw".to_owned(), |yaw| format!("{:.0}°", yaw.to_degrees()));
        let area = if place.points.is_empty() { "" } else { ", an area" };
        let tags: String = place.tags.iter().map(|tag| format!(" @{tag}")).collect();
        format!("{:widest$}  {:7}  {point} {yaw}{area}{tags}", place.name, place.kind)
    };
    places.iter().map(line).collect::<Vec<_>>().join("\n")
}

/// Where a robot stands, as it says.
async fn pose(ctx: &Context, robot: &Name) -> Result<PoseState> {
    let client = Client::open(&ctx.settings).await?;
    let states = client.states(&client.keys().robot(robot)).await;
    client.close().await;
    let state = states?.remove(robot).and_then(|seen| seen.fresh().map(|state| state.pose));
    state.ok_or_else(|| {
        Error::new(ErrorKind::NoRobot, format!("no state from {robot}: where it stands is unknown"))
            .hint("`fleet-cli list` shows the robots that answer")
    })
}

async fn add(ctx: &Context, entry: &EntryArgs, name: &Name, at: Waypoint) -> Result<Exit> {
    // Millimetres and tenths of a degree are finer than anything drives.
    let rounded = |value: f64, per: f64| (value * per).round() / per;
    let place = MapPlace {
        name: name.clone(),
        kind: entry.kind.into(),
        x_m: rounded(at.x_m, 1e3),
        y_m: rounded(at.y_m, 1e3),
        yaw_rad: at.yaw_rad.map(|yaw_rad| rounded(yaw_rad, 1e4)),
        tags: entry.tags.clone(),
        points: Vec::new(),
    };
    let put =
        |places: &mut Vec<MapPlace>, map: &str| match places.iter_mut().find(|known| known.name == *name) {
            Some(known) if entry.replace => {
                *known = place.clone();
                Ok(())
            }
            Some(known) => {
                let at = describe::map_point(known.x_m, known.y_m);
                Err(Error::new(ErrorKind::Failed, format!("{map} has a place {name} at {at}"))
                    .hint("--replace moves it"))
            }
            None => {
                places.push(place.clone());
                Ok(())
            }
        };
    let changed = change(ctx, &entry.to, &format!("place {name}"), put).await?;
    let pose = MapPose { x_m: place.x_m, y_m: place.y_m, yaw_rad: place.yaw_rad.unwrap_or(0.0) };
    ctx.out.result(&Changed { added: Some(&place), ..changed }, |changed| {
        let point = match place.yaw_rad {
            Some(_) => describe::map_pose(&pose),
            None => describe::map_point(pose.x_m, pose.y_m),
        };
        format!("{name} is {point} in {}", changed.place())
    })?;
    Ok(Exit::Done)
}

async fn remove(ctx: &Context, args: &PlaceRemoveArgs) -> Result<Exit> {
    let take = |places: &mut Vec<MapPlace>, map: &str| {
        for name in &args.names {
            let before = places.len();
            places.retain(|place| place.name != *name);
            if places.len() == before {
                return Err(Error::new(ErrorKind::Failed, format!("{map} has no place {name}")).hint(
                    "nothing was removed; `fleet-cli place list` shows what there is, of a file with --file",
                ));
            }
        }
        Ok(())
    };
    let names = args.names.iter().map(Name::as_str).collect::<Vec<_>>().join(", ");
    let changed = change(ctx, &args.to, &format!("without {names}"), take).await?;
    ctx.out.result(&Changed { removed: &args.names, ..changed }, |changed| {
        format!("removed {names} from {}", changed.place())
    })?;
    Ok(Exit::Done)
}

/// Changes the places of a file, or, through the map server, of the fleet's map; `what` is the reason if none is given.
async fn change<'a>(
    ctx: &Context,
    to: &'a ToArgs,
    what: &str,
    make: impl FnOnce(&mut Vec<MapPlace>, &str) -> Result<()>,
) -> Result<Changed<'a>> {
    if let Some(file) = &to.file {
        let mut places = map_file::read(file, MAP_RESOLUTION_M)?.places().to_vec();
        make(&mut places, &file.display().to_string())?;
        map_file::write(file, None, &places)?;
        return Ok(Changed {
            file: Some(file.as_path()),
            added: None,
            removed: &[],
            version: None,
            stored: true,
        });
    }
    let client = Client::open(&ctx.settings).await?;
    let changing = async {
        let mut draft = map_edit::draft(&client).await?;
        make(&mut draft.places, "the fleet's map")?;
        // So many names may be longer than a reason.
        let what: String = what.chars().take(MAX_WHY).collect();
        map_edit::save(&client, draft, to.why.as_deref().unwrap_or(&what)).await
    };
    let saved = changing.await;
    client.close().await;
    let map_edit::Saved { version, stored } = saved?;
    Ok(Changed { file: None, added: None, removed: &[], version: Some(version.number), stored })
}
