//! Roles, and what each may do.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// What an identity is for. The keys that each may use are in `xtb-bus`, `acl.rs`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// One robot, under its own name.
    Robot,
    /// A person who looks, and calls an emergency stop.
    Viewer,
    /// A person who drives.
    Operator,
    /// The page's server: an operator for those who have signed in.
    Dashboard,
    /// The dispatcher, or its stand-by.
    Dispatcher,
    /// Traffic control.
    Traffic,
    /// The map server.
    Map,
    /// A source of pose fixes for all robots.
    Tracker,
    /// A recorder: looks.
    Recorder,
    /// A simulator: all robots, their world, map and fixes.
    Simulator,
    /// A router: the fleet's, or another one of its mesh.
    Router,
}

/// What a program is about to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Action {
    /// Read states, events, maps and tasks.
    Look,
    /// Call an emergency stop of one robot or all.
    EmergencyStop,
    /// Acquire a robot's lease, drive, stop and reset it, set its pose.
    Drive,
    /// Fetch a robot's recordings.
    FetchRecordings,
    /// Submit and change tasks.
    ChangeTasks,
    /// Change zones and places of the fleet's map.
    ChangeMap,
    /// Run a dispatcher.
    ServeDispatcher,
    /// Run traffic control.
    ServeTraffic,
    /// Serve the fleet's map.
    ServeMap,
    /// Serve the page.
    ServeDashboard,
    /// Publish pose fixes.
    PublishFixes,
    /// Be a robot.
    RunRobot,
    /// Simulate robots.
    Simulate,
}

/// Not the name of a role.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0:?} is not a role")]
pub struct UnknownRole(String);

impl Role {
    /// Every role.
    pub const ALL: [Self; 11] = [
        Self::Robot,
        Self::Viewer,
        Self::Operator,
        Self::Dashboard,
        Self::Dispatcher,
        Self::Traffic,
        Self::Map,
        Self::Tracker,
        Self::Recorder,
        Self::Simulator,
        Self::Router,
    ];
    /// Those that people have.
    pub const PEOPLE: [Self; 2] = [Self::Operator, Self::Viewer];
    /// Those that services have.
    pub const SERVICES: [Self; 7] = [
        Self::Dispatcher,
        Self::Traffic,
        Self::Map,
        Self::Tracker,
        Self::Dashboard,
        Self::Recorder,
        Self::Simulator,
    ];

    /// As in files and on command lines.
    #[must_use]
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Robot => "robot",
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Dashboard => "dashboard",
            Self::Dispatcher => "dispatcher",
            Self::Traffic => "traffic",
            Self::Map => "map",
            Self::Tracker => "tracker",
            Self::Recorder => "recorder",
            Self::Simulator => "simulator",
            Self::Router => "router",
        }
    }

    /// With its article: `a viewer`, `an operator`.
    #[must_use]
    pub fn noun(self) -> &'static str {
        match self {
            Self::Robot => "a robot",
            Self::Viewer => "a viewer",
            Self::Operator => "an operator",
            Self::Dashboard => "a dashboard",
            Self::Dispatcher => "a dispatcher",
            Self::Traffic => "traffic control",
            Self::Map => "a map server",
            Self::Tracker => "a tracker",
            Self::Recorder => "a recorder",
            Self::Simulator => "a simulator",
            Self::Router => "a router",
        }
    }

    /// Whether it is a person's.
    #[must_use]
    pub fn is_person(self) -> bool {
        Self::PEOPLE.contains(&self)
    }

    /// What it allows, in words.
    #[must_use]
    pub fn allows(self) -> &'static str {
        match self {
            Self::Robot => "may be driven, under its own name",
            Self::Viewer => "may look and call an emergency stop",
            Self::Operator => {
                "may look, drive, change tasks and the map, fetch recordings and call an emergency stop"
            }
            Self::Dashboard => "may serve the page, and do for its users what an operator may",
            Self::Dispatcher => "may look, run a dispatcher and drive robots for its tasks",
            Self::Traffic => "may look and run traffic control",
            Self::Map => "may look and serve the map",
            Self::Tracker => "may publish pose fixes",
            Self::Recorder => "may look and record",
            Self::Simulator => "may simulate robots",
            Self::Router => "may route",
        }
    }

    /// Whether it may do this.
    #[must_use]
    pub fn may(self, action: Action) -> bool {
        use Action as A;
        match self {
            Self::Robot => action == A::RunRobot,
            Self::Viewer => matches!(action, A::Look | A::EmergencyStop),
            Self::Operator => {
                matches!(
                    action,
                    A::Look
                        | A::EmergencyStop
                        | A::Drive
                        | A::FetchRecordings
                        | A::ChangeTasks
                        | A::ChangeMap
                )
            }
            Self::Dashboard => matches!(
                action,
                A::Look
                    | A::EmergencyStop
                    | A::Drive
                    | A::FetchRecordings
                    | A::ChangeTasks
                    | A::ChangeMap
                    | A::ServeDashboard
            ),
            // It includes traffic control, and serves the map if it is given one.
            Self::Dispatcher => {
                matches!(action, A::Look | A::ServeDispatcher | A::ServeTraffic | A::ServeMap)
            }
            Self::Traffic => matches!(action, A::Look | A::ServeTraffic),
            Self::Map => matches!(action, A::Look | A::ServeMap),
            Self::Tracker => action == A::PublishFixes,
            Self::Recorder => action == A::Look,
            Self::Simulator => matches!(action, A::Simulate | A::RunRobot | A::ServeMap | A::PublishFixes),
            Self::Router => false,
        }
    }
}

impl Action {
    /// What a refusal says after "may not".
    #[must_use]
    pub fn text(self) -> &'static str {
        match self {
            Self::Look => "look at the fleet",
            Self::EmergencyStop => "call an emergency stop",
            Self::Drive => "control robots",
            Self::FetchRecordings => "fetch recordings",
            Self::ChangeTasks => "change tasks",
            Self::ChangeMap => "change the map",
            Self::ServeDispatcher => "run a dispatcher",
            Self::ServeTraffic => "run traffic control",
            Self::ServeMap => "serve a map",
            Self::ServeDashboard => "serve the dashboard",
            Self::PublishFixes => "publish pose fixes",
            Self::RunRobot => "be a robot",
            Self::Simulate => "simulate robots",
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.as_str())
    }
}

impl FromStr for Role {
    type Err = UnknownRole;

    fn from_str(text: &str) -> Result<Self, UnknownRole> {
        let found = Self::ALL.into_iter().find(|role| role.as_str() == text);
        found.ok_or_else(|| UnknownRole(text.chars().take(32).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_role_reads_back_as_itself() {
        for role in Role::ALL {
            assert_eq!(role.as_str().parse(), Ok(role));
        }
        assert_eq!("king".parse::<Role>().unwrap_err().to_string(), "\"king\" is not a role");
    }
}
