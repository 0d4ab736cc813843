//! Robots' states as reports, and guides as messages.

use super::{Guide, PlannedGoal, ReportedRobot, RouteReport};
use std::collections::BTreeMap;
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

impl ReportedRobot {
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

/// Where all robots are, by squares of the floor: who is near one of them.
#[derive(Debug)]
pub struct Neighbours<'a> {
    side_m: f64,
    named: BTreeMap<&'a str, &'a ReportedRobot>,
    squares: BTreeMap<(i64, i64), Vec<&'a ReportedRobot>>,
}

impl<'a> Neighbours<'a> {
    /// Of all that are known; of two of one name the last one counts.
    #[must_use]
    pub fn of(views: impl IntoIterator<Item = &'a ReportedRobot>) -> Self {
        let named: BTreeMap<&str, &ReportedRobot> =
            views.into_iter().map(|view| (view.name.as_str(), view)).collect();
        let largest_m = named.values().map(|view| reach_m(view)).fold(0.0, f64::max);
        let side_m = NEAR_M.max(SIGHT_M + 2.0 * largest_m);
        let mut squares: BTreeMap<(i64, i64), Vec<&ReportedRobot>> = BTreeMap::new();
        for view in named.values() {
            squares.entry(square(&view.pose, side_m)).or_default().push(*view);
        }
        Self { side_m, named, squares }
    }

    /// The robots near this one, nearest first.
    #[must_use]
    pub fn near(&self, name: &str) -> Vec<MapPose> {
        let Some(own) = self.named.get(name) else { return Vec::new() };
        let apart_m =
            |view: &ReportedRobot| libm::hypot(view.pose.x_m - own.pose.x_m, view.pose.y_m - own.pose.y_m);
        let near_m = |view: &ReportedRobot| NEAR_M.max(SIGHT_M + reach_m(own) + reach_m(view));
        let (column, row) = square(&own.pose, self.side_m);
        let beside = |at: i64| at.saturating_sub(1)..=at.saturating_add(1);
        let squares = beside(column).flat_map(|x| beside(row).map(move |y| (x, y)));
        let mut near: Vec<(f64, MapPose)> = squares
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .filter(|view| view.name != name && apart_m(view) < near_m(view))
            .map(|view| (apart_m(view), view.pose))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        near.truncate(Route::MOST_OTHERS);
        near.into_iter().map(|(_, pose)| pose).collect()
    }
}

fn square(pose: &MapPose, side_m: f64) -> (i64, i64) {
    let along = |v: f64| libm::floor(v / side_m) as i64;
    (along(pose.x_m), along(pose.y_m))
}

fn reach_m(view: &ReportedRobot) -> f64 {
    view.car.map_or(0.0, |car| car.reach_m())
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

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::VehicleConfig;

    fn view(name: String, x_m: f64, y_m: f64, car: Option<Car>) -> ReportedRobot {
        ReportedRobot {
            name,
            epoch: 0,
            car,
            pose: MapPose { x_m, y_m, yaw_rad: 0.0 },
            sigma_m: 0.02,
            speed_mps: 0.0,
            goal: None,
            route: None,
            blocked_at_m: None,
            drives: true,
            age_ms: 0,
        }
    }

    #[test]
    fn squares_leave_out_nobody_who_is_near() {
        let car = Car::of(&VehicleConfig::default());
        let large = Car { front_m: 2.0, rear_m: 2.0, half_width_m: 1.0, ..car };
        let cars = [None, Some(car), Some(large)];
        // Also left of and below the map's origin.
        let place = |step: usize, by: f64| 6.0 * libm::sin(step as f64 * by);
        let views: Vec<ReportedRobot> = (0..60)
            .map(|step| view(format!("t{step}"), place(step, 1.7), place(step, 2.9), cars[step % 3]))
            .collect();
        let neighbours = Neighbours::of(&views);
        for own in &views {
            let apart_m = |pose: &MapPose| libm::hypot(pose.x_m - own.pose.x_m, pose.y_m - own.pose.y_m);
            let is_near = |view: &&ReportedRobot| {
                let sight_m = SIGHT_M + reach_m(own) + reach_m(view);
                view.name != own.name && apart_m(&view.pose) < sight_m.max(NEAR_M)
            };
            let mut all: Vec<f64> = views.iter().filter(is_near).map(|view| apart_m(&view.pose)).collect();
            all.sort_by(f64::total_cmp);
            all.truncate(Route::MOST_OTHERS);
            let near: Vec<f64> = neighbours.near(&own.name).iter().map(apart_m).collect();
            assert!(!near.is_empty());
            assert_eq!(near, all, "{}", own.name);
        }
        assert!(neighbours.near("nobody").is_empty());
    }
}
