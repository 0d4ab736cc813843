//! The checks. Pure: facts in, findings out.

mod loops;
mod security;
mod services;
mod simulator;

pub(super) use security::Security;
pub(super) use services::Services;

use super::finding::{Finding, Level};
use super::fixes::FixBook;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;
use xtb_client::Error;
use xtb_client::text::robot as describe;
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::messages::{About, BatteryLevel, Fault, Latch, RobotState, RosterEntry, SimStats};
use xtb_protocol::wire::WIRE;

/// Of the robot's clock against ours.
const CLOCK_TOLERANCE: f64 = 0.05;
/// Start poses that differ by less are the same: printed digits.
const POSE_TOLERANCE_M: f64 = 0.01;
/// The same, for yaw.
const YAW_TOLERANCE_RAD: f64 = 0.01;
/// Parameters that are named where vehicle configs differ.
const DIFFERENCES_SHOWN: usize = 3;

/// Where releases differ.
const UPDATE_THE_OLDER: &str = "update the older of the two (docs/upgrade.md)";

/// What the doctor has seen.
pub(super) struct Facts {
    /// The routers.
    pub(super) connected: String,
    /// The fleet.
    pub(super) fleet: Name,
    /// Which robots should be there; `None` = nobody knows.
    pub(super) roster: Option<Vec<RosterEntry>>,
    /// Who is there.
    pub(super) alive: BTreeSet<Name>,
    /// Factsheets of each name: two for a name that two agents have.
    pub(super) abouts: BTreeMap<Name, Vec<About>>,
    /// Whose answers cannot be read, and why.
    pub(super) unreadable: BTreeMap<Name, String>,
    /// Boots that answered to each name.
    pub(super) epochs: BTreeMap<Name, BTreeSet<u64>>,
    /// How many programs answer each robot's commands.
    pub(super) voices: BTreeMap<Name, usize>,
    /// Whether commands to a robot that does not exist are answered.
    pub(super) answered_for_nobody: bool,
    /// Fresh states.
    pub(super) states: BTreeMap<Name, RobotState>,
    /// The robot's time over ours; `None` = it was not heard twice in one boot.
    pub(super) rates: BTreeMap<Name, Option<f64>>,
    /// What the pose fixes said beside the robots' states.
    pub(super) fixes: FixBook,
    /// Dispatcher, traffic control and map.
    pub(super) services: Services,
    /// How the simulator runs, if there is one.
    pub(super) simulator: Option<SimStats>,
    /// The robots that it has.
    pub(super) simulated: BTreeSet<Name>,
}

/// A router answered after this long.
pub(super) fn router(connect: &[String], took: Duration) -> Finding {
    Finding::ok("router", format!("{} answers after {}", connect.join(", "), describe::age(took)))
}

/// None did.
pub(super) fn no_router(failure: &Error) -> Finding {
    Finding::problem("router", failure.message.clone(), failure.hint.clone())
}

