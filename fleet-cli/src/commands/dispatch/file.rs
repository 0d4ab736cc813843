//! Files of tasks (TOML): read and checked as a whole before anything is submitted.

use super::points::{named, places, waypoint};
use super::text;
use crate::context::Context;
use robot_agent::files;
use serde::Deserialize;
use std::ops::Range;
use std::path::Path;
use toml::Spanned;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::messages::{
    LinkLoss, MAX_SUBMISSION, MapPlace, OnTakeover, TaskKind, TaskSpec, Waypoint, Who,
};

const HINT: &str = "`fleet-cli dispatch submit --help` has an example";

/// The tasks of a file; deadlines count from `now_ms`.
///
/// # Errors
/// [`ErrorKind::Config`] with file, line and task.
pub(super) async fn read(ctx: &Context, path: &Path, now_ms: u64) -> Result<Vec<TaskSpec>> {
    let text = text(path, files::MAX_TEXT)?;
    let in_file =
        |failure: Error| Error { message: format!("{}, {}", path.display(), failure.message), ..failure };
    let entries = entries(&text).map_err(in_file)?;
    let names = entries.iter().any(|entry| entry.get_ref().names_a_place());
    let places = if names { places(ctx).await? } else { Vec::new() };
    specs(&text, entries, now_ms, &places).map_err(in_file)
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default)]
    task: Vec<Spanned<Entry>>,
}

/// A point as people write it.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged, expecting = "a point is [x, y], [x, y, yaw] or the name of a place")]
enum Point {
    Place(String),
    Numbers(Vec<f64>),
}

impl Point {
    fn waypoint(&self, places: &[MapPlace]) -> std::result::Result<Waypoint, String> {
        match self {
            Self::Place(name) => named(name, places),
            Self::Numbers(numbers) => waypoint(numbers),
        }
    }
}

/// One task as people write it: exactly one of the first four says what is to be done.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    goto: Option<Point>,
    route: Option<Vec<Point>>,
    patrol: Option<Vec<Point>>,
    wander_for_s: Option<f64>,
    loops: Option<u32>,
    dwell_s: Option<f64>,
    for_s: Option<f64>,
    robot: Option<String>,
    tag: Option<String>,
    able: Option<String>,
    priority: Option<u8>,
    deadline_s: Option<f64>,
    retries: Option<u32>,
    on_link_loss: Option<LinkLoss>,
    finish_s: Option<f64>,
    on_takeover: Option<OnTakeover>,
    grace_s: Option<f64>,
}

fn wrong(text: &str, at: usize, task: Option<usize>, what: &str) -> Error {
    let task = task.map(|n| format!(", task {n}")).unwrap_or_default();
    Error::new(ErrorKind::Config, format!("line {}{task}: {what}", line_of(text, at))).hint(HINT)
}

fn entries(text: &str) -> Result<Vec<Spanned<Entry>>> {
    let file: File = toml::from_str(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        wrong(text, at, task_at(text, at), error.message().trim_end())
    })?;
    if file.task.is_empty() {
        return Err(Error::new(
            ErrorKind::Config,
            "the file has no task: a task starts with \
            [[task]]",
        )
        .hint(HINT));
    }
    if file.task.len() > MAX_SUBMISSION {
        let message = format!("the file has {} tasks, the limit is {MAX_SUBMISSION}", file.task.len());
        return Err(Error::new(ErrorKind::Config, message).hint("submit them in parts"));
    }
    Ok(file.task)
}

fn specs(
    text: &str,
    entries: Vec<Spanned<Entry>>,
    now_ms: u64,
    places: &[MapPlace],
) -> Result<Vec<TaskSpec>> {
    let each = |(i, entry): (usize, Spanned<Entry>)| {
        let Range { start, .. } = entry.span();
        entry.into_inner().spec(now_ms, places).map_err(|what| wrong(text, start, Some(i + 1), &what))
    };
    entries.into_iter().enumerate().map(each).collect()
}

/// The line of a byte, counted from 1.
fn line_of(text: &str, at: usize) -> usize {
    text.bytes().take(at).filter(|byte| *byte == b'\n').count() + 1
}

