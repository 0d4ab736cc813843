//! `home`: robots go to docks or to parking places now, as tasks of the dispatcher.
//!
//! Which place each robot gets is decided here, from who stands where and who is on the way at this moment. A task of
//! the highest priority to such a place is an order to the dispatcher: what its robot does at present waits.

use super::dispatch::submit::{StayArgs, submit_saying};
use super::dispatcher;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::robots::{self, RobotsWord};
use clap::{ArgGroup, Args};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use xtb_client::fleet_view::FleetView;
use xtb_client::{Client, Error, ErrorKind, Result, map_source};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    LinkLoss, MAX_PRIORITY, MapPlace, PlaceKind, RobotState, TaskId, TaskKind, TaskSpec, TaskView, Waypoint,
    Who,
};

const HOME_HELP: &str = "\
Each robot gets the nearest dock that is free, or its own place of [home.robots] in the fleet config. The task that it \
has now is queued again. At the dock it is charged; then it works again. All robots are sent, or none.

Examples:
  fleet-cli home xtb-1 --wait
  fleet-cli home @red --parking
  fleet-cli home --all";

const SHOWS_WHO: &str = "`fleet-cli dispatch status` shows who is at which place";
/// A robot that stands so near to a place's point leaves no room there for another one, in m: as the dispatcher has it.
const OCCUPIED_M: f64 = 0.7;
/// A task's point that is so near to a place's is that place, in m.
const SAME_M: f64 = 0.05;
/// A robot that gets home without the dispatcher is better off than one that stands somewhere, in s for one drive; and
/// one that is not heard keeps its dock from others for so long.
const FINISH_S: f64 = 600.0;

/// Arguments of `home`.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("whom").args(["robots", "all"]).required(true), after_help = HOME_HELP)]
pub struct HomeArgs {
    /// Robots; @TAG means all of the roster that have the tag.
    #[arg(value_name = "ROBOT", value_parser = RobotsWord::parse)]
    pub robots: Vec<RobotsWord>,
    /// All robots present.
    #[arg(long)]
    pub all: bool,
    /// To a parking place instead of a dock.
    #[arg(long)]
    pub parking: bool,
    /// Staying with it.
    #[command(flatten)]
    pub stay: StayArgs,
}

/// What `--json` prints for each robot.
#[derive(Debug, Serialize, JsonSchema)]
struct Sent<'a> {
    /// The task that takes it there.
    id: TaskId,
    robot: &'a Name,
    /// Where it goes.
    place: &'a Name,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Sent<'_>>, line_of::<TaskView>];

/// Sends them; with `--wait` stays until they are there.
///
/// # Errors
/// No router or dispatcher; no section `[home]`; a robot is not present, or there is no free place for it.
pub async fn run(ctx: &Context, args: &HomeArgs) -> Result<Exit> {
    let orders = tokio::select! {
        chosen = chosen(ctx, args) => chosen?,
        () = interrupted() => return Ok(Exit::Interrupted),
    };
    let specs = orders.iter().map(|(robot, place)| order(robot, place)).collect();
    submit_saying(ctx, specs, args.stay, |ids| {
        for (id, (robot, place)) in ids.iter().zip(&orders) {
            let sent = Sent { id: *id, robot, place: &place.name };
            ctx.out
                .result(&sent, |sent| format!("{} submitted: {} to {}", sent.id, sent.robot, sent.place))?;
        }
        Ok(Exit::Done)
    })
    .await
}

fn order(robot: &Name, place: &MapPlace) -> TaskSpec {
    let to = Waypoint { x_m: place.x_m, y_m: place.y_m, yaw_rad: place.yaw_rad };
    TaskSpec {
        priority: MAX_PRIORITY,
        who: Who::Robot(robot.clone()),
        on_link_loss: LinkLoss::Finish,
        finish_s: FINISH_S,
        ..TaskSpec::new(TaskKind::Goto { to })
    }
}

async fn chosen(ctx: &Context, args: &HomeArgs) -> Result<Vec<(Name, MapPlace)>> {
    let client = Client::open(&ctx.settings).await?;
    let chosen = choose(ctx, &client, args).await;
    client.close().await;
    chosen
}

