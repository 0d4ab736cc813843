//! Anything that may come in: every kind of sample, every valid configuration.

use proptest::collection::vec;
use proptest::prelude::*;
use serde_json::{Value, json};
use xtb_control::config::{Allowed, Parameter};
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::goto::GotoGoal;
use xtb_control::units::Stamp;
use xtb_control::vehicle::{
    BatteryLevels, Calibration, Encoder, Infrared, Obstacle, Pistons, Remote, VehicleConfig,
};
use xtb_control::{AdcCount, Command, Sample, Steering, WheelRpm};

pub(crate) fn adc(counts: f64) -> AdcCount {
    AdcCount::try_from(counts).unwrap()
}

/// Whole conversions, means of 64, and both ends.
pub(crate) fn adc_count() -> impl Strategy<Value = AdcCount> {
    let whole = (0_u16..=1023).prop_map(f64::from);
    let mean = (0_u32..=1023 * 64).prop_map(|sum| f64::from(sum) / 64.0);
    prop_oneof![4 => whole, 2 => mean, 1 => prop_oneof![Just(0.0), Just(1023.0)]].prop_map(adc)
}

pub(crate) fn adc_sample() -> impl Strategy<Value = AdcSample> {
    let side = || prop::array::uniform8(adc_count());
    (side(), side(), prop::array::uniform2(adc_count()), prop::array::uniform4(adc_count()))
        .prop_map(|(ir_front, ir_rear, tilt, pistons)| AdcSample { ir_front, ir_rear, tilt, pistons })
}

/// What NITC may read: pulses, gaps between pulses, the 420 %, nonsense, nothing.
pub(crate) fn ticks() -> impl Strategy<Value = Option<u32>> {
    prop_oneof![
        6 => (583_u32..=1318).prop_map(Some),
        2 => (583_u32..=1318).prop_map(|pulse| Some(13_875 - pulse)),
        1 => Just(Some(58_275)),
        1 => any::<u32>().prop_map(Some),
        2 => Just(None),
    ]
}

pub(crate) fn remote_sample() -> impl Strategy<Value = RemoteSample> {
    (ticks(), ticks(), ticks()).prop_map(|(speed, steering, selector)| RemoteSample {
        speed,
        steering,
        selector,
    })
}

pub(crate) fn goal() -> impl Strategy<Value = GotoGoal> {
    let metres = || prop_oneof![4 => -5.0..=5.0, 1 => -1.0e4..=1.0e4, 1 => Just(0.0)];
    (metres(), metres()).prop_map(|(x_m, y_m)| GotoGoal::new(x_m, y_m).unwrap())
}

pub(crate) fn teleop(rpm: f64, steering: f64) -> Command {
    let (rpm, steering) = (WheelRpm::try_from(rpm).unwrap(), Steering::try_from(steering).unwrap());
    Command::Teleop { rpm, steering }
}

pub(crate) fn follow(rpm: f64, steering: f64) -> Command {
    let (rpm, steering) = (WheelRpm::try_from(rpm).unwrap(), Steering::try_from(steering).unwrap());
    Command::Follow { rpm, steering }
}

pub(crate) fn command() -> impl Strategy<Value = Command> {
    let rpm = || prop_oneof![2 => -353.0..=353.0, 2 => -30.0..=30.0, 1 => Just(0.0)];
    prop_oneof![
        1 => Just(Command::Idle),
        2 => Just(Command::Wander),
        2 => goal().prop_map(Command::Goto),
        2 => (rpm(), -1.0..=1.0).prop_map(|(rpm, steering)| teleop(rpm, steering)),
        2 => (rpm(), -1.0..=1.0).prop_map(|(rpm, steering)| follow(rpm, steering)),
    ]
}

pub(crate) fn encoder() -> impl Strategy<Value = Sample> {
    let pulses = prop_oneof![2 => 0_u32..3, 4 => 0_u32..100, 1 => any::<u32>()];
    pulses.prop_map(|pulses| Sample::Encoder { pulses })
}

