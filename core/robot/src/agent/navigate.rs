//! The second level's place in the brain: the map, pose fixes, which goals go along a path, and what the
//! navigator's decisions become.

use super::requests::Refusal;
use super::{Agent, TurnView};
use crate::authority::arbitration::MotorWriter;
use std::sync::Arc as Shared;
use xtb_control::{Command, Mode, Stamp, Steering, WheelRpm, goto};
use xtb_nav::localization::{self, FixOutcome};
use xtb_nav::navigator::right_of_way::{HEARD_MS, Neighbour};
use xtb_nav::navigator::{
    HoldReason, PlanDone, PlanJob, PreparedMap, Sensed, TargetPose, TrafficGuidance, TurnDecision,
};
use xtb_nav::obstacle_layer::UnmappedObstacle;
use xtb_nav::{MapPose, Path};
use xtb_protocol::gyro_3dmg::PERIOD_MS;
use xtb_protocol::messages::{
    Fix, GoalStatus, MapHash, MapState, NavState, RejectCode, Route, RouteGoal, RouteSource, RouteState,
    StopReason, Track, Via,
};

/// The second level's turns come at the gyro's rate.
pub(super) const STEP_NS: u64 = (PERIOD_MS * 1e6) as u64;
/// A coordinator that has not been heard for this long may be followed by another one: as long as a robot is
/// known to others, and well before the robot counts traffic control as gone.
const OTHER_COORDINATOR_MS: u64 = HEARD_MS;
/// A coordinator's number does not rise by more than this within that time: it sends a few messages a second.
/// One that does is not its own. Chosen, not measured.
const MOST_AHEAD: u64 = 10_000;

/// Who leads, and on which map.
#[derive(Debug, Clone, Default)]
pub(super) struct Lead {
    /// Epoch and number of traffic control's last message, and when it came.
    last: Option<(u64, u64, Stamp)>,
    fleet_hash: Option<MapHash>,
    next_step: Stamp,
    /// The converter's last scan that the navigator has seen.
    scanned: Option<Stamp>,
    fixes: u64,
    fixes_refused: u64,
    routes_refused: u64,
}

impl Agent {
    /// The map to plan on: its own, or the fleet's.
    pub fn set_floor(&mut self, floor: Shared<PreparedMap>) {
        self.nav.set_map(floor);
    }

    /// The hash of the fleet's map; with another one than its own the robot takes no planned goals.
    pub fn set_fleet_map(&mut self, hash: MapHash) {
        self.lead.fleet_hash = Some(hash);
    }

    /// Whether the fleet's map is another one.
    fn has_other_map(&self) -> bool {
        let own = self.nav.map().map(|floor| floor.map().hash());
        own.is_some() && self.lead.fleet_hash.is_some_and(|fleet| own != Some(fleet))
    }

    /// A pose from outside that came in `at`.
    pub fn fix(&mut self, now: Stamp, at: Stamp, fix: &Fix) {
        let age_ns = fix.age_ms.saturating_mul(1_000_000);
        let measured = localization::StampedFix {
            stamp: Stamp::from_ns(at.min(now).ns().saturating_sub(age_ns)),
            x_m: fix.x_m,
            y_m: fix.y_m,
            yaw_rad: fix.yaw_rad,
            covariance: localization::StampedFix::independent(fix.sigma_m, fix.sigma_yaw_rad),
            source: fix.source,
        };
        match self.filter.fix(now, &measured) {
            Ok(FixOutcome::Accepted { .. }) => self.lead.fixes += 1,
            Ok(FixOutcome::Restarted { .. }) => {
                self.lead.fixes += 1;
                self.nav.pose_jumped();
            }
            Ok(FixOutcome::Relocalizing { .. }) => {}
            _ => self.lead.fixes_refused += 1,
        }
    }

    /// Fixes that were too old, or too far off to be true.
    #[must_use]
    pub fn fixes_refused(&self) -> u64 {
        self.lead.fixes_refused
    }

    /// Routes whose number cannot be their coordinator's.
    #[must_use]
    pub fn routes_refused(&self) -> u64 {
        self.lead.routes_refused
    }

