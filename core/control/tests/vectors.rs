//! The stages of this crate against the published vectors: an independent implementation's outputs,
//! line by line, with the published profile (every one of *ours* switched off).

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use serde_json::Value;
use std::path::Path;
use xtb_control::controller::{AdcSample, GyroSample};
use xtb_control::goto::Goal;
use xtb_control::vehicle::GotoLaw;
use xtb_control::{AdcCount, Command, Controller, Outputs, Sample, Stamp, Steering, VehicleConfig, WheelRpm};

fn published() -> VehicleConfig {
    let mut config = VehicleConfig::default();
    config.goto.law = GotoLaw::Published;
    config.speed.direction_interlock = false;
    config.speed.anti_windup = false;
    config.speed.reset_on_change = false;
    config.obstacle.foldback_latch = false;
    config.wander.rear_check = false;
    config.infrared.front_angle_deg = 15.0;
    config.infrared.rear_angle_deg = 10.0;
    config
}

fn counts<const N: usize>(value: &Value) -> [AdcCount; N] {
    std::array::from_fn(|i| AdcCount::try_from(value[i].as_f64().unwrap()).unwrap())
}

fn sample(line: &Value) -> Sample {
    if let Some(gyro) = line.get("gyro") {
        let angle = |name: &str| gyro[name].as_i64().unwrap() as i16;
        return Sample::Gyro(GyroSample { roll: angle("roll"), pitch: angle("pitch"), yaw: angle("yaw") });
    }
    if let Some(encoder) = line.get("encoder") {
        return Sample::Encoder { pulses: encoder["pulses"].as_u64().unwrap() as u32 };
    }
    if let Some(adc) = line.get("adc") {
        return Sample::Adc(AdcSample {
            ir_front: counts(&adc["ir_front"]),
            ir_rear: counts(&adc["ir_rear"]),
            tilt: counts(&adc["tilt"]),
            pistons: counts(&adc["pistons"]),
        });
    }
    let command = &line["command"];
    Sample::Command(if let Some(goal) = command.get("goto") {
        Command::Goto(Goal::new(goal["x_m"].as_f64().unwrap(), goal["y_m"].as_f64().unwrap()).unwrap())
    } else if let Some(setpoint) = command.get("teleop") {
        Command::Teleop {
            rpm: WheelRpm::try_from(setpoint["rpm"].as_f64().unwrap()).unwrap(),
            steering: Steering::try_from(setpoint["steering"].as_f64().unwrap()).unwrap(),
        }
    } else if command.get("wander").is_some() {
        Command::Wander
    } else {
        Command::Idle
    })
}

fn word(value: impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap()
}

/// The first field in which `got` differs from the expected line, if any.
fn difference(got: &Outputs, expected: &Value) -> Option<String> {
    let mut found = None;
    let mut same = |name: &str, ok: bool, got: String, expected: &Value| {
        if !ok && found.is_none() {
            found = Some(format!("{name}: got {got}, expected {expected}"));
        }
    };
    let pwm = &expected["pwm"];
    for (name, count) in
        [("motor", got.pwm.motor), ("steer_front", got.pwm.steer_front), ("steer_rear", got.pwm.steer_rear)]
    {
        let ok = (i64::from(count.get()) - pwm[name].as_i64().unwrap()).abs() <= 1;
        same(name, ok, count.get().to_string(), &pwm[name]);
    }
    same("mode", word(got.mode) == expected["mode"], format!("{:?}", got.mode), &expected["mode"]);
    let near = |a: f64, b: &Value| (a - b.as_f64().unwrap()).abs() <= 1e-5;
    let turn = |a: f64, b: &Value| {
        let d = (a - b.as_f64().unwrap()).rem_euclid(360.0);
        d.min(360.0 - d) <= 1e-5
    };
    let pose = &expected["pose"];
    for (name, value, wanted) in [
        ("reference_rpm", got.reference_rpm, &expected["reference_rpm"]),
        ("rpm", got.rpm, &expected["rpm"]),
        ("x_m", got.pose.x_m, &pose["x_m"]),
        ("y_m", got.pose.y_m, &pose["y_m"]),
    ] {
        same(name, near(value, wanted), value.to_string(), wanted);
    }
    let yaw = got.pose.yaw.deg();
    same("yaw_deg", turn(yaw, &pose["yaw_deg"]), yaw.to_string(), &pose["yaw_deg"]);
    for (side, ranges) in [("front", &got.ir_front_cm), ("rear", &got.ir_rear_cm)] {
        for (i, range) in ranges.iter().enumerate() {
            let wanted = &expected["ir_cm"][side][i];
            let ok = range.map_or(wanted.is_null(), |cm| !wanted.is_null() && near(cm, wanted));
            same(side, ok, format!("{range:?}"), wanted);
        }
    }
    let obstacle = &expected["obstacle"];
    same("front", word(got.obstacle.front) == obstacle["front"], format!("{:?}", got.obstacle), obstacle);
    same("rear", word(got.obstacle.rear) == obstacle["rear"], format!("{:?}", got.obstacle), obstacle);
    let wanted = &expected["goto"];
    match &got.goto {
        None => same("goto", wanted.is_null(), "null".into(), wanted),
        Some(_) if wanted.is_null() => same("goto", false, format!("{:?}", got.goto), wanted),
        Some(d) => {
            let exact = word(d.quadrant) == wanted["quadrant"]
                && word(d.maneuver) == wanted["maneuver"]
                && word(d.arrived) == wanted["arrived"];
            let angles = turn(d.alpha_deg, &wanted["alpha_deg"])
                && turn(d.beta_deg, &wanted["beta_deg"])
                && turn(d.gamma_deg, &wanted["gamma_deg"]);
            same("goto", exact && angles, format!("{d:?}"), wanted);
        }
    }
    found
}

fn check(name: &str) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/vectors");
    let read = |suffix: &str| std::fs::read_to_string(folder.join(format!("{name}.{suffix}.jsonl"))).unwrap();
    let (input, output) = (read("in"), read("out"));
    assert_eq!(input.lines().count(), output.lines().count());
    let mut controller = Controller::new(published());
    for (number, (line, expected)) in input.lines().zip(output.lines()).enumerate() {
        let line: Value = serde_json::from_str(line).unwrap();
        let t = Stamp::from_ns(line["t_ns"].as_u64().unwrap());
        let got = controller.step(t, &sample(&line));
        let expected = serde_json::from_str(expected).unwrap();
        if let Some(difference) = difference(&got, &expected) {
            panic!("{name} line {}: {difference}\n{line}", number + 1);
        }
    }
}

macro_rules! vectors {
    ($($name:ident),*) => {$(
        #[test]
        fn $name() {
            check(stringify!($name));
        }
    )*};
}
vectors!(goto, arrive, edges, wander, wander_cases, speed, speed_cases, infrared);