pub(crate) fn sample() -> impl Strategy<Value = Sample> {
    let gyro = any::<(i16, i16, i16)>();
    prop_oneof![
        4 => gyro.prop_map(|(roll, pitch, yaw)| Sample::Gyro(GyroSample { roll, pitch, yaw })),
        4 => encoder(),
        3 => adc_sample().prop_map(Sample::Adc),
        3 => remote_sample().prop_map(Sample::Remote),
        2 => command().prop_map(Sample::Command),
        1 => any::<f64>().prop_map(|threshold_cm| Sample::Obstacle { threshold_cm }),
    ]
}

/// Samples with their stamps; mostly forwards, sometimes far, now and then back.
pub(crate) fn samples(most: usize) -> impl Strategy<Value = Vec<(Stamp, Sample)>> {
    let pause_ms = prop_oneof![6 => 0_i64..60, 2 => 0_i64..10_000, 1 => -1000_i64..0];
    vec((sample(), pause_ms), 1..most).prop_map(|samples| {
        let mut now_ms = 0_i64;
        let stamped = samples.into_iter().map(|(sample, pause_ms)| {
            now_ms = (now_ms + pause_ms).max(0);
            (Stamp::from_ms(now_ms as u64), sample)
        });
        stamped.collect()
    })
}

/// Every parameter of the vehicle's table anywhere in its range, or as by default; then what only
/// holds between two of them is put right.
pub(crate) fn config() -> impl Strategy<Value = VehicleConfig> {
    let part = prop_oneof![4 => Just(None), 4 => (0.0..=1.0).prop_map(Some), 1 => Just(Some(0.0)), 1 => Just(Some(1.0))];
    vec(part, VehicleConfig::default().parameters().len()).prop_map(|parts| {
        let config = repaired(drawn(&parts));
        config.validate().unwrap();
        config
    })
}

/// Everything that is ours switched off.
pub(crate) fn published() -> VehicleConfig {
    let text = include_str!("../../../../configs/published.toml");
    let file: toml::Table = toml::from_str(text).unwrap();
    file["vehicle"].clone().try_into().unwrap()
}

fn drawn(parts: &[Option<f64>]) -> VehicleConfig {
    let default = VehicleConfig::default();
    let mut tree = serde_json::to_value(&default).unwrap();
    for (parameter, part) in default.parameters().iter().zip(parts) {
        if let Some(part) = part {
            let place = format!("/{}", parameter.name.replace('.', "/"));
            let value = tree.pointer_mut(&place).unwrap();
            *value = within(parameter, value, *part);
        }
    }
    serde_json::from_value(tree).unwrap()
}

/// The value at this part of the parameter's range.
fn within(parameter: &Parameter, present: &Value, part: f64) -> Value {
    match parameter.allowed {
        Allowed::Range(min, max) if present.is_u64() => json!((min + (max - min) * part).round() as u64),
        Allowed::Range(min, max) => json!((min + (max - min) * part).clamp(min, max)),
        Allowed::Switch => json!(part < 0.5),
        Allowed::OneOf(words) => json!(words[((words.len() - 1) as f64 * part).round() as usize]),
        Allowed::Text | Allowed::List(_) => present.clone(),
    }
}

