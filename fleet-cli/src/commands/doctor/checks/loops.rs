//! Whether the robots' control loops keep their time, and whether they have the priority that they were started
//! for (`robot-agent --realtime`).

use super::{Facts, Finding, is_simulated, simulator};
use xtb_protocol::Name;
use xtb_protocol::messages::{About, REALTIME_OFF, REALTIME_ON, REALTIME_REMEDY};

const TOPIC: &str = "loops";
/// A turn of a robot's control loop that is later has lost a turn.
const LATE_US: u64 = 5000;

pub(super) fn check(facts: &Facts) -> Vec<Finding> {
    let mut findings = late(facts);
    findings.extend(refused(facts));
    if findings.is_empty() && !facts.states.is_empty() {
        let said: Vec<_> = facts.abouts.values().flatten().map(About::realtime).collect();
        let on = said.iter().filter(|said| **said == Some(REALTIME_ON)).count();
        let priority = match on {
            0 => "off".to_owned(),
            _ if on == said.len() => "on".to_owned(),
            _ => format!("on for {on} of {}", said.len()),
        };
        return vec![Finding::ok(
            TOPIC,
            format!("all control loops on time; real-time priority: {priority}"),
        )];
    }
    findings
}

fn late(facts: &Facts) -> Vec<Finding> {
    let late = facts.states.iter().filter(|(_, state)| state.turn_late_us > LATE_US);
    late.map(|(name, state)| {
        let text = format!("control loop {} ms late", state.turn_late_us / 1000);
        let hint = if could_be_prioritized(facts, name) {
            "its computer is overloaded: end other programs on it, or start its agent with --realtime"
        } else {
            "its computer is overloaded: end other programs on it"
        };
        simulator::late(facts, name, Finding::warning(TOPIC, text, hint)).of(name)
    })
    .collect()
}

/// A robot with hardware of its own whose agent was started without.
fn could_be_prioritized(facts: &Facts, robot: &Name) -> bool {
    let abouts = facts.abouts.get(robot).map(Vec::as_slice).unwrap_or_default();
    !is_simulated(abouts) && abouts.iter().any(|about| about.realtime() == Some(REALTIME_OFF))
}

/// Agents that asked for it and did not get all of it.
fn refused(facts: &Facts) -> impl Iterator<Item = Finding> {
    facts.abouts.values().flatten().filter_map(|about| {
        let why = about.realtime().filter(|said| ![REALTIME_OFF, REALTIME_ON].contains(said))?;
        Some(Finding::warning(TOPIC, format!("--realtime: {why}"), REALTIME_REMEDY).of(&about.robot))
    })
}

#[cfg(test)]
mod tests {
    use super::super::Level;
    use super::super::tests::healthy;
    use super::*;
    use xtb_client::fake::name;
    use xtb_protocol::messages::{ParameterInfo, REALTIME};

    fn says(facts: &mut Facts, robot: &str, value: &str) {
        let (name_of, value) = (REALTIME.to_owned(), value.to_owned());
        let info = ParameterInfo { name: name_of, value, unit: String::new(), origin: "ours".into() };
        let vehicle = &mut facts.abouts.get_mut(&name(robot)).unwrap()[0].vehicle;
        vehicle.retain(|info| info.name != REALTIME);
        vehicle.push(info);
    }

    fn only(facts: &Facts) -> Finding {
        let mut found = check(facts);
        assert_eq!(found.len(), 1, "{found:?}");
        found.remove(0)
    }

    #[test]
    fn the_priority_of_loops_on_time_is_told() {
        let mut facts = healthy();
        let mut told = |first: &str, second: &str| {
            says(&mut facts, "xtb-1", first);
            says(&mut facts, "xtb-2", second);
            let found = only(&facts);
            assert_eq!(found.level, Level::Ok);
            found.text.rsplit_once(": ").unwrap().1.to_owned()
        };
        assert_eq!(told("off", "off"), "off");
        assert_eq!(told("off", "on"), "on for 1 of 2");
        assert_eq!(told("on", "on"), "on");
        // An agent that does not know it has none.
        assert!(only(&healthy()).text.ends_with("real-time priority: off"));
    }

    #[test]
    fn a_refusal_is_a_warning_with_the_reason_and_how_to_permit_it() {
        let mut facts = healthy();
        says(&mut facts, "xtb-1", "on");
        says(&mut facts, "xtb-2", "SCHED_FIFO refused: not permitted");
        let found = only(&facts);
        assert_eq!((found.level, found.robot), (Level::Warning, Some(name("xtb-2"))));
        assert_eq!(found.text, "--realtime: SCHED_FIFO refused: not permitted");
        let hint = found.hint.unwrap();
        for part in ["setcap cap_sys_nice,cap_ipc_lock+ep", "LimitRTPRIO=20", "LimitMEMLOCK=infinity"] {
            assert!(hint.contains(part), "{hint}");
        }
    }

    #[test]
    fn a_late_loop_is_told_of_the_priority_unless_it_has_it() {
        let mut facts = healthy();
        facts.states.get_mut(&name("xtb-1")).unwrap().turn_late_us = 12_000;
        for (said, hint) in [("off", true), ("on", false)] {
            says(&mut facts, "xtb-1", said);
            let found = only(&facts);
            assert_eq!((found.level, found.text.as_str()), (Level::Warning, "control loop 12 ms late"));
            assert_eq!(found.hint.unwrap().contains("--realtime"), hint, "{said}");
        }
    }

    #[test]
    fn the_priority_is_no_difference_between_vehicles() {
        let mut facts = healthy();
        says(&mut facts, "xtb-1", "off");
        says(&mut facts, "xtb-2", "on");
        facts.abouts.get_mut(&name("xtb-2")).unwrap()[0].vehicle_hash = "other".into();
        let found = super::super::vehicles(&facts);
        assert!(found[0].text.ends_with("in no published parameter"), "{found:?}");
    }
}
