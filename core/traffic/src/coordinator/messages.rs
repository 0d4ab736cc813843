//! Robots' states as reports, and guides as messages.

use super::{Guide, PlannedGoal, RobotView, RouteReport};
use xtb_control::Mode;
use xtb_nav::{Car, MapPose, Path};
use xtb_protocol::messages::{
    GoalState, NavPhase, RobotState, Route, RouteGoal, RouteSource, RouteState, Track, Via,
};
use xtb_protocol::{Name, Uuid};

/// How far a range finder sees, in m: 10 to 80 cm (GP2D12's data sheet).
const SIGHT_M: f64 = 0.8;
/// Others are told of up to this distance between the middles, in m, or as far as a range finder sees and the
/// two bodies reach: 1.44 m for two XTBs. Chosen, not measured.
const NEAR_M: f64 = 2.0;

impl RobotView {
    /// What a state of this age says to traffic control, of a robot that is this car.
    #[must_use]
    pub fn of(state: &RobotState, car: Option<Car>, age_ms: u64) -> Self {
        let by_network = matches!(state.mode, Mode::Idle | Mode::Goto);
        let goal = state.goal.as_ref().filter(|goal| !goal.status.is_final()).and_then(planned);
        let led = |route: &&RouteState| route.source == RouteSource::Traffic && route.track.is_some();
        Self {
            name: state.robot.to_string(),
            epoch: state.epoch,
            car,
            pose: MapPose { x_m: state.pose.x_m, y_m: state.pose.y_m, yaw_rad: state.pose.yaw_rad },
            sigma_m: state.pose.sigma_m,
            speed_mps: state.speed_mps.unwrap_or(0.0),
            drives: state.latches.is_empty() && by_network && state.speed_mps.is_some(),
            route: state.nav.route.as_ref().filter(led).and_then(|route| {
                Some(RouteReport {
                    plan: route.plan,
                    path: Path::from(route.track.as_ref()?),
                    done_m: route.done_m,
                    release_m: route.release_m,
                })
            }),
            blocked_at_m: state
                .nav
                .route
                .as_ref()
                .filter(|route| route.phase == NavPhase::Waiting)
                .and_then(|route| route.blocked_at_m)
                .map(<[f64; 2]>::from),
            goal,
            age_ms,
        }
    }
}

/// The robots near one of them, nearest first.
#[must_use]
pub fn others_near(views: &[RobotView], name: &str) -> Vec<MapPose> {
    let Some(own) = views.iter().find(|view| view.name == name) else { return Vec::new() };
    let apart_m = |view: &RobotView| libm::hypot(view.pose.x_m - own.pose.x_m, view.pose.y_m - own.pose.y_m);
    let reach_m = |view: &RobotView| view.car.map_or(0.0, |car| car.reach_m());
    let near_m = |view: &RobotView| NEAR_M.max(SIGHT_M + reach_m(own) + reach_m(view));
    let others = views.iter().filter(|&view| view.name != name && apart_m(view) < near_m(view));
    let mut near: Vec<_> = others.map(|view| (apart_m(view), view.pose)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    near.truncate(Route::MOST_OTHERS);
    near.into_iter().map(|(_, pose)| pose).collect()
}

fn planned(goal: &GoalState) -> Option<PlannedGoal> {
    let (Some(Via::Planned), Some(x_m), Some(y_m)) = (goal.via, goal.x_m, goal.y_m) else { return None };
    Some(PlannedGoal { id: goal.id.as_u128(), x_m, y_m, yaw_rad: goal.yaw_rad })
}

impl Guide {
    /// As it travels: the coordinator's boot, the number of the message, and who is near.
    #[must_use]
    pub fn route(&self, epoch: u64, seq: u64, others: Vec<MapPose>) -> Route {
        Route {
            epoch,
            seq,
            goal: self.goal.map(|(epoch, id)| RouteGoal { epoch, id: Uuid::from_u128(id) }),
            track: self.path.as_ref().map(Track::from),
            plan: self.plan,
            release_m: self.release_m,
            cruise_mps: self.cruise_mps,
            waits_for: self.waits_for.as_ref().and_then(|name| Name::new(name).ok()),
            reason: self.reason.clone(),
            others,
        }
    }
}