fn repaired(mut config: VehicleConfig) -> VehicleConfig {
    let body = &mut config.geometry;
    (body.wheelbase_m, body.track_m) =
        (body.wheelbase_m.min(body.body_length_m), body.track_m.min(body.body_width_m));
    // The default range finders stand within the body.
    body.body_width_m = body.body_width_m.max(0.36);
    let most_m = (body.body_length_m - body.wheelbase_m) / 2.0;
    body.body_ahead_m = body.body_ahead_m.clamp(-most_m, most_m);
    if config.infrared.far_v >= config.infrared.near_v {
        config.infrared = Infrared::default();
    }
    if config.remote.min_duty_pct >= config.remote.max_duty_pct {
        let Remote { min_duty_pct, max_duty_pct, .. } = Remote::default();
        (config.remote.min_duty_pct, config.remote.max_duty_pct) = (min_duty_pct, max_duty_pct);
    }
    let BatteryLevels { stop_v, finish_v, warn_v, .. } = config.battery;
    if stop_v >= finish_v || finish_v >= warn_v {
        config.battery = BatteryLevels::default();
    }
    let per_turn = config.guard.top_rpm / 60.0 * config.encoder.gear_ratio * config.encoder.window_s;
    config.encoder.pulses_per_rev = config.encoder.pulses_per_rev.min(659.9 / per_turn);
    if config.encoder.pulses_per_rev < 1.0 {
        config.encoder = Encoder::default();
        config.guard.top_rpm = 370.0;
    }
    config.pistons = ordered(config.pistons);
    config.calibration = matching(&config);
    if config.admitted_mps() < config.mps_per_rpm() {
        (config.obstacle, config.infrared) = (Obstacle::default(), Infrared::default());
        (config.bumpers.front_deg, config.bumpers.rear_deg) = (0.0, 0.0);
        config.calibration = matching(&config);
        config.geometry.wheel_diameter_m = config.geometry.wheel_diameter_m.min(0.5);
    }
    let most_rpm = config.admitted_mps() / config.mps_per_rpm();
    for rpm in [&mut config.goto.reference_rpm, &mut config.wander.reference_rpm, &mut config.teleop.max_rpm]
    {
        *rpm = rpm.min(most_rpm);
    }
    config
}

fn ordered(pistons: Pistons) -> Pistons {
    let mut places = [pistons.min_m, pistons.middle_m, pistons.max_m, pistons.travel_m];
    places.sort_by(f64::total_cmp);
    if places.windows(2).any(|pair| pair[0] == pair[1]) {
        return Pistons { max_offset_counts: pistons.max_offset_counts, ..Pistons::default() };
    }
    let [min_m, middle_m, max_m, travel_m] = places;
    Pistons { min_m, middle_m, max_m, travel_m, ..pistons }
}

/// Lines with the drawn slopes through counts that the servos take.
fn matching(config: &VehicleConfig) -> Calibration {
    let drawn = &config.calibration;
    let slope = |slope: f64, most: f64| {
        if slope.abs() < 1.0e-5 { 1.0e-5 } else { slope.clamp(-most, most) }
    };
    // The drawn intercept only says where between the servo's limits the count lies.
    let count = |intercept: f64, most: f64| 2332.0 + (5271.0 - 2332.0) * (intercept / most + 1.0) / 2.0;
    let (front, rear) = (slope(drawn.steering_front_slope, 0.9), slope(drawn.steering_rear_slope, 0.9));
    let bumpers = [
        (drawn.bumper_front_slope, drawn.bumper_front_intercept, config.bumpers.front_deg),
        (drawn.bumper_rear_slope, drawn.bumper_rear_intercept, config.bumpers.rear_deg),
    ]
    .map(|(drawn, intercept, deg)| (slope(drawn, 0.9), deg - slope(drawn, 0.9) * count(intercept, 5000.0)));
    let pistons = [
        (drawn.piston_fl_slope, drawn.piston_fl_intercept),
        (drawn.piston_fr_slope, drawn.piston_fr_intercept),
        (drawn.piston_rl_slope, drawn.piston_rl_intercept),
        (drawn.piston_rr_slope, drawn.piston_rr_intercept),
    ]
    .map(|(drawn, intercept)| (slope(drawn, 0.009), -slope(drawn, 0.009) * count(intercept, 50.0)));
    Calibration {
        steering_front_slope: front,
        steering_front_intercept: -front * config.steering.front_centre,
        steering_rear_slope: rear,
        steering_rear_intercept: -rear * config.steering.rear_centre,
        bumper_front_slope: bumpers[0].0,
        bumper_front_intercept: bumpers[0].1,
        bumper_rear_slope: bumpers[1].0,
        bumper_rear_intercept: bumpers[1].1,
        piston_fl_slope: pistons[0].0,
        piston_fl_intercept: pistons[0].1,
        piston_fr_slope: pistons[1].0,
        piston_fr_intercept: pistons[1].1,
        piston_rl_slope: pistons[2].0,
        piston_rl_intercept: pistons[2].1,
        piston_rr_slope: pistons[3].0,
        piston_rr_intercept: pistons[3].1,
    }
}
