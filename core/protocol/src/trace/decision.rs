//! The trace's other half: everything that one step decided, as a line.

use serde::Serialize;
use xtb_control::goto::Maneuver;
use xtb_control::infrared::BumperRanges;
use xtb_control::{Mode, Outputs, PwmCount};

/// Everything that one step decided, as the trace prints it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Decision {
    t_ns: u64,
    mode: Mode,
    pwm: Pulses,
    reference_rpm: f64,
    rpm: f64,
    pose: Pose,
    ir_cm: Ranges,
    obstacle: Obstacle,
    tilt_deg: Tilt,
    goto: Option<Goto>,
    remote: Remote,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Pulses {
    motor: PwmCount,
    steer_front: PwmCount,
    steer_rear: PwmCount,
    bumper_front: PwmCount,
    bumper_rear: PwmCount,
    piston_fl: PwmCount,
    piston_fr: PwmCount,
    piston_rl: PwmCount,
    piston_rr: PwmCount,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Pose {
    x_m: f64,
    y_m: f64,
    yaw_deg: f64,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Ranges {
    #[cfg_attr(feature = "schema", schemars(length(min = 6, max = 8)))]
    front: Vec<Option<f64>>,
    #[cfg_attr(feature = "schema", schemars(length(min = 6, max = 8)))]
    rear: Vec<Option<f64>>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Obstacle {
    front: bool,
    rear: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Tilt {
    x: Option<f64>,
    y: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Goto {
    quadrant: u8,
    alpha_deg: f64,
    beta_deg: f64,
    gamma_deg: f64,
    maneuver: Maneuver,
    arrived: bool,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Remote {
    speed_duty: Option<f64>,
    steering_duty: Option<f64>,
    selector_duty: Option<f64>,
    reset: Vec<&'static str>,
}

/// Rounds to 7 decimals, as the trace prints numbers.
fn seven(value: f64) -> f64 {
    // + 0.0 turns −0 into 0.
    (value * 1e7).round() / 1e7 + 0.0
}

/// Prints every number in full, as a recording keeps it.
fn full(value: f64) -> f64 {
    value
}

impl Decision {
    fn new(outputs: &Outputs, number: fn(f64) -> f64) -> Self {
        let Outputs { pwm, pose, goto, tilt, duties, obstacle, .. } = outputs;
        let [piston_fl, piston_fr, piston_rl, piston_rr] = pwm.pistons;
        let numbers = |ranges: &BumperRanges| ranges.map(|cm| cm.map(number));
        let [front, rear] = super::bumpers(&numbers(&outputs.ir_front_cm), &numbers(&outputs.ir_rear_cm));
        Self {
            t_ns: outputs.t.ns(),
            mode: outputs.mode,
            pwm: Pulses {
                motor: pwm.motor,
                steer_front: pwm.steer_front,
                steer_rear: pwm.steer_rear,
                bumper_front: pwm.bumper_front,
                bumper_rear: pwm.bumper_rear,
                piston_fl,
                piston_fr,
                piston_rl,
                piston_rr,
            },
            reference_rpm: number(outputs.reference_rpm),
            rpm: number(outputs.rpm),
            pose: Pose { x_m: number(pose.x_m), y_m: number(pose.y_m), yaw_deg: number(pose.yaw.deg()) },
            ir_cm: Ranges { front, rear },
            obstacle: Obstacle { front: obstacle.front, rear: obstacle.rear },
            tilt_deg: Tilt { x: tilt.x.map(number), y: tilt.y.map(number) },
            goto: goto.as_ref().map(|decision| Goto {
                quadrant: decision.quadrant,
                alpha_deg: number(decision.alpha_deg),
                beta_deg: number(decision.beta_deg),
                gamma_deg: number(decision.gamma_deg),
                maneuver: decision.maneuver,
                arrived: decision.arrived,
            }),
            remote: Remote {
                speed_duty: duties.speed.map(number),
                steering_duty: duties.steering.map(number),
                selector_duty: duties.selector.map(number),
                reset: outputs.reset.names().collect(),
            },
        }
    }
}

/// What a step decided as a line, without the newline; numbers rounded to 7 decimals.
#[must_use]
pub fn decision_line(outputs: &Outputs) -> String {
    serde_json::to_string(&Decision::new(outputs, seven)).unwrap_or_default()
}

/// The same with every number in full: two steps decided the same if and only if these are the same
/// bytes.
#[must_use]
pub fn exact_decision_line(outputs: &Outputs) -> String {
    serde_json::to_string(&Decision::new(outputs, full)).unwrap_or_default()
}

/// JSON Schema of the lines of decisions.
#[cfg(feature = "schema")]
#[must_use]
pub fn decision_schema(generator: schemars::SchemaGenerator) -> schemars::Schema {
    generator.into_root_schema_for::<Decision>()
}
