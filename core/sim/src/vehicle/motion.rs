//! How a truck moves in a step: its servos, its wheels, and what it touches.

use super::Truck;
use crate::geometry::OrientedBox;
use crate::gyro::Attitude;
use crate::lattice::footprint;
use crate::scene::StepContext;
use crate::step::STEP_S;
use xtb_control::frames::{MapPose, heading_of, wrap_rad};
use xtb_control::vehicle::Drivetrain;

/// A touch is over when nothing is nearer than this: a truck that pushes against a wall comes to
/// rest a hair's breadth in front of it again and again.
const TOUCH_MARGIN_M: f64 = 0.01;

impl Truck {
    /// All servos but the motor's speed control.
    pub(super) fn move_servos(&mut self) {
        let outputs = self.board.outputs();
        self.platform.step(&outputs.pistons, STEP_S);
        self.bumpers[0].step(outputs.bumper_front);
        self.bumpers[1].step(outputs.bumper_rear);
        self.front.step(outputs.steer_front);
        self.rear.step(outputs.steer_rear);
    }

    pub(super) fn roll(&mut self, context: &StepContext<'_>) {
        let (x_m, y_m) = self.body.centre_m();
        let (cos, sin) = self.body.direction();
        self.rise = context.rise_at(x_m, y_m);
        let climb = cos * self.rise.0 + sin * self.rise.1;
        self.drive.step(self.board.outputs().motor, self.battery.supply(), climb);
        if let Some(mps) = self.hands.roll() {
            self.drive.roll_by_hand(mps);
        }
        if let Some(deg) = self.hands.turn() {
            self.turn_by_hand(deg);
        }
        let at_dock = self.drive.wheel_mps() == 0.0 && context.is_dock(|| self.reference_m());
        self.battery.step(&self.drive, at_dock, STEP_S);
        self.ran_into.clear();
        let mut blocked = false;
        if self.drive.wheel_mps() == 0.0 {
            self.speed_mps = 0.0;
        } else {
            blocked = !self.advance(context);
        }
        self.count_contact(context, blocked);
    }

    /// On the spot, about the reference point.
    fn turn_by_hand(&mut self, clockwise_deg: f64) {
        let (x_m, y_m) = self.reference_m();
        self.yaw_rad = wrap_rad(self.yaw_rad - clockwise_deg.to_radians());
        self.body = footprint(&MapPose { x_m, y_m, yaw_rad: self.yaw_rad }, &self.dimensions);
    }

    /// Moves on by one step unless something is in the way.
    fn advance(&mut self, context: &StepContext<'_>) -> bool {
        let wheel_mps = self.drive.wheel_mps();
        let (front_tan, front_cos) = (self.front.tan(), self.front.cos());
        let (rear_tan, rear_cos) = match self.dimensions.drivetrain {
            Drivetrain::BothAxles => (self.rear.tan(), self.rear.cos()),
            Drivetrain::FrontAxle => (0.0, 1.0),
        };
        // One motor drives both axles: its speed is the mean of theirs, each u / cos δ.
        let ahead_mps = wheel_mps * 2.0 * front_cos * rear_cos / (front_cos + rear_cos);
        let clockwise_radps = ahead_mps * (front_tan - rear_tan) / self.dimensions.wheelbase_m;
        // Of the reference point, which a front-steered car has on its rear axle.
        let midway_m = self.dimensions.drivetrain.midway_m(self.dimensions.wheelbase_m);
        let left_mps = -ahead_mps * (front_tan + rear_tan) / 2.0 + clockwise_radps * midway_m;

        let (cos_before, sin_before) = self.body.direction();
        let (yaw_rad, (sin_after, cos_after)) = if clockwise_radps == 0.0 {
            (self.yaw_rad, (sin_before, cos_before))
        } else {
            let yaw_rad = wrap_rad(self.yaw_rad - clockwise_radps * STEP_S);
            (yaw_rad, libm::sincos(yaw_rad))
        };
        // The mean of both directions makes the arc exact to second order.
        let (cos, sin) = ((cos_before + cos_after) / 2.0, (sin_before + sin_after) / 2.0);
        let (x_m, y_m) = self.reference_m();
        let middle_m = self.dimensions.middle_m();
        let next = OrientedBox::turned(
            x_m + (ahead_mps * cos - left_mps * sin) * STEP_S + cos_after * middle_m,
            y_m + (ahead_mps * sin + left_mps * cos) * STEP_S + sin_after * middle_m,
            (cos_after, sin_after),
            self.dimensions.length_m,
            self.dimensions.width_m,
        );
        if context.blocks(self.index, &self.body, &next, &mut self.ran_into) {
            self.drive.halt();
            self.speed_mps = 0.0;
            return false;
        }
        self.pulses += wheel_mps.abs() * STEP_S * self.pulses_per_m;
        (self.yaw_rad, self.body, self.speed_mps) = (yaw_rad, next, ahead_mps);
        true
    }

    fn count_contact(&mut self, context: &StepContext<'_>, blocked: bool) {
        let hit = blocked || context.was_touched(self.index);
        if hit && !self.touching {
            self.contacts += 1;
            self.touching = true;
        } else if !hit && self.touching {
            self.touching = !context.is_clear(self.index, &self.body, TOUCH_MARGIN_M);
        }
    }

    pub(super) fn attitude(&self) -> Attitude {
        let (cos, sin) = self.body.direction();
        let (east, north) = self.rise;
        let deg = |rise: f64| if rise == 0.0 { 0.0 } else { libm::asin(rise).to_degrees() };
        Attitude {
            heading_deg: heading_of(self.yaw_rad).deg(),
            pitch_deg: deg(cos * east + sin * north) + self.hands.nose_up_deg,
            // Right side down where the ground rises to the left.
            roll_deg: deg(cos * north - sin * east) + self.hands.left_up_deg,
        }
    }
}
