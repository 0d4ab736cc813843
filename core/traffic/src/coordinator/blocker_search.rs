//! Who is in the way of a truck for which no way was found.

use super::arrival_times::{Around, go_on};
use super::discretized_path::DiscretizedPath;
use super::field::Field;
use super::job::{JointJob, Member, NoWay};
use super::occupancy::Occupancy;
use super::separation::separation_m;
use super::task::{EXPANSIONS_EACH, Other, Stuck};
use xtb_nav::geometry::rect::{Rect, Stand};

/// Expansions for each question whether somebody closes the way: half of what a way may cost; chosen, not
/// measured.
const EXPANSIONS: u32 = 2000;

/// So many of those that the way meets are asked about, the first ones: each takes a search. Chosen, not measured.
const MOST_SUSPECTS: usize = 12;

/// Somebody who may be in the way.
struct Suspect<'a> {
    name: &'a str,
    stands: &'a [Stand],
}

/// Says why: the map, or somebody who stands at the goal, or without whom there would be a way, or
/// whom the way meets first that it would take alone.
/// All that is expanded counts down in `left`.
pub(super) fn blocker(job: &JointJob, member: &Member, left: &mut u32) -> NoWay {
    let no_way = |by: Option<&str>, reason: String| NoWay {
        id: member.id,
        revision: member.revision,
        by: by.map(str::to_owned),
        reason,
        for_good: false,
    };
    let for_good = |reason: &str| NoWay { for_good: true, ..no_way(None, reason.to_owned()) };
    let way = match way_around(job, member, &[], EXPANSIONS_EACH, left) {
        Ok(way) => way,
        Err(Stuck::Goal) => return for_good("the goal is not free on the map"),
        Err(Stuck::Start) => return for_good("the robot overlaps an obstacle on the map"),
        Err(Stuck::Nowhere) => return for_good("no path on the map"),
        Err(Stuck::Budget) => return no_way(None, "no path found in time".into()),
    };
    let others = || job.members.iter().filter(|other| other.id != member.id);
    let blocks = job.others(member).map(|block| Suspect { name: &block.name, stands: &block.stands });
    let holders = others().map(|other| Suspect { name: &other.name, stands: other.held_stands() });
    let suspects: Vec<Suspect<'_>> = blocks.chain(holders).collect();
    let meets = |stand: &Stand, stands: &[Stand]| {
        let separation_m = separation_m(member.held_stands(), stands);
        stands.iter().any(|there| stand.conflicts(there, separation_m))
    };
    let goal = way.stands.last().map(|stand| Stand { look: None, ..*stand });
    let at_goal = suspects.iter().find(|suspect| goal.is_some_and(|goal| meets(&goal, suspect.stands)));
    let mut met: Vec<&Suspect<'_>> = Vec::new();
    for stand in &way.stands[member.held..] {
        let new = |one: &&Suspect<'_>| !met.iter().any(|other| std::ptr::eq(*other, *one));
        let now: Vec<&Suspect<'_>> =
            suspects.iter().filter(new).filter(|one| meets(stand, one.stands)).collect();
        met.extend(now);
    }
    let by = at_goal
        .or_else(|| bolt(job, member, &met[..met.len().min(MOST_SUSPECTS)], left))
        .or(met.first().copied())
        .map(|suspect| suspect.name);
    let crosses = || {
        others().find(|other| way.stands[member.held..].iter().any(|stand| meets(stand, &other.way.stands)))
    };
    match by.or_else(|| crosses().map(|other| other.name.as_str())) {
        Some(name) => no_way(Some(name), format!("blocked by {name}")),
        None => no_way(None, "no passing order found".into()),
    }
}

/// The way that it would take if only these stood there, and as they stand now.
fn way_around(
    job: &JointJob,
    member: &Member,
    suspects: &[&Suspect<'_>],
    most: u32,
    left: &mut u32,
) -> Result<DiscretizedPath, Stuck> {
    let bodies: Vec<Rect> =
        suspects.iter().flat_map(|suspect| suspect.stands.iter().map(|stand| stand.body)).collect();
    let goal_m = [member.target.x_m, member.target.y_m];
    let field = Field::new(&*job.room, member.car.half_width_m, &bodies, goal_m);
    let lines: Vec<Occupancy> = suspects.iter().map(|suspect| Occupancy::standing(suspect.stands)).collect();
    let between = |suspect: &Suspect<'_>| separation_m(member.held_stands(), suspect.stands);
    let others: Vec<Other<'_>> = lines
        .iter()
        .zip(suspects)
        .map(|(line, suspect)| Other { line, separation_m: between(suspect), is_thing: false })
        .collect();
    let around = Around {
        target: Some(member.target),
        field: &field,
        others: &others,
        soft: &[],
        wait: 0,
        rest: None,
    };
    Ok(go_on(job, member, &around, most, left)?.0)
}

/// Who closes the only way: without that one the goal can be reached, with it not.
fn bolt<'a>(
    job: &JointJob,
    member: &Member,
    suspects: &[&'a Suspect<'a>],
    left: &mut u32,
) -> Option<&'a Suspect<'a>> {
    let mut is_open = |without: Option<usize>| {
        let rest = suspects.iter().enumerate().filter(|(index, _)| without != Some(*index));
        let standing: Vec<&Suspect<'_>> = rest.map(|(_, suspect)| *suspect).collect();
        way_around(job, member, &standing, EXPANSIONS, left).is_ok()
    };
    if is_open(None) {
        return None;
    }
    (0..suspects.len()).find(|&index| is_open(Some(index))).map(|index| suspects[index])
}
