//! A robot as the cockpit shows it: what is known now, what is not, and since when.

use crate::commands::why;
use crate::output::Tone;
use std::time::Duration;
use xtb_client::fleet_view::{RobotView, by_number};
use xtb_client::scene::{AtMs, Scene, SceneRobot};
use xtb_client::text::reasons;
use xtb_client::text::robot as describe;
use xtb_control::Mode;
use xtb_protocol::Name;
use xtb_protocol::messages::{RobotState, TaskView};

/// Shown for what nobody knows now.
pub(super) const UNKNOWN: &str = "?";

/// How it stands with a robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Standing {
    /// It should be there, and was never heard.
    Missing,
    /// It was there, and has gone.
    Gone,
    /// It is there and tells nothing any more, or has not begun to.
    Stale,
    /// It stands until somebody resets it.
    Latched,
    /// Something is broken.
    Faulty,
    /// Something keeps it from what it is to do.
    Hindered,
    /// It stands as it should.
    Stands,
    /// It drives.
    Drives,
}

impl Standing {
    /// How good that is.
    pub(super) fn tone(self) -> Tone {
        match self {
            Self::Missing | Self::Gone | Self::Stale => Tone::Dim,
            Self::Latched | Self::Faulty => Tone::Bad,
            Self::Hindered => Tone::Warning,
            Self::Stands => Tone::Plain,
            Self::Drives => Tone::Good,
        }
    }

    /// The sign beside its name on the map; `None` = nothing to say.
    pub(super) fn sign(self) -> Option<char> {
        match self {
            Self::Missing | Self::Gone | Self::Stale => Some('?'),
            Self::Latched => Some('#'),
            Self::Faulty | Self::Hindered => Some('!'),
            Self::Stands | Self::Drives => None,
        }
    }
}

/// One robot now.
#[derive(Clone, Copy)]
pub(super) struct ShownRobot<'a> {
    /// Whose.
    pub(super) name: &'a Name,
    /// What people here call it.
    pub(super) alias: Option<&'a str>,
    /// Its row, and so its colour.
    pub(super) row: usize,
    /// Everything that was ever heard.
    pub(super) robot: &'a SceneRobot,
    /// What is known now; `None` = nothing.
    pub(super) state: Option<&'a RobotState>,
    /// Since its last state came; `None` = none has.
    pub(super) age_ms: Option<u64>,
    /// The dispatcher's task that it has.
    pub(super) task: Option<&'a TaskView>,
}

/// The robots that are to be seen, in the order of their numbers.
pub(super) fn sights<'a>(scene: &'a Scene, only: &[Name], now_ms: AtMs) -> Vec<ShownRobot<'a>> {
    let wanted = |name: &Name| only.is_empty() || only.contains(name);
    let mut robots: Vec<_> = scene.robots().iter().filter(|(name, _)| wanted(name)).collect();
    robots.sort_by_key(|(name, _)| by_number(name));
    let sight = |(row, (name, robot)): (usize, (&'a Name, &'a SceneRobot))| ShownRobot {
        name,
        alias: scene.alias(name),
        row,
        robot,
        state: robot.state.as_ref().and_then(|seen| seen.fresh(now_ms)),
        age_ms: robot.state.as_ref().map(|seen| seen.age_ms(now_ms)),
        task: scene.task_of(name),
    };
    robots.into_iter().enumerate().map(sight).collect()
}

impl ShownRobot<'_> {
    /// Whether what is shown of it is its last and not what is now.
    pub(super) fn is_old(&self) -> bool {
        matches!(self.standing(), Standing::Stale | Standing::Gone)
    }

    /// Its name, and its alias if it has one.
    pub(super) fn title(&self) -> String {
        self.alias.map_or_else(|| self.name.to_string(), |alias| format!("{} {alias}", self.name))
    }

    /// How it stands with it.
    pub(super) fn standing(&self) -> Standing {
        let Some(state) = self.state else {
            return match (self.robot.alive, self.age_ms) {
                (true, _) => Standing::Stale,
                (false, Some(_)) => Standing::Gone,
                (false, None) => Standing::Missing,
            };
        };
        let under_way = state.goal.as_ref().is_some_and(|goal| !goal.status.is_final());
        match () {
            () if !state.latches.is_empty() => Standing::Latched,
            () if !state.faults.is_empty() => Standing::Faulty,
            () if why::drives(state) && (under_way || state.mode != Mode::Idle) => Standing::Drives,
            () if under_way => Standing::Hindered,
            () => Standing::Stands,
        }
    }

    /// Where it was last, known to be so or not: (x, y) in m and the yaw.
    pub(super) fn place(&self) -> Option<(f64, f64, f64)> {
        let pose = self.robot.state.as_ref().map(|seen| &seen.value.pose)?;
        Some((pose.x_m, pose.y_m, pose.yaw_rad))
    }

    /// Why it stands, what weighs most first. `long`: in whole words.
    pub(super) fn why(&self, long: bool) -> String {
        let Some(state) = self.state else {
            return match self.standing() {
                Standing::Missing => "MISSING".to_owned(),
                Standing::Gone => format!("MISSING {}", age(self.age_ms)),
                _ if self.age_ms.is_none() => "STALE".to_owned(),
                _ => format!("STALE for {}", age(self.age_ms)),
            };
        };
        let latches = state.latches.iter().map(|set| format!("LATCHED {}", set.latch));
        let faults = state.faults.iter().map(|fault| format!("FAULT {}", fault.fault));
        let latched = |reason| state.latches.iter().any(|set| set.latch.reason() == reason);
        let reasons = state.stopped_because.iter().filter(|reason| !latched(**reason)).map(|reason| {
            let is_over = why::only_latched(*reason);
            match (long, is_over) {
                (true, false) => reason.text().to_owned(),
                (true, true) => format!("{}, since reset", reason.text()),
                (false, false) => reasons::name(reason).replace('_', " "),
                (false, true) => format!("{} (reset)", reasons::name(reason).replace('_', " ")),
            }
        });
        latches.chain(faults).chain(reasons).collect::<Vec<_>>().join(", ")
    }

    /// For those who explain robots.
    pub(super) fn to_view(self) -> RobotView {
        RobotView {
            name: self.name.clone(),
            alias: None,
            // One that is heard is there, whatever its presence says.
            alive: self.robot.alive || self.state.is_some(),
            state: self.state.cloned(),
            age_ms: self.age_ms,
            tags: Vec::new(),
            start_pose: None,
        }
    }
}

/// An age in few characters: `0.3 s`, `12 s`, `5 min`; `never`.
pub(super) fn age(ms: Option<u64>) -> String {
    match ms {
        None => "never".to_owned(),
        Some(ms @ 0..10_000) => format!("{}.{} s", ms / 1000, ms / 100 % 10),
        Some(ms @ 10_000..120_000) => format!("{} s", ms / 1000),
        Some(ms @ 120_000..7_200_000) => format!("{} min", ms / 60_000),
        Some(ms) => format!("{} h", ms / 3_600_000),
    }
}

/// An age in full.
pub(super) fn long_age(ms: u64) -> String {
    describe::age(Duration::from_millis(ms))
}
