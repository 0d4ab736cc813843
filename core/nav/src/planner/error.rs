//! Why there is no plan, and what is in the way.

use super::space::Hit;
use crate::MapPose;
use std::fmt;
use thiserror::Error;

/// Which end of a path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// Where the car stands.
    Start,
    /// Where it is to go.
    Goal,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlanError {
    /// A number of the start or the goal is not finite, or a tolerance is negative.
    #[error("the {0} is not a pose")]
    NotAPose(End),
    /// A setting that makes no search.
    #[error("{0}")]
    Settings(&'static str),
    /// The car touches something where it stands.
    #[error("the start touches {0}")]
    StartInCollision(Hit),
    /// It would touch something at the goal, whichever way it points there.
    #[error("the goal touches {0}")]
    GoalInCollision(Hit),
    /// The goal lies in a keep-out zone.
    #[error("the goal is in keep-out {name}, at ({:.2}, {:.2})", at.x_m, at.y_m)]
    GoalKeptOut {
        /// The zone.
        name: String,
        /// The cell of it that is touched.
        at: Hit,
    },
    /// All that can be reached from one end has been looked at, and the other is not among it.
    #[error("the {end} is enclosed: no path beyond ({:.2}, {:.2}){}", at_m[0], at_m[1], because(by.as_ref()))]
    Unreachable {
        /// Which one is walled in.
        end: End,
        /// As near to the other end as it gets, in m.
        at_m: [f64; 2],
        /// What is in the way there on the straight line to the other end.
        by: Option<Hit>,
    },
    /// The search has cost as much as it may.
    #[error(
        "no path found after {expansions} expansions; nearest point ({:.2}, {:.2}), {left_m:.1} m from the \
         goal{}",
        nearest.x_m, nearest.y_m, because(by.as_ref())
    )]
    Budget {
        /// Poses looked at.
        expansions: usize,
        /// The nearest that was reached.
        nearest: MapPose,
        /// How far the goal is from there around everything, at least.
        left_m: f64,
        /// What is in the way there on the straight line to the goal.
        by: Option<Hit>,
    },
}

fn because(by: Option<&Hit>) -> String {
    by.map_or_else(String::new, |hit| format!(", in front of {hit}"))
}