    /// Traffic control says how to go on.
    pub fn route(&mut self, now: Stamp, route: &Route) {
        if let Some((epoch, seq, at)) = self.lead.last {
            // A number binds for as long as its coordinator is heard: one message with the largest number
            // must not make a robot deaf to its coordinator for good.
            let heard = now.since_ms(at) < OTHER_COORDINATOR_MS;
            let same = route.epoch == epoch;
            let repeated = same && (route.seq == seq || (heard && route.seq < seq));
            if repeated || (heard && !same) {
                return;
            }
            if heard && route.seq - seq > MOST_AHEAD {
                self.lead.routes_refused += 1;
                return;
            }
        }
        self.lead.last = Some((route.epoch, route.seq, now));
        let present = self.goal.as_ref().filter(|goal| !goal.status.is_final() && goal.is_planned());
        let meant = present
            .is_some_and(|goal| route.goal == Some(RouteGoal { epoch: self.identity.epoch, id: goal.id }));
        let led = meant.then(|| TrafficGuidance {
            plan: route.plan,
            path: route.track.as_ref().map(Path::from),
            release_m: route.release_m,
            cruise_mps: route.cruise_mps,
            waits_for: route.waits_for.as_ref().map(ToString::to_string),
            reason: route.reason.clone(),
        });
        self.nav.guide(now, led, &route.others);
    }

    /// Whether it drives to a planned goal and hears no traffic control: then it has to hear the others.
    #[must_use]
    pub fn goes_alone(&self, now: Stamp) -> bool {
        self.nav.goes_alone(now)
    }

    /// Another robot said this of itself; it came in `at`.
    pub fn neighbour(&mut self, at: Stamp, said: impl Into<Shared<Neighbour>>) {
        self.nav.neighbour(at, said);
    }

    /// A path to look for, beside the control loop.
    pub fn take_plan_job(&mut self) -> Option<PlanJob> {
        self.nav.take_job()
    }

    /// What came of it.
    pub fn planned(&mut self, now: Stamp, done: PlanDone) {
        self.nav.planned(now, done);
    }

    /// How a goal is driven to if it does not say.
    pub(super) fn usual_way(&self) -> Via {
        if self.nav.map().is_some() { Via::Planned } else { Via::Direct }
    }

    /// The memorandum's A-to-B.
    pub(super) fn direct(&self, aim: &TargetPose) -> Result<Command, Refusal> {
        self.sees_both_ways(
            "a direct goal",
            "give the robot a map: planned goals drive only where it looks",
        )?;
        if aim.yaw_rad.is_some() {
            return Err((
                RejectCode::Unsupported,
                "only a planned goal can choose its yaw".into(),
                "omit yaw_rad, or give the robot a map: `fleet-cli map serve`",
            ));
        }
        let (x_m, y_m) = self.filter.map_from_odom().point_to_odom(aim.x_m, aim.y_m);
        let point = goto::GotoGoal::new(x_m, y_m).map_err(|error| {
            (RejectCode::OutOfRange, error.to_string(), "choose a goal closer to the robot")
        })?;
        Ok(Command::Goto(point))
    }

    /// Whether range finders look both ahead and astern, as what drives both ways without a plan needs.
    pub(super) fn sees_both_ways(&self, what: &str, hint: &'static str) -> Result<(), Refusal> {
        match self.nav.car().gears.unseen() {
            None => Ok(()),
            Some(unseen) => {
                let message = format!("{what} needs range finders in the directions driven, and {unseen}");
                Err((RejectCode::Unsupported, message, hint))
            }
        }
    }

