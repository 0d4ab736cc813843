//! The checks of what serves the whole fleet: dispatcher, its ledger, traffic control, the map.

use super::{Facts, Finding};
use std::collections::{BTreeMap, BTreeSet};
use xtb_protocol::Name;
use xtb_protocol::messages::{DispatchStatus, FleetMap, MapHash, TaskList, TrafficState};

const SAME_RELEASE: &str = "install the same release of fleet-cli here and on its computer";

/// What answered, or why it cannot be read.
pub(in super::super) type Answer<T> = std::result::Result<T, String>;

/// What the doctor has seen of them.
#[derive(Debug, Default)]
pub(in super::super) struct Services {
    /// Whether a dispatcher is present.
    pub(in super::super) dispatcher: bool,
    /// What answered to the question for its tasks.
    pub(in super::super) tasks: Vec<Answer<TaskList>>,
    /// How many tasks there are, if they are more than that answer has room for.
    pub(in super::super) status: Option<DispatchStatus>,
    /// Whether traffic control is present.
    pub(in super::super) traffic: bool,
    /// What it said meanwhile: the last state of each boot.
    pub(in super::super) traffic_states: BTreeMap<u64, TrafficState>,
    /// Why something that it said cannot be read.
    pub(in super::super) traffic_unreadable: Option<String>,
    /// What answered to the question for the fleet's map.
    pub(in super::super) maps: Vec<Answer<FleetMap>>,
}

impl Services {
    /// The map that is served, if it is one.
    fn map(&self) -> Option<&FleetMap> {
        self.maps.iter().find_map(|map| map.as_ref().ok())
    }

    fn hashes(&self) -> BTreeMap<MapHash, &str> {
        self.maps.iter().flatten().map(|map| (map.hash, map.name.as_str())).collect()
    }
}

fn unreadable<T>(answers: &[Answer<T>]) -> Option<&str> {
    answers.iter().find_map(|answer| answer.as_ref().err().map(String::as_str))
}

fn robots(count: usize) -> String {
    format!("{count} robot{}", if count == 1 { "" } else { "s" })
}

/// Whether there is one dispatcher, and it answers.
pub(super) fn dispatcher(facts: &Facts) -> Vec<Finding> {
    const TOPIC: &str = "dispatch";
    let Services { dispatcher, tasks, .. } = &facts.services;
    if let Some(error) = unreadable(tasks) {
        let text = format!("dispatcher: incompatible message version: {error}");
        return vec![Finding::problem(TOPIC, text, SAME_RELEASE)];
    }
    let lists: Vec<&TaskList> = tasks.iter().flatten().collect();
    let ledgers: BTreeSet<u64> = lists.iter().map(|list| list.ledger).collect();
    let finding = match (lists.first(), ledgers.len()) {
        (None, _) if *dispatcher => Finding::problem(
            TOPIC,
            "the dispatcher is present, but does not answer",
            "check its log, end it and start `fleet-cli dispatch serve` again: the ledger keeps the tasks",
        ),
        (None, _) if facts.alive.is_empty() => return Vec::new(),
        (None, _) => Finding::ok(TOPIC, "no dispatcher"),
        (Some(list), 1) => {
            Finding::ok(TOPIC, format!("the dispatcher answers: {}", count_tasks(list, &facts.services)))
        }
        (Some(_), count) => Finding::problem(
            TOPIC,
            format!("{count} dispatchers answer, each with its own ledger"),
            "end all but one: robots get tasks from each of them",
        ),
    };
    std::iter::once(finding).chain(suspended(facts)).collect()
}

/// `3 of 7 tasks are open`, of all its pages if their number is known.
fn count_tasks(list: &TaskList, services: &Services) -> String {
    let open = list.tasks.iter().filter(|task| !task.state.is_final()).count();
    let page = format!("{open} of {} tasks are open", list.tasks.len());
    match (&services.status, list.left_out) {
        (_, 0) => page,
        (Some(all), _) if all.ledger == list.ledger => {
            format!("{} of {} tasks are open", all.open, all.tasks)
        }
        (_, more) => format!("{page}, {more} more were not counted"),
    }
}

/// Whether the ledger is written.
pub(super) fn ledger(facts: &Facts) -> Vec<Finding> {
    const TOPIC: &str = "ledger";
    let lists = facts.services.tasks.iter().flatten();
    let each = lists.map(|list| match &list.ledger_failed {
        None => Finding::ok(TOPIC, format!("ledger {} writable", list.ledger)),
        Some(reason) => Finding::problem(
            TOPIC,
            format!("ledger {} cannot be written: {reason}", list.ledger),
            "check disk and permissions where the dispatcher runs: until then new tasks are refused",
        ),
    });
    each.collect()
}

/// What the dispatcher has suspended.
fn suspended(facts: &Facts) -> impl Iterator<Item = Finding> {
    let suspended = facts.services.tasks.iter().flatten().flat_map(|list| &list.suspended);
    suspended.map(|one| Finding::warning("dispatch", one.text(), one.cause.remedy()))
}