async fn choose(ctx: &Context, client: &Client, args: &HomeArgs) -> Result<Vec<(Name, MapPlace)>> {
    let dispatcher = dispatcher(client);
    // Says who has none how to start one.
    let tasks = dispatcher.list().await?.tasks;
    let homes = dispatcher.homes().await?;
    if !homes.as_ref().is_some_and(|homes| homes.active) {
        let message = "the dispatcher sends no robot home: it has no section [home]";
        return Err(Error::new(ErrorKind::Failed, message).hint(
            "write [home] into its fleet config, or start it with `fleet-cli dispatch serve --home`; \
             `fleet-cli dispatch goto PLACE --robot ROBOT` sends one anyway",
        ));
    }
    let places = map_source::places(client.bus(), client.keys(), client.settings().timeout)
        .await?
        .ok_or_else(map_source::no_map)?;
    let view = FleetView::ask(client, client.fleet(), &BTreeSet::new()).await?;
    let here = view.robots.iter().filter(|robot| robot.alive);
    let states: BTreeMap<&Name, &RobotState> =
        here.filter_map(|robot| Some((&robot.name, robot.state.as_ref()?))).collect();
    let names = match args.all {
        true => states.keys().map(|name| (*name).clone()).collect(),
        false => robots::meant(client, &args.robots).await.all()?,
    };
    if names.is_empty() {
        return Err(client.nobody());
    }
    let mut asked = Vec::new();
    for name in names {
        let state = states.get(&name).ok_or_else(|| {
            let message = format!("{name} is not present, or does not say where it is: no robot was sent");
            Error::new(ErrorKind::NoRobot, message).hint("`fleet-cli list` shows which robots are present")
        })?;
        asked.push((name, [state.pose.x_m, state.pose.y_m]));
    }
    let is_asked = |name: &Name| asked.iter().any(|(asked, _)| asked == name);
    let taken = |place: &MapPlace| {
        let stands = states.iter().filter(|(name, state)| {
            let drives = state.goal.as_ref().is_some_and(|goal| !goal.status.is_final());
            !is_asked(name) && !drives && off_m(place, [state.pose.x_m, state.pose.y_m]) <= OCCUPIED_M
        });
        let comes = tasks.iter().filter_map(|task| Some((going_to(task)?, task))).filter_map(|(to, task)| {
            let robot = task.on().or(match &task.spec.who {
                Who::Robot(robot) => Some(robot),
                _ => None,
            })?;
            (off_m(place, [to.x_m, to.y_m]) <= SAME_M && !is_asked(robot)).then_some(robot)
        });
        stands.map(|(name, _)| *name).chain(comes).next().cloned()
    };
    let wanted =
        Wanted { places: &places, own: ctx.home.as_ref().map(|rules| &rules.homes), parking: args.parking };
    wanted.shared_out(&asked, &taken)
}

/// Where a task that has not ended goes next.
fn going_to(task: &TaskView) -> Option<&Waypoint> {
    let points = task.spec.kind.points();
    points.get(task.legs_done as usize % points.len().max(1)).filter(|_| !task.state.is_final())
}

fn off_m(place: &MapPlace, [x_m, y_m]: [f64; 2]) -> f64 {
    (place.x_m - x_m).hypot(place.y_m - y_m)
}

/// The places that robots may be sent to.
struct Wanted<'a> {
    places: &'a [MapPlace],
    /// Robots with a place of their own.
    own: Option<&'a BTreeMap<Name, Name>>,
    parking: bool,
}

