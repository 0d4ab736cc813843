//! What the robot publishes: everything 20 times a second or less, and only while somebody hears it.

use crate::snapshot::Snapshot;
use xtb_control::{Mode, VehicleConfig};
use xtb_protocol::Name;
use xtb_protocol::messages::{Fault, Latch, RobotState, StopReason, Track};
use xtb_ros2::convert::{Robot, battery, diagnostics, plan, pose_stamped};
use xtb_ros2::offer;
use xtb_ros2::types::{Distro, Duration, GoalId, GoalStatusArray, NavigateFeedback, Text, Time};
use xtb_ros2_node::{Node, NodeError, Publisher};

/// States between two messages of 1 Hz, and of 5 Hz.
const STATES_A_SECOND: u64 = 20;
const STATES_A_FEEDBACK: u64 = 4;

/// What `/diagnostics` says beside the robot's state.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Notes {
    /// Told at each change.
    pub(super) events: Vec<(&'static str, String)>,
    /// Told once a second.
    pub(super) counters: Vec<(&'static str, String)>,
}

/// What of a robot is told at each change.
type Told = (Mode, Vec<StopReason>, Vec<Fault>, Vec<Latch>, Vec<(&'static str, String)>);

/// The robot's topics.
pub(super) struct Publishers {
    robot: Robot,
    distro: Distro,
    odom: Publisher,
    tf: Publisher,
    tf_static: Publisher,
    description: Publisher,
    imu: Publisher,
    /// Of the range finders that are fitted, front and rear.
    ranges: [Vec<Publisher>; 2],
    battery: Publisher,
    diagnostics: Publisher,
    plan: Publisher,
    status: Publisher,
    feedback: Publisher,
    track: Option<Track>,
    told: Option<Told>,
    /// The goal that feedback is given of, and since when.
    goal: Option<(GoalId, Time)>,
}

impl Publishers {
    pub(super) async fn declare(
        node: &Node,
        distro: Distro,
        robot: &Name,
        vehicle: &VehicleConfig,
    ) -> Result<Self, NodeError> {
        let mut ranges = [const { Vec::new() }; 2];
        let fitted = [&vehicle.range_finders.front, &vehicle.range_finders.rear];
        for ((publishers, channels), fitted) in ranges.iter_mut().zip(&offer::RANGES).zip(fitted) {
            for channel in channels.iter().take(fitted.0.len()) {
                publishers.push(node.publisher(channel).await?);
            }
        }
        Ok(Self {
            robot: Robot::new(robot, vehicle),
            distro,
            odom: node.publisher(&offer::ODOM).await?,
            tf: node.publisher(&offer::TF).await?,
            tf_static: node.publisher(&offer::TF_STATIC).await?,
            description: node.publisher(&offer::ROBOT_DESCRIPTION).await?,
            imu: node.publisher(&offer::IMU).await?,
            ranges,
            battery: node.publisher(&offer::BATTERY_STATE).await?,
            diagnostics: node.publisher(&offer::DIAGNOSTICS).await?,
            plan: node.publisher(&offer::PLAN).await?,
            status: node.publisher(&offer::GOAL_STATUS).await?,
            feedback: node.publisher(&offer::feedback(distro)).await?,
            track: None,
            told: None,
            goal: None,
        })
    }

    /// What never changes; who comes later gets it too.
    pub(super) async fn begin(&self, now: &Time) {
        self.tf_static.put(&self.robot.static_transforms(now)).await;
        self.description.put(&Text { data: self.robot.description() }).await;
    }

    /// Whether anybody hears diagnostics.
    pub(super) fn diagnoses(&self) -> bool {
        self.diagnostics.is_heard()
    }

    /// What the control loop shows; `notes` are for diagnostics, if anybody hears them.
    pub(super) async fn snapshot(&mut self, snapshot: &Snapshot, stamp: &Time, notes: Option<Notes>) {
        let Snapshot { state, sensors, motion } = snapshot;
        if let Some(motion) = motion {
            if self.odom.is_heard() {
                self.odom.put(&self.robot.odometry(stamp, motion, &state.pose)).await;
            }
            if self.tf.is_heard() {
                self.tf.put(&self.robot.transforms(stamp, motion, &state.pose)).await;
            }
            if self.imu.is_heard()
                && let Some(imu) = self.robot.imu(stamp, motion)
            {
                self.imu.put(&imu).await;
            }
        }
        // Not from a converter that has fallen silent.
        let sampled = sensors.as_ref().filter(|_| state.obstacle.front.or(state.obstacle.rear).is_some());
        if let Some(sensors) = sampled
            && self.ranges.iter().flatten().any(Publisher::is_heard)
        {
            let ranges = self.robot.ranges(stamp, &sensors.ir_front_cm, &sensors.ir_rear_cm);
            let told = self.ranges.iter().zip(&ranges).flat_map(|(side, ranges)| side.iter().zip(ranges));
            for (publisher, range) in told.filter(|(publisher, _)| publisher.is_heard()) {
                publisher.put(range).await;
            }
        }
        if state.seq.is_multiple_of(STATES_A_SECOND) && self.battery.is_heard() {
            self.battery.put(&battery(stamp, state)).await;
        }
        self.plan(state, stamp).await;
        self.diagnose(state, stamp, notes).await;
    }

    /// Latched: also while nobody hears it.
    async fn plan(&mut self, state: &RobotState, stamp: &Time) {
        let track = state.nav.route.as_ref().and_then(|route| route.track.as_ref());
        if track != self.track.as_ref() {
            self.track = track.cloned();
            self.plan.put(&plan(stamp, state)).await;
        }
    }

    async fn diagnose(&mut self, state: &RobotState, stamp: &Time, notes: Option<Notes>) {
        let Some(notes) = notes else {
            self.told = None;
            return;
        };
        let told = (
            state.mode,
            state.stopped_because.clone(),
            state.faults.iter().map(|it| it.fault).collect(),
            state.latches.iter().map(|it| it.latch).collect(),
            notes.events.clone(),
        );
        if state.seq.is_multiple_of(STATES_A_SECOND) || self.told.as_ref() != Some(&told) {
            self.told = Some(told);
            let notes: Vec<_> = notes.events.iter().chain(&notes.counters).cloned().collect();
            self.diagnostics.put(&diagnostics(stamp, state, &notes)).await;
        }
    }

    /// How all goals stand.
    pub(super) async fn status(&self, goals: &GoalStatusArray) {
        self.status.put(goals).await;
    }

    /// How the present goal goes.
    pub(super) async fn feedback(&mut self, goal_id: GoalId, state: &RobotState, stamp: &Time) {
        if self.goal.as_ref().is_none_or(|(id, _)| *id != goal_id) {
            self.goal = Some((goal_id, stamp.clone()));
        }
        let began = self.goal.as_ref().map_or(0, |(_, began)| began.ns());
        // A state from before the goal says nothing of the way to it.
        let present = state.goal.as_ref().filter(|goal| goal.id.as_bytes() == &goal_id);
        let Some(goal) = present.filter(|_| self.feedback.is_heard()) else { return };
        if !state.seq.is_multiple_of(STATES_A_FEEDBACK) {
            return;
        }
        let route = state.nav.route.as_ref();
        let along = route.and_then(|route| {
            let length_m: f64 = route.track.as_ref()?.arcs.iter().map(|arc| arc.length_m.abs()).sum();
            Some((length_m - route.done_m).max(0.0))
        });
        let Some(remaining_m) = along.or(goal.distance_m) else { return };
        let speed_mps = state.speed_mps.unwrap_or(0.0).abs();
        // At the speed of now; a robot that stands says nothing of it.
        let remaining_s = if speed_mps > 0.05 { remaining_m / speed_mps } else { 0.0 };
        let off_m = route.map_or(0.0, |route| route.off_m) as f32;
        let feedback = NavigateFeedback {
            goal_id,
            current_pose: pose_stamped(stamp, &state.pose),
            navigation_time: Duration::from_s((stamp.ns() - began) as f64 * 1e-9),
            estimated_time_remaining: Duration::from_s(remaining_s),
            number_of_recoveries: 0,
            distance_remaining: remaining_m as f32,
        };
        self.feedback.put_bytes(self.distro.feedback(feedback, off_m, f32::NAN)).await;
    }
}