/// Whether there is one traffic control, and it works on the fleet's map.
pub(super) fn traffic(facts: &Facts) -> Vec<Finding> {
    const TOPIC: &str = "traffic";
    const AGAIN: &str = "check its log, and start `fleet-cli traffic serve` again";
    let services = &facts.services;
    let mut heard = services.traffic_states.values();
    let finding = match (heard.next(), heard.next()) {
        (Some(_), Some(_)) => Finding::problem(
            TOPIC,
            format!("{} traffic controls coordinate the robots", services.traffic_states.len()),
            "end all but one, or wait 2 s if one was just restarted",
        ),
        (Some(state), None) => {
            return [on_the_map(services, state)].into_iter().chain(gone(facts, state)).collect();
        }
        (None, _) => match (&services.traffic_unreadable, services.traffic) {
            (Some(error), _) => {
                let text = format!("traffic control: incompatible message version: {error}");
                Finding::problem(TOPIC, text, SAME_RELEASE)
            }
            (None, true) => Finding::problem(TOPIC, "traffic control is present, but sends nothing", AGAIN),
            (None, false) if facts.alive.is_empty() => return Vec::new(),
            (None, false) => Finding::ok(TOPIC, "no traffic control: robots give way by themselves"),
        },
    };
    vec![finding]
}

fn on_the_map(services: &Services, state: &TrafficState) -> Finding {
    const TOPIC: &str = "traffic";
    match services.map() {
        Some(map) if map.hash.to_string() != state.map_hash => Finding::problem(
            TOPIC,
            format!(
                "traffic control uses map {}, the fleet's map is {} ({})",
                state.map_hash, map.name, map.hash
            ),
            "start `fleet-cli traffic serve` again: it then uses the served map",
        ),
        _ => {
            let (led, around) = (state.led.len(), state.obstacles.len());
            let led = robots(led);
            Finding::ok(TOPIC, format!("traffic control coordinates {led}, and plans around {around} others"))
        }
    }
}

/// A robot that traffic control has seen and that has left may stand where it was: the others drive around it.
fn gone(facts: &Facts, state: &TrafficState) -> Option<Finding> {
    let gone = state.obstacles.iter().chain(&state.led).filter(|robot| !facts.alive.contains(*robot));
    let gone = gone.map(Name::as_str).collect::<Vec<_>>().join(", ");
    let text = format!("{gone} has left: the others drive around its last known place");
    const TODO: &str = "start it again, or, if its place is clear, restart traffic control";
    (!gone.is_empty()).then(|| Finding::warning("traffic", text, TODO))
}

/// Whether one map is served, and every robot is on it.
pub(super) fn map(facts: &Facts) -> Vec<Finding> {
    const TOPIC: &str = "map";
    let services = &facts.services;
    if let Some(error) = unreadable(&services.maps) {
        return vec![Finding::problem(TOPIC, format!("incompatible map message: {error}"), SAME_RELEASE)];
    }
    let hashes = services.hashes();
    if hashes.len() > 1 {
        let each = hashes.iter().map(|(hash, name)| format!("{name} ({hash})")).collect::<Vec<_>>();
        let text = format!("{} maps are served: {}", each.len(), each.join(", "));
        return vec![Finding::problem(TOPIC, text, "end all map servers but one")];
    }
    let mut findings = match services.map() {
        Some(map) => robots_off(facts, map),
        None => differing(facts),
    };
    if findings.is_empty() && !(facts.alive.is_empty() && services.maps.is_empty()) {
        let on = facts.states.values().filter(|state| state.nav.map.is_some()).count();
        findings.push(Finding::ok(
            TOPIC,
            match services.map() {
                Some(map) => format!("{} ({}) is served, used by {}", map.name, map.hash, robots(on)),
                None if on > 0 => format!("no map is served; {} with their own map", robots(on)),
                None => "no map is served: robots drive to goals in a straight line".to_owned(),
            },
        ));
    }
    findings
}

/// Robots that are not on the map that is served.
fn robots_off(facts: &Facts, map: &FleetMap) -> Vec<Finding> {
    const TOPIC: &str = "map";
    let served = map.hash.to_string();
    let off = facts.states.values().filter_map(|state| match &state.nav.map {
        Some(own) if own.hash == served => None,
        Some(own) => Some(
            Finding::problem(
                TOPIC,
                format!("uses map {} ({}), the fleet's map is {} ({served})", own.name, own.hash, map.name),
                "start its agent without its own map, or serve that map: until then it plans no paths",
            )
            .of(&state.robot),
        ),
        None => Some(
            Finding::warning(
                TOPIC,
                "has no map: it can only drive in a straight line",
                "it gets the map within 30 s, when it is published next; if not, check its agent's log",
            )
            .of(&state.robot),
        ),
    });
    off.collect()
}

/// Robots whose own maps differ, where none is served.
fn differing(facts: &Facts) -> Vec<Finding> {
    let mut groups = BTreeMap::<&str, Vec<_>>::new();
    for state in facts.states.values() {
        if let Some(own) = &state.nav.map {
            groups.entry(&own.hash).or_default().push((&state.robot, own));
        }
    }
    let Some(most) = groups.iter().max_by_key(|(_, robots)| robots.len()).map(|(hash, _)| *hash) else {
        return Vec::new();
    };
    let others = groups.iter().filter(|(hash, _)| **hash != most).flat_map(|(_, robots)| robots);
    let finding = |(robot, own): &(&xtb_protocol::Name, &xtb_protocol::messages::MapState)| {
        let text = format!("uses map {} ({}), others use {most}", own.name, own.hash);
        Finding::warning("map", text, "give all agents the same map, or serve one with `fleet-cli map serve`")
            .of(robot)
    };
    others.map(finding).collect()
}