/// The task in which a byte stands, counted from 1.
fn task_at(text: &str, at: usize) -> Option<usize> {
    let upto = line_of(text, at);
    let headings = text.lines().take(upto).filter(|line| line.trim_start().starts_with("[[task]]")).count();
    (headings > 0).then_some(headings)
}

fn points(all: &[Point], places: &[MapPlace]) -> std::result::Result<Vec<Waypoint>, String> {
    let point = |(i, point): (usize, &Point)| {
        point.waypoint(places).map_err(|what| format!("point {}: {what}", i + 1))
    };
    all.iter().enumerate().map(point).collect()
}

impl Entry {
    fn names_a_place(&self) -> bool {
        let lists = [&self.route, &self.patrol].into_iter().flatten().flatten();
        self.goto.iter().chain(lists).any(|point| matches!(point, Point::Place(_)))
    }

    fn spec(self, now_ms: u64, places: &[MapPlace]) -> std::result::Result<TaskSpec, String> {
        let mut spec = TaskSpec::new(self.kind(places)?);
        spec.who = self.who()?;
        spec.priority = self.priority.unwrap_or(spec.priority);
        spec.retries = self.retries.unwrap_or(spec.retries);
        spec.on_link_loss = self.on_link_loss.unwrap_or(spec.on_link_loss);
        spec.finish_s = self.finish_s.unwrap_or(spec.finish_s);
        spec.on_takeover = self.on_takeover.unwrap_or(spec.on_takeover);
        spec.grace_s = self.grace_s.unwrap_or(spec.grace_s);
        if let Some(deadline_s) = self.deadline_s {
            if !(0.0..=1.0e9).contains(&deadline_s) {
                return Err(format!("deadline_s = {deadline_s} is not a valid time from now"));
            }
            spec.deadline_ms = Some(now_ms + (deadline_s * 1000.0) as u64);
        }
        spec.validate().map_err(|error| error.to_string())?;
        Ok(spec)
    }

    fn kind(&self, places: &[MapPlace]) -> std::result::Result<TaskKind, String> {
        let Self { goto, route, patrol, wander_for_s, loops, dwell_s, for_s, .. } = self;
        let only = |name: &str, given: bool, with: &str| match given {
            true => Err(format!("{name} can only be used with {with}")),
            false => Ok(()),
        };
        let (is_route, is_patrol) = (route.is_some(), patrol.is_some());
        only("loops", loops.is_some() && !is_route, "route")?;
        only("for_s", for_s.is_some() && !is_patrol, "patrol")?;
        only("dwell_s", dwell_s.is_some() && !is_route && !is_patrol, "route and patrol")?;
        let dwell_s = dwell_s.unwrap_or(0.0);
        match (goto, route, patrol, wander_for_s) {
            (Some(to), None, None, None) => Ok(TaskKind::Goto { to: to.waypoint(places)? }),
            (None, Some(all), None, None) => {
                Ok(TaskKind::Route { points: points(all, places)?, loops: loops.unwrap_or(1), dwell_s })
            }
            (None, None, Some(all), None) => {
                Ok(TaskKind::Patrol { points: points(all, places)?, dwell_s, for_s: *for_s })
            }
            (None, None, None, Some(for_s)) => Ok(TaskKind::Wander { for_s: *for_s }),
            (None, None, None, None) => {
                Err("one of goto, route, patrol or wander_for_s is missing".to_owned())
            }
            _ => Err("give only one of goto, route, patrol and wander_for_s".to_owned()),
        }
    }

    fn who(&self) -> std::result::Result<Who, String> {
        match (&self.robot, &self.tag, &self.able) {
            (None, None, None) => Ok(Who::Any),
            (Some(robot), None, None) => {
                Name::robot(robot).map(Who::Robot).map_err(|error| format!("robot: {error}"))
            }
            (None, Some(tag), None) => Ok(Who::Tag(tag.trim_start_matches('@').to_owned())),
            (None, None, Some(able)) => Ok(Who::Able(able.clone())),
            _ => Err("give only one of robot, tag and able".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests;