    /// Whether a path to there could be looked for at all, by whoever does it now.
    pub(super) fn planned_goal(&self, now: Stamp, aim: &TargetPose) -> Result<Command, Refusal> {
        if !self.nav.car().gears.is_any() {
            return self.sees_both_ways("a goal", BY_HAND).map(|()| STAND);
        }
        let Some(floor) = self.nav.map() else {
            return Err((
                RejectCode::NoMap,
                "a planned goal needs a map, but the robot has none".into(),
                "serve one with `fleet-cli map serve MAP`; `--via direct` needs no map",
            ));
        };
        if self.has_other_map() {
            let fleet = self.lead.fleet_hash.map_or_else(String::new, |hash| hash.to_string());
            return Err((
                RejectCode::NoMap,
                format!("the robot's map {} differs from the fleet's map {fleet}", floor.map().hash()),
                "give both the same map; `--via direct` needs no map",
            ));
        }
        if let Some(zone) = floor.keep_out_at(self.nav.car(), aim) {
            let message = format!("({:.2}, {:.2}) is in keep-out zone {zone}", aim.x_m, aim.y_m);
            return Err((RejectCode::KeepOut, message, "`fleet-cli map show --live` shows the zones"));
        }
        if let Some(what) = floor.in_the_way_at(self.nav.car(), aim) {
            let message = format!("no room for the robot at ({:.2}, {:.2}): {what}", aim.x_m, aim.y_m);
            return Err((
                RejectCode::GoalBlocked,
                message,
                "`fleet-cli map show --live` shows the free \
                space",
            ));
        }
        let here = self.filter.estimate(now).pose;
        let led = self.nav.is_guided(now);
        if let Some(margin_m) = led.then(|| floor.too_near_for_traffic(self.nav.car(), &here, aim)).flatten()
        {
            let message = format!(
                "({:.2}, {:.2}) is too near to what is on the map for traffic control, which keeps {:.0} cm",
                aim.x_m,
                aim.y_m,
                100.0 * margin_m
            );
            return Err((
                RejectCode::GoalBlocked,
                message,
                "choose a goal farther from walls, another yaw, or `--via direct`",
            ));
        }
        Ok(STAND)
    }

    /// A planned goal was accepted.
    pub(super) fn begin_path(&mut self, aim: TargetPose) {
        self.nav.begin(aim);
    }

    /// What the navigator wants of the first level now.
    pub(super) fn navigate(&mut self, now: Stamp, view: TurnView<'_>) -> Option<Command> {
        if now < self.lead.next_step {
            return None;
        }
        let floor = self.nav.map()?.clone();
        self.lead.next_step = now.plus_ns(STEP_NS);
        let scan = view.ages.adc.map(|ms| Stamp::from_ns(now.ns().saturating_sub(ms * 1_000_000)));
        let scanned = scan > self.lead.scanned;
        self.lead.scanned = scan.max(self.lead.scanned);
        let estimate = self.filter.estimate(now);
        if self.goal_runs()
            && let Some(zone) = floor.keep_out_under(self.nav.car(), &estimate.pose)
        {
            let words = format!("the robot is in keep-out zone {zone}");
            self.stand(now, StopReason::InKeepOut, GoalStatus::Failed, Some(&words));
            return self.pending.take();
        }
        let outputs = view.outputs;
        let sensed = Sensed {
            estimate: &estimate,
            speed_mps: outputs.rpm * self.mps_per_rpm * self.odometry_scale.way(),
            blocked: outputs.blocked,
            ir_front_cm: &outputs.ir_front_cm,
            ir_rear_cm: &outputs.ir_rear_cm,
            scanned,
        };
        let decision = self.nav.turn(now, &sensed)?;
        let runs = self.goal.as_ref().is_some_and(|goal| {
            goal.is_planned() && matches!(goal.status, GoalStatus::Running | GoalStatus::Blocked)
        });
        if !runs || self.writer != MotorWriter::Goal {
            return None;
        }
        self.measure(&estimate.pose);
        match decision {
            TurnDecision::Go(command, standing) => {
                let words = self.blocked_words(outputs.blocked, standing);
                self.goal_is(now, words.as_deref());
                self.pass_goal(now);
                Some(command)
            }
            TurnDecision::Reached => {
                self.idle_because = StopReason::GoalReached;
                self.end_goal(now, GoalStatus::Reached, None);
                Some(if self.goal_runs() { STAND } else { Command::Idle })
            }
            TurnDecision::Failed(words) => {
                let because = StopReason::WayBlocked;
                self.stand(now, because, GoalStatus::Failed, Some(&words));
                self.pending.take()
            }
        }
    }

