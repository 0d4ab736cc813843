//! The fleet as `list` and `status` show it: a row for each robot that is or should be there.

use crate::client::{Client, LastState};
use crate::error::Result;
use crate::state_feed::StateFeed;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_protocol::keys::RobotKeys;
use xtb_protocol::messages::{RobotState, RosterEntry, SimStats};

/// The whole fleet.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FleetView {
    /// Its name.
    pub fleet: Name,
    /// In the order of their names' numbers.
    pub robots: Vec<RobotView>,
    /// How the simulator runs that has robots of it; `None` = there is none, or nobody asked.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub simulator: Option<SimStats>,
}

/// One robot.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RobotView {
    /// Whose.
    pub name: Name,
    /// What people here call it, from the settings.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub alias: Option<String>,
    /// Whether it is present: alive means commandable.
    pub alive: bool,
    /// `None` = unknown, or one of a feed that is so old that it says nothing any more. One that was asked for is
    /// shown however long the others' answers took: its age says it.
    pub state: Option<RobotState>,
    /// Since the last state arrived, stale or not.
    pub age_ms: Option<u64>,
    /// From the roster.
    pub tags: Vec<String>,
    /// Where the roster says that it starts.
    pub start_pose: Option<MapPose>,
}

impl FleetView {
    /// Asks everybody once, and by name those who are there and did not answer; `wanted` robots get a row in any
    /// case.
    pub async fn ask(client: &Client, fleet: &Name, wanted: &BTreeSet<Name>) -> Result<Self> {
        let (alive, states) = client.heard().await?;
        Ok(Self::of(fleet, &alive, &states, wanted))
    }

    /// The same, but asks only the robots behind `keys` for their states.
    pub async fn ask_robots(
        client: &Client,
        fleet: &Name,
        keys: &RobotKeys,
        wanted: &BTreeSet<Name>,
    ) -> Result<Self> {
        let (alive, states) = tokio::join!(client.alive(), client.states(keys));
        Ok(Self::of(fleet, &alive?, &states?, wanted))
    }

    /// What a feed knows now; a robot that has left keeps its row.
    pub fn now(feed: &StateFeed, fleet: &Name, wanted: &BTreeSet<Name>) -> Self {
        let states = feed.states();
        let wanted = wanted.iter().chain(states.keys()).cloned().collect();
        Self::showing(fleet, &feed.alive(), &states, &wanted, LastState::fresh)
    }

    /// Of those who are there, the states that they answered, and whoever gets a row in any case.
    pub fn of(
        fleet: &Name,
        alive: &BTreeSet<Name>,
        states: &BTreeMap<Name, LastState>,
        wanted: &BTreeSet<Name>,
    ) -> Self {
        Self::showing(fleet, alive, states, wanted, |seen| Some(&seen.state))
    }

    fn showing(
        fleet: &Name,
        alive: &BTreeSet<Name>,
        states: &BTreeMap<Name, LastState>,
        wanted: &BTreeSet<Name>,
        shown: fn(&LastState) -> Option<&RobotState>,
    ) -> Self {
        let mut names: Vec<&Name> = alive.iter().chain(wanted).collect();
        names.sort_by_key(|name| by_number(name));
        names.dedup();
        let robots = names.into_iter().map(|name| {
            let seen = states.get(name);
            RobotView {
                name: name.clone(),
                alias: None,
                alive: alive.contains(name),
                state: seen.and_then(shown).cloned(),
                tags: Vec::new(),
                start_pose: None,
                age_ms: seen.map(|seen| u64::try_from(seen.age().as_millis()).unwrap_or(u64::MAX)),
            }
        });
        Self { fleet: fleet.clone(), robots: robots.collect(), simulator: None }
    }

    /// Whether each of them is there and was heard.
    pub fn is_known(&self) -> bool {
        self.robots.iter().all(|robot| robot.alive && robot.state.is_some())
    }

    /// With what the roster says of each.
    pub fn with_roster(mut self, entries: &[RosterEntry]) -> Self {
        for row in &mut self.robots {
            if let Some(entry) = entries.iter().find(|entry| entry.name == row.name) {
                row.tags.clone_from(&entry.tags);
                row.start_pose = entry.start_pose;
            }
        }
        self
    }

    /// With what people here call them.
    #[must_use]
    pub fn with_aliases(mut self, aliases: &BTreeMap<Name, String>) -> Self {
        for row in &mut self.robots {
            row.alias = aliases.get(&row.name).cloned();
        }
        self
    }

    /// Only these robots; none named = all.
    pub fn only(mut self, robots: &[Name]) -> Self {
        if !robots.is_empty() {
            self.robots.retain(|row| robots.contains(&row.name));
        }
        self
    }
}

/// `xtb-2` comes before `xtb-10`.
pub fn by_number(name: &Name) -> (String, u64, String) {
    let text = name.as_str();
    let stem = text.trim_end_matches(|c: char| c.is_ascii_digit());
    (stem.to_owned(), text[stem.len()..].parse().unwrap_or(0), text.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_missing_have_a_row_and_numbers_count() {
        let names = |all: &[&str]| all.iter().map(|name| Name::new(name).unwrap()).collect::<BTreeSet<_>>();
        let fleet = Name::new("lab").unwrap();
        let alive = names(&["xtb-10", "xtb-2"]);
        let view = FleetView::of(&fleet, &alive, &BTreeMap::new(), &names(&["xtb-1", "xtb-2"]));
        let rows: Vec<_> = view.robots.iter().map(|row| (row.name.as_str(), row.alive)).collect();
        assert_eq!(rows, [("xtb-1", false), ("xtb-2", true), ("xtb-10", true)]);
        assert!(view.robots.iter().all(|row| row.state.is_none() && row.age_ms.is_none()));
    }

    #[test]
    fn a_state_that_was_asked_for_is_shown_with_its_age_and_an_old_one_of_a_feed_is_not() {
        let fleet = Name::new("lab").unwrap();
        let robot = Name::new("xtb-1").unwrap();
        let at = std::time::Instant::now().checked_sub(2 * crate::client::STALE).unwrap();
        let state = crate::fake::state("xtb-1");
        let states = BTreeMap::from([(robot.clone(), LastState { state, at })]);
        let alive = BTreeSet::from([robot]);
        let asked = FleetView::of(&fleet, &alive, &states, &BTreeSet::new());
        assert!(asked.robots[0].state.is_some() && asked.robots[0].age_ms >= Some(1000));
        let fed = FleetView::showing(&fleet, &alive, &states, &BTreeSet::new(), LastState::fresh);
        assert!(fed.robots[0].state.is_none() && fed.robots[0].age_ms >= Some(1000));
    }
}