impl Wanted<'_> {
    fn kind(&self) -> PlaceKind {
        if self.parking { PlaceKind::Parking } else { PlaceKind::Dock }
    }

    fn is_for(&self, robot: &Name, place: &MapPlace) -> bool {
        let own = self.own.and_then(|own| own.get(robot)).filter(|_| !self.parking);
        own.map_or(place.kind == self.kind(), |own| place.name == *own)
    }

    /// A place for each of them, where two want the same the nearer one first; who has taken a place is told by `taken`.
    fn shared_out(
        &self,
        asked: &[(Name, [f64; 2])],
        taken: &dyn Fn(&MapPlace) -> Option<Name>,
    ) -> Result<Vec<(Name, MapPlace)>> {
        let (mut free, mut takers) = (Vec::new(), Vec::new());
        for place in
            self.places.iter().filter(|place| asked.iter().any(|(robot, _)| self.is_for(robot, place)))
        {
            match taken(place) {
                None => free.push(place),
                Some(robot) => takers.push(format!("{} is taken by {robot}", place.name)),
            }
        }
        let mut open: Vec<&(Name, [f64; 2])> = asked.iter().collect();
        let mut given: BTreeMap<&Name, &MapPlace> = BTreeMap::new();
        while !open.is_empty() {
            let pairs = open.iter().enumerate().flat_map(|(n, (robot, at))| {
                let may = free.iter().enumerate().filter(move |(_, place)| self.is_for(robot, place));
                may.map(move |(m, place)| (off_m(place, *at), n, m))
            });
            let Some((_, robot, place)) = pairs.min_by(|a, b| a.0.total_cmp(&b.0)) else {
                return Err(self.none_left(&open, &takers));
            };
            given.insert(&open.swap_remove(robot).0, free.swap_remove(place));
        }
        let of = |robot: &Name| given.get(robot).map(|place| (robot.clone(), (*place).clone()));
        Ok(asked.iter().filter_map(|(robot, _)| of(robot)).collect())
    }

    fn none_left(&self, open: &[&(Name, [f64; 2])], takers: &[String]) -> Error {
        let kind = if self.parking { "parking place" } else { "dock" };
        let robots: Vec<&str> = open.iter().map(|(robot, _)| robot.as_str()).collect();
        let robots = robots.join(", ");
        if !self.places.iter().any(|place| place.kind == self.kind()) && takers.is_empty() {
            let message = format!("the fleet's map has no {kind} for {robots}");
            let hint = "`fleet-cli place add NAME X Y --kind dock` (or parking) adds one";
            return Error::new(ErrorKind::Failed, message).hint(hint);
        }
        let who = if takers.is_empty() { String::new() } else { format!(": {}", takers.join(", ")) };
        let message = format!("no {kind} is free for {robots}{who}; no robot was sent");
        Error::new(ErrorKind::Failed, message).hint(match self.parking {
            true => SHOWS_WHO.to_owned(),
            false => format!("name fewer robots, or send them with --parking; {SHOWS_WHO}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn place(text: &str, kind: PlaceKind, x_m: f64) -> MapPlace {
        MapPlace { name: name(text), kind, x_m, y_m: 0.0, yaw_rad: None, tags: vec![], points: vec![] }
    }

    fn places() -> Vec<MapPlace> {
        vec![
            place("dock-1", PlaceKind::Dock, 0.0),
            place("dock-2", PlaceKind::Dock, 4.0),
            place("parking-1", PlaceKind::Parking, 1.0),
            place("bench", PlaceKind::Place, 2.0),
        ]
    }

    fn wanted<'a>(places: &'a [MapPlace], parking: bool) -> Wanted<'a> {
        Wanted { places, own: None, parking }
    }

    fn sent(found: Result<Vec<(Name, MapPlace)>>) -> Vec<(String, String)> {
        found.unwrap().into_iter().map(|(robot, place)| (robot.to_string(), place.name.to_string())).collect()
    }

    fn of(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
        pairs.iter().map(|(robot, place)| ((*robot).to_owned(), (*place).to_owned())).collect()
    }

    #[test]
    fn whoever_is_nearer_gets_a_dock_and_the_other_one_the_next() {
        let places = places();
        let asked = [(name("xtb-1"), [1.0, 0.0]), (name("xtb-2"), [0.5, 0.0])];
        let nobody = |_: &MapPlace| None;
        let docks = sent(wanted(&places, false).shared_out(&asked, &nobody));
        assert_eq!(docks, of(&[("xtb-1", "dock-2"), ("xtb-2", "dock-1")]));
        let own = BTreeMap::from([(name("xtb-1"), name("bench"))]);
        let with_own = Wanted { own: Some(&own), ..wanted(&places, false) };
        let docks = sent(with_own.shared_out(&asked, &nobody));
        assert_eq!(docks, of(&[("xtb-1", "bench"), ("xtb-2", "dock-1")]));
        let parking = sent(Wanted { parking: true, ..with_own }.shared_out(&asked[..1], &nobody));
        assert_eq!(parking, of(&[("xtb-1", "parking-1")]));
    }

    #[test]
    fn who_gets_no_place_is_named_with_whoever_has_it() {
        let places = places();
        let asked = [(name("xtb-1"), [1.0, 0.0]), (name("xtb-2"), [0.5, 0.0])];
        let taken = |place: &MapPlace| (place.name.as_str() == "dock-2").then(|| name("xtb-9"));
        let error = wanted(&places, false).shared_out(&asked, &taken).unwrap_err();
        assert_eq!(error.message, "no dock is free for xtb-1: dock-2 is taken by xtb-9; no robot was sent");
        assert!(error.hint.contains("--parking"), "{}", error.hint);
        let error = wanted(&places, true).shared_out(&asked, &taken).unwrap_err();
        assert_eq!(error.message, "no parking place is free for xtb-2; no robot was sent");
        let error = wanted(&places[2..], false).shared_out(&asked, &taken).unwrap_err();
        assert_eq!(error.message, "the fleet's map has no dock for xtb-1, xtb-2");
        assert!(error.hint.contains("place add"), "{}", error.hint);
    }
}