    /// Straight to the goal.
    fn measure(&mut self, pose: &MapPose) {
        let Some(goal) = &mut self.goal else { return };
        if let crate::authority::goal::Target::Point { x_m, y_m, .. } = goal.target {
            goal.distance_m = Some(libm::hypot(x_m - pose.x_m, y_m - pose.y_m));
        }
    }

    /// Why the goal is blocked, if it is.
    fn blocked_words(&self, blocked: bool, standing: Option<HoldReason>) -> Option<String> {
        match standing {
            Some(HoldReason::WaitingForTraffic | HoldReason::Planning) => {
                let first =
                    |led: &TrafficGuidance| led.waits_for.as_ref().map(|name| format!("waiting for {name}"));
                self.nav.guidance().and_then(|led| led.reason.clone().or_else(|| first(led)))
            }
            Some(HoldReason::GivingWay) => self.nav.waits_for().map(|name| format!("giving way to {name}")),
            Some(HoldReason::WayBlocked) if self.nav.waits_for().is_some() => {
                self.nav.waits_for().map(|name| format!("blocked by {name}"))
            }
            Some(HoldReason::WayBlocked) => Some("unmapped obstacle on the path".to_owned()),
            Some(HoldReason::PoseUncertain) => Some(StopReason::PoseUncertain.text().to_owned()),
            Some(HoldReason::AtCusp) => None,
            None => blocked.then(|| "an obstacle in the driving direction".to_owned()),
        }
    }

    /// Why a robot on a path stands.
    pub(super) fn stands_on_its_path(&self) -> Option<StopReason> {
        if self.mode != Mode::Goto {
            return None;
        }
        Some(match self.nav.hold_reason()? {
            HoldReason::Planning => StopReason::Planning,
            HoldReason::WaitingForTraffic => StopReason::WaitingForTraffic,
            HoldReason::WayBlocked => StopReason::WayBlocked,
            HoldReason::PoseUncertain => StopReason::PoseUncertain,
            HoldReason::AtCusp => StopReason::AtCusp,
            HoldReason::GivingWay => StopReason::GivingWay,
        })
    }

    /// What its range finders have seen that is not on its map.
    pub fn unknown_obstacles(&self, now: Stamp) -> impl Iterator<Item = UnmappedObstacle> {
        self.nav.obstacle_layer().into_iter().flat_map(move |local| local.obstacles(now))
    }

    /// Map and path, for the state.
    #[must_use]
    pub fn nav_state(&self, now: Stamp) -> NavState {
        let map = self.nav.map().map(|floor| floor.map()).map(|map| MapState {
            name: map.name().to_owned(),
            hash: map.hash().to_string(),
            fleet_hash: self.lead.fleet_hash.filter(|_| self.has_other_map()).map(|hash| hash.to_string()),
        });
        let route = self.nav.progress().map(|progress| RouteState {
            source: if progress.plan > 0 { RouteSource::Traffic } else { RouteSource::Own },
            plan: progress.plan,
            phase: progress.phase,
            track: progress.path.map(Track::from),
            done_m: progress.done_m,
            release_m: progress.release_m,
            off_m: progress.off_m,
            waits_for: progress.waits_for.and_then(|name| xtb_protocol::Name::new(name).ok()),
            blocked_at_m: progress.blocked_at.map(|[x_m, y_m]| (x_m, y_m)),
            plans: progress.plans,
        });
        NavState { map, traffic: self.nav.is_guided(now), route, fixes: self.lead.fixes }
    }
}

/// What to do with a car that sees nothing on its way.
pub(super) const BY_HAND: &str =
    "drive it by hand: `fleet-cli teleop`; `range_finders` in its settings says what is fitted";
/// Standing, wheels straight, in mode goto.
pub(super) const STAND: Command = Command::Follow { rpm: WheelRpm::ZERO, steering: Steering::CENTRED };
