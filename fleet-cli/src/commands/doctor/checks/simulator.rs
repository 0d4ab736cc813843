//! Whether the simulator keeps up, and what of its robots is its own fault. They live in its time: where
//! it is overloaded they are late, or silent, and nothing is wrong with them.

use super::{Facts, Finding, Level, is_simulated};
use xtb_client::text::robot as describe;
use xtb_protocol::Name;
use xtb_protocol::messages::SimStats;

/// What is to be done about its robots then.
const OVERLOADED: &str = "the simulator is overloaded, see above: not the robot's fault";

/// How it runs, if there is one.
pub(super) fn check(facts: &Facts) -> Vec<Finding> {
    const TOPIC: &str = "simulator";
    let Some(stats) = &facts.simulator else { return Vec::new() };
    let runs = describe::simulator(stats);
    if !stats.is_slow() {
        return vec![Finding::ok(TOPIC, runs)];
    }
    let hint = "use fewer --robots, a lower --speed, or a faster computer";
    vec![Finding::warning(TOPIC, format!("{runs}: the computer is too slow for it"), hint)]
}

/// Whether a robot is in a simulator that is overloaded.
pub(super) fn holds_up(facts: &Facts, robot: &Name) -> bool {
    let told = facts.abouts.get(robot).is_some_and(|abouts| is_simulated(abouts));
    facts.simulator.as_ref().is_some_and(SimStats::is_slow) && (told || facts.simulated.contains(robot))
}

/// What to do about a robot, unless it is the simulator's fault.
pub(super) fn or_overloaded(facts: &Facts, robot: &Name, hint: &str) -> String {
    if holds_up(facts, robot) { OVERLOADED } else { hint }.to_owned()
}

/// What is late or silent is worth a look at most, if it is the simulator's fault.
pub(super) fn late(facts: &Facts, robot: &Name, finding: Finding) -> Finding {
    if !holds_up(facts, robot) {
        return finding;
    }
    Finding { level: Level::Warning, hint: Some(OVERLOADED.to_owned()), ..finding }
}