/// What is looked at, and how.
type Check = (&'static str, fn(&Facts) -> Vec<Finding>);

/// Everything but the router.
pub(super) fn all(facts: &Facts) -> Vec<Finding> {
    let simulator = simulator::check(facts);
    // What explains the others comes before them.
    let (mut findings, last): (Vec<_>, Vec<_>) = simulator.into_iter().partition(|it| it.level != Level::Ok);
    let checks: [Check; 14] = [
        ("roster", roster),
        ("names", names),
        ("versions", versions),
        ("starts", starts),
        ("clocks", clocks),
        ("loops", loops::check),
        ("vehicle", vehicles),
        ("latches", latches),
        ("faults", faults),
        ("fixes", |facts| facts.fixes.findings()),
        ("dispatch", services::dispatcher),
        ("ledger", services::ledger),
        ("traffic", services::traffic),
        ("map", services::map),
    ];
    for (topic, check) in checks {
        let found = check(facts);
        // Nothing to say of nobody.
        if found.is_empty() && !facts.alive.is_empty() {
            findings.push(Finding::ok(topic, "none"));
        }
        findings.extend(found);
    }
    findings.extend(last);
    findings
}

fn roster(facts: &Facts) -> Vec<Finding> {
    let there = facts.alive.iter().map(Name::to_string).collect::<Vec<_>>().join(", ");
    let Some(roster) = &facts.roster else {
        if facts.alive.is_empty() {
            let text = format!("no robot of fleet {} at {}", facts.fleet, facts.connected);
            let hint = "start `robot-agent` on a robot, or `fleet-cli sim`; check --fleet";
            return vec![Finding::problem("roster", text, hint)];
        }
        let entries: Vec<_> = facts.alive.iter().map(|name| format!("{{ name = \"{name}\" }}")).collect();
        let hint = format!(
            "add `robots = [{}]` to ~/.config/xtb/fleet.toml or the file given with --config",
            entries.join(", ")
        );
        return vec![Finding::warning("roster", format!("no roster configured; present: {there}"), hint)];
    };
    let mut findings = Vec::new();
    for entry in roster.iter().filter(|entry| !facts.alive.contains(&entry.name)) {
        let hint = format!(
            "check its power and network, and that `robot-agent --fleet {} --name {}` is running",
            facts.fleet, entry.name
        );
        let hint = simulator::or_overloaded(facts, &entry.name, &hint);
        findings.push(Finding::problem("roster", "missing", hint).of(&entry.name));
    }
    for name in facts.alive.iter().filter(|name| !roster.iter().any(|entry| entry.name == **name)) {
        let hint = "add it to [[robots]], or find out who runs it: `stop --all` also stops it";
        findings.push(Finding::warning("roster", "present, but not in the roster", hint).of(name));
    }
    if findings.is_empty() {
        findings.push(Finding::ok("roster", format!("all present: {there}")));
    }
    findings
}

fn names(facts: &Facts) -> Vec<Finding> {
    let twice = facts.epochs.iter().filter(|(_, epochs)| epochs.len() > 1);
    let mut findings: Vec<_> = twice
        .map(|(name, epochs)| {
            let text = format!("{} agents use this name", epochs.len());
            Finding::problem("names", text, "end all but one, or give them different names").of(name)
        })
        .collect();
    let shadow = "find and end that program: it can report a driving robot as stopped";
    for (name, voices) in facts.voices.iter().filter(|(_, voices)| **voices > 1) {
        let text = format!("{voices} programs answer its commands");
        findings.push(Finding::problem("names", text, shadow).of(name));
    }
    if facts.answered_for_nobody {
        let text = "a program answers commands to robots that are not present";
        findings.push(Finding::problem("names", text, shadow));
    }
    if findings.is_empty() && !facts.alive.is_empty() {
        return vec![Finding::ok("names", "each name is used once")];
    }
    findings
}

fn versions(facts: &Facts) -> Vec<Finding> {
    let of = |name: &Name| {
        let finding = if let Some(error) = facts.unreadable.get(name) {
            Finding::problem("versions", format!("its messages cannot be read: {error}"), UPDATE_THE_OLDER)
        } else if let Some(about) = facts.abouts.get(name).and_then(|abouts| abouts.first()) {
            version(about)
        } else {
            let text = "does not answer with its factsheet";
            let hint = "its agent hangs, or a router blocks the query: check the agent's log";
            simulator::late(facts, name, Finding::problem("versions", text, hint))
        };
        finding.of(name)
    };
    facts.alive.iter().map(of).collect()
}

/// What a robot runs, beside what runs here.
fn version(about: &About) -> Finding {
    let ours = env!("CARGO_PKG_VERSION");
    let board =
        about.board_firmware().map_or_else(String::new, |version| format!(" with board firmware {version}"));
    let Some(wire) = about.wire() else {
        let text = format!("robot-agent {}{board}, an unknown version of the wire", about.version);
        return Finding::problem("versions", text, UPDATE_THE_OLDER);
    };
    let text = format!("robot-agent {}{board}, wire {wire}", about.version);
    if wire == WIRE {
        return match about.version == ours {
            true => Finding::ok("versions", format!("{text}, as this fleet-cli")),
            false => {
                Finding::warning("versions", format!("{text}; this fleet-cli is {ours}"), UPDATE_THE_OLDER)
            }
        };
    }
    let text = format!("{text}; this fleet-cli is {ours}, wire {WIRE}");
    match wire + 1 == WIRE {
        true => {
            Finding::warning("versions", format!("{text}, which accepts it"), "update it (docs/upgrade.md)")
        }
        false => Finding::warning("versions", text, UPDATE_THE_OLDER),
    }
}

fn starts(facts: &Facts) -> Vec<Finding> {
    let (mut findings, mut same, mut tags) = (Vec::new(), 0, Vec::new());
    for entry in facts.roster.iter().flatten() {
        if !entry.tags.is_empty() {
            tags.push(format!("{} {}", entry.name, entry.tags.join(" ")));
        }
        let about = facts.abouts.get(&entry.name).and_then(|abouts| abouts.first());
        let (Some(ours), Some(about)) = (entry.start_pose, about) else { continue };
        if is_same_pose(&ours, &about.start_pose) {
            same += 1;
            continue;
        }
        let (ours, theirs) = (describe::map_pose(&ours), describe::map_pose(&about.start_pose));
        let text = format!("start pose {ours} in the roster, but the agent started at {theirs}");
        let hint = "the agent's --start-pose is used: make both the same";
        findings.push(Finding::warning("starts", text, hint).of(&entry.name));
    }
    let tags = if tags.is_empty() { "no tags".to_owned() } else { format!("tags: {}", tags.join(", ")) };
    if !facts.alive.is_empty() {
        findings.push(Finding::ok("starts", format!("{same} as in the roster; {tags}")));
    }
    findings
}

fn is_same_pose(a: &MapPose, b: &MapPose) -> bool {
    let turn = (a.yaw_rad - b.yaw_rad).rem_euclid(std::f64::consts::TAU);
    let turn = turn.min(std::f64::consts::TAU - turn);
    (a.x_m - b.x_m).hypot(a.y_m - b.y_m) <= POSE_TOLERANCE_M && turn <= YAW_TOLERANCE_RAD
}

/// Whether its clock is a simulated world's.
pub(super) fn is_simulated(abouts: &[About]) -> bool {
    abouts.iter().any(|about| about.hardware == "simulated")
}

/// Whether a clock runs as ours does.
pub(super) fn keeps_step(rate: f64) -> bool {
    (rate - 1.0).abs() <= CLOCK_TOLERANCE
}

fn clocks(facts: &Facts) -> Vec<Finding> {
    let (mut findings, mut good) = (Vec::new(), 0);
    for (name, rate) in &facts.rates {
        let simulated = facts.abouts.get(name).is_some_and(|abouts| is_simulated(abouts));
        let finding = match rate {
            None if facts.epochs.get(name).is_some_and(|epochs| epochs.len() > 1) => continue,
            None => {
                let hint = "it restarts, or its state does not arrive: check its log and its network";
                let text = "fewer than two states received since its start";
                simulator::late(facts, name, Finding::problem("clocks", text, hint))
            }
            Some(rate) if keeps_step(*rate) => {
                good += 1;
                continue;
            }
            Some(rate) if simulator::holds_up(facts, name) => Finding::ok(
                "clocks",
                format!(
                    "clock runs at {rate:.2} × this computer's: its simulator is \
                             overloaded"
                ),
            ),
            Some(rate) if simulated => Finding::ok(
                "clocks",
                format!(
                    "clock runs at {rate:.1} × this computer's: a simulator's \
                             --speed"
                ),
            ),
            Some(rate) => {
                let text = format!("clock runs at {rate:.2} × this computer's");
                let hint = "its computer is suspended, throttled or overloaded: check its load";
                Finding::problem("clocks", text, hint)
            }
        };
        findings.push(finding.of(name));
    }
    if good > 0 {
        findings.push(Finding::ok("clocks", format!("{good} within 5 % of this computer's clock")));
    }
    findings
}

fn vehicles(facts: &Facts) -> Vec<Finding> {
    let mut groups = BTreeMap::<&str, Vec<&About>>::new();
    for about in facts.abouts.values().flatten() {
        groups.entry(&about.vehicle_hash).or_default().push(about);
    }
    let Some((most, normal)) = groups.iter().max_by_key(|(_, abouts)| abouts.len()) else {
        return Vec::new();
    };
    if groups.len() == 1 {
        return vec![Finding::ok("vehicle", format!("all have the parameters {most}"))];
    }
    let others = groups.iter().filter(|(hash, _)| *hash != most).flat_map(|(_, abouts)| abouts);
    let findings = others.map(|about| {
        let text = format!(
            "parameters {} differ from {most} of {}: {}",
            about.vehicle_hash,
            normal.iter().map(|about| about.robot.to_string()).collect::<Vec<_>>().join(", "),
            differences(about, normal[0])
        );
        Finding::warning(
            "vehicle",
            text,
            "correct for a different vehicle; otherwise give both the same \
                          config",
        )
        .of(&about.robot)
    });
    findings.collect()
}

fn differences(about: &About, normal: &About) -> String {
    let of = |about: &About| -> BTreeMap<String, String> {
        about
            .vehicle_parameters()
            .map(|parameter| (parameter.name.clone(), parameter.value.clone()))
            .collect()
    };
    let (ours, theirs) = (of(about), of(normal));
    let names: BTreeSet<_> = ours.keys().chain(theirs.keys()).collect();
    let value = |all: &BTreeMap<String, String>, name: &str| all.get(name).cloned().unwrap_or("none".into());
    let mut differing: Vec<String> = names
        .into_iter()
        .filter(|name| ours.get(*name) != theirs.get(*name))
        .map(|name| format!("{name} {} instead of {}", value(&ours, name), value(&theirs, name)))
        .collect();
    let more = differing.len().saturating_sub(DIFFERENCES_SHOWN);
    differing.truncate(DIFFERENCES_SHOWN);
    if more > 0 {
        differing.push(format!("{more} more"));
    }
    if differing.is_empty() { "in no published parameter".to_owned() } else { differing.join(", ") }
}

fn latches(facts: &Facts) -> Vec<Finding> {
    let set =
        facts.states.values().flat_map(|state| state.latches.iter().map(move |set| (&state.robot, set)));
    let finding = |(robot, set)| {
        let hint = format!("`fleet-cli why {robot}`, then `fleet-cli reset {robot}`");
        Finding::problem("latches", describe::latch(set), hint).of(robot)
    };
    set.map(finding).collect()
}

fn faults(facts: &Facts) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, state) in &facts.states {
        for broken in &state.faults {
            let finding = match broken.fault {
                Fault::BatteryLow => Finding::warning,
                _ => Finding::problem,
            };
            let text =
                format!("{} for {}", broken.fault, describe::age(Duration::from_millis(broken.age_ms)));
            findings.push(finding("faults", text, broken.fault.remedy().to_owned()).of(name));
        }
        let said = |fault| state.faults.iter().any(|broken| broken.fault == fault);
        let battery = match state.battery_level {
            BatteryLevel::Unknown if state.battery_v.is_none() => {
                Some(("battery not measured: it may be empty", "measure it by hand"))
            }
            BatteryLevel::Warn | BatteryLevel::Finish if !said(Fault::BatteryLow) => {
                Some(("battery low", Fault::BatteryLow.remedy()))
            }
            BatteryLevel::Critical if !said(Fault::BatteryCritical) => {
                Some((Latch::BatteryCritical.text(), Fault::BatteryCritical.remedy()))
            }
            _ => None,
        };
        findings.extend(battery.map(|(text, hint)| Finding::warning("faults", text, hint).of(name)));
    }
    findings
}

#[cfg(test)]
mod tests;
