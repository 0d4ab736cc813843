//! What a planner is asked: where to go, what counts, and how much the search may cost.

use super::error::{End, PlanError};
use super::lattice::Lattice;
use crate::MapPose;
use crate::geometry::path::wrap_rad;

/// Headings that a goal without one is approached in, 15° apart; the lattices' headings are multiples of it.
pub(super) const GOAL_HEADINGS: u16 = 24;

/// Where to go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlannerGoal {
    /// In m.
    pub x_m: f64,
    /// In m.
    pub y_m: f64,
    /// `None` = any heading will do.
    pub yaw_rad: Option<f64>,
    /// A path may end this far away, in m; it does so only where that saves the search something.
    pub tolerance_m: f64,
    /// And this far off its heading, in rad.
    pub tolerance_rad: f64,
}

impl PlannerGoal {
    /// This pose exactly.
    #[must_use]
    pub fn exactly(pose: &MapPose) -> Self {
        let MapPose { x_m, y_m, yaw_rad } = *pose;
        Self { x_m, y_m, yaw_rad: Some(yaw_rad), tolerance_m: 0.0, tolerance_rad: 0.0 }
    }

    /// Whether a car at `pose` is there.
    #[must_use]
    pub fn met_by(&self, pose: &MapPose) -> bool {
        /// A micrometre, and a thousandth of a milliradian.
        const ROUNDING: f64 = 1e-6;
        let turned = self.yaw_rad.map_or(0.0, |yaw| wrap_rad(pose.yaw_rad - yaw).abs());
        let apart = libm::hypot(pose.x_m - self.x_m, pose.y_m - self.y_m);
        apart <= self.tolerance_m + ROUNDING && turned <= self.tolerance_rad + ROUNDING
    }

    pub(super) fn pose(&self, yaw_rad: f64) -> MapPose {
        MapPose { x_m: self.x_m, y_m: self.y_m, yaw_rad: wrap_rad(yaw_rad) }
    }
}

/// What a search weighs and how much it may cost. Costs are in m of free floor driven ahead.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannerSettings {
    /// What a metre astern costs.
    pub reverse_factor: f64,
    /// What a change of gear costs.
    pub gear_change_m: f64,
    /// What a change of curvature costs.
    pub bend_change_m: f64,
    /// What a metre costs more while the car's side touches something; less further off.
    pub near_factor: f64,
    /// Beyond this much room beside the car it costs nothing more.
    pub near_m: f64,
    /// How much the rest of the way counts against the way so far: 1 = the cheapest path of the
    /// lattice, more = sooner.
    pub heuristic_weight: f64,
    /// Squares in which the way around everything is measured, in m.
    pub square_m: f64,
    /// A curve to the other end is tried (analytic expansion) each time that this much less is left, in m per expansion; the nearer, the more often.
    pub analytic_spacing_m: f64,
    /// From coarse to fine, for each tree by itself; one that has emptied its last says that there is no way.
    pub lattices: Vec<Lattice>,
    /// Expansions on all lattices together.
    pub most_expansions: usize,
    /// Rounds of shortening.
    pub rounds: usize,
}

impl Default for PlannerSettings {
    fn default() -> Self {
        let lattice = |cell_m, headings, turn, most_expansions, pocket| Lattice {
            cell_m,
            headings,
            turn,
            half_lock: false,
            most_expansions,
            pocket,
        };
        const ANY: usize = usize::MAX;
        Self {
            reverse_factor: 1.3,
            gear_change_m: 0.3,
            bend_change_m: 0.02,
            near_factor: 1.0,
            near_m: 0.2,
            heuristic_weight: 2.5,
            square_m: 0.05,
            analytic_spacing_m: 0.2,
            lattices: vec![
                lattice(0.1, 48, 3, 10_000, ANY),
                lattice(0.05, 72, 1, ANY, ANY),
                lattice(0.025, 120, 1, ANY, 2000),
                lattice(0.01, 120, 1, ANY, 2000),
            ],
            most_expansions: 500_000,
            rounds: 2,
        }
    }
}

/// Refuses what is not finite or makes no search.
pub(super) fn check(
    start: &MapPose,
    goal: &PlannerGoal,
    settings: &PlannerSettings,
) -> Result<(), PlanError> {
    if ![start.x_m, start.y_m, start.yaw_rad].iter().all(|v| v.is_finite()) {
        return Err(PlanError::NotAPose(End::Start));
    }
    let tolerances = [goal.tolerance_m, goal.tolerance_rad];
    if ![goal.x_m, goal.y_m, goal.yaw_rad.unwrap_or(0.0)].iter().all(|v| v.is_finite())
        || !tolerances.iter().all(|v| v.is_finite() && *v >= 0.0)
    {
        return Err(PlanError::NotAPose(End::Goal));
    }
    let fits = |lattice: &Lattice| {
        (0.005..=1.0).contains(&lattice.cell_m)
            && (GOAL_HEADINGS..=360).contains(&lattice.headings)
            && lattice.headings.is_multiple_of(GOAL_HEADINGS)
            && (1..=lattice.headings / 4).contains(&lattice.turn)
    };
    if settings.lattices.is_empty() || !settings.lattices.iter().all(fits) {
        return Err(PlanError::Settings(
            "a lattice must have cells of 0.005 to 1 m, a multiple of 24 headings up to 360, and moves of up \
             to a quarter turn",
        ));
    }
    let weights =
        [settings.reverse_factor, settings.gear_change_m, settings.bend_change_m, settings.near_factor];
    let sizes = [settings.near_m, settings.heuristic_weight, settings.square_m, settings.analytic_spacing_m];
    if !weights.iter().all(|v| v.is_finite() && *v >= 0.0) || !sizes.iter().all(|v| v.is_finite() && *v > 0.0)
    {
        return Err(PlanError::Settings("weights must not be negative, sizes must be more than 0"));
    }
    Ok(())
}
