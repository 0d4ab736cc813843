//! A controller step allocates nothing: every kind of sample, in every mode, with every controller.

use allocation_counter::measure;
use std::collections::BTreeSet;
use std::hint::black_box;
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::goto::GotoGoal;
use xtb_control::vehicle::{GotoLaw, Platform, SLOTS};
use xtb_control::{AdcCount, Command, Controller, Mode, Sample, Stamp, Steering, VehicleConfig, WheelRpm};

type Failure = Box<dyn std::error::Error>;

fn scan(front: f64, rear: f64, tilt: f64) -> Result<Sample, Failure> {
    let (front, rear, tilt) =
        (AdcCount::try_from(front)?, AdcCount::try_from(rear)?, AdcCount::try_from(tilt)?);
    let pistons =
        [0.0, 300.0, 512.0, 1023.0].map(|count| AdcCount::try_from(count).unwrap_or(AdcCount::ZERO));
    Ok(Sample::Adc(AdcSample { ir_front: [front; SLOTS], ir_rear: [rear; SLOTS], tilt: [tilt; 2], pistons }))
}

fn remote(speed: Option<u32>, selector: Option<u32>) -> Sample {
    Sample::Remote(RemoteSample { speed, steering: Some(1000), selector })
}

fn commands() -> Result<Vec<Sample>, Failure> {
    let teleop = |rpm: f64| -> Result<Command, Failure> {
        Ok(Command::Teleop { rpm: WheelRpm::try_from(rpm)?, steering: Steering::try_from(0.5)? })
    };
    let follow = |rpm: f64| -> Result<Command, Failure> {
        Ok(Command::Follow { rpm: WheelRpm::try_from(rpm)?, steering: Steering::try_from(-0.5)? })
    };
    let commands = [
        Command::Idle,
        teleop(20.0)?,
        teleop(-20.0)?,
        teleop(0.0)?,
        follow(-40.0)?,
        follow(40.0)?,
        Command::Goto(GotoGoal::new(1.0, -2.0)?),
        Command::Wander,
        Command::Wander,
    ];
    Ok(commands.map(Sample::Command).to_vec())
}

/// Sensor samples that take every branch: near and far, level and tilted or no angle, readings good,
/// complementary, impossible and missing.
fn sensors() -> Result<Vec<Sample>, Failure> {
    let mut samples = Vec::new();
    for yaw in [0, 9000, -30_000] {
        samples.push(Sample::Gyro(GyroSample { roll: 5, pitch: -5, yaw }));
    }
    for pulses in [0, 1, 23, u32::MAX] {
        samples.push(Sample::Encoder { pulses });
    }
    for (front, rear, tilt) in
        [(0.0, 0.0, 517.0), (300.0, 0.0, 600.0), (0.0, 300.0, 0.0), (900.0, 90.0, 1023.0)]
    {
        samples.push(scan(front, rear, tilt)?);
    }
    Ok(samples)
}

/// Frames of the transmitter that keep it on the selector's side, ten without one at the end.
fn frames(selector: Option<u32>) -> Vec<Sample> {
    [Some(900), Some(12_900), Some(58_275), None].map(|speed| remote(speed, selector)).to_vec()
}

/// Everything in one row, so that each mode meets each kind of sample.
fn script() -> Result<Vec<Sample>, Failure> {
    let mut script = Vec::new();
    for command in commands()? {
        script.push(command);
        script.extend(sensors()?);
        script.extend(frames(Some(1125)));
    }
    for selector in [Some(750), None] {
        script.extend((0..10).map(|_| remote(Some(900), selector)));
        script.extend(sensors()?);
        script.extend(frames(selector));
        script.extend(commands()?);
    }
    Ok(script)
}

fn configurations() -> Vec<VehicleConfig> {
    let mut all = Vec::new();
    for platform in [Platform::Balance, Platform::Pid, Platform::Off] {
        for law in [GotoLaw::Hysteresis, GotoLaw::Published] {
            for ours in [true, false] {
                let mut config = VehicleConfig { platform, ..VehicleConfig::default() };
                config.goto.law = law;
                config.speed.direction_interlock = ours;
                config.obstacle.foldback_latch = ours;
                config.odometry.keep_pose = ours;
                all.push(config);
            }
        }
    }
    all
}

#[test]
fn no_sample_makes_the_controller_allocate_in_any_mode() -> Result<(), Failure> {
    let script = script()?;
    for config in configurations() {
        let mut controller = Controller::new(config.clone());
        let mut met = BTreeSet::new();
        for (i, sample) in script.iter().enumerate() {
            // Long enough between two for wander's and the latch's timers to run out now and then.
            let t = Stamp::from_ms(700 * i as u64);
            let mode_before = controller.outputs(t).mode;
            let counted = measure(|| {
                black_box(controller.step(t, black_box(sample)));
            });
            assert_eq!(counted.count_total, 0, "{sample:?} in {mode_before:?}");
            met.insert((format!("{mode_before:?}"), kind(sample)));
        }
        for mode in [Mode::Idle, Mode::Manual, Mode::Teleop, Mode::Goto, Mode::Wander, Mode::Fault] {
            for kind in ["gyro", "encoder", "adc", "remote", "command"] {
                assert!(met.contains(&(format!("{mode:?}"), kind)), "{mode:?} never met {kind}");
            }
        }
    }
    Ok(())
}

fn kind(sample: &Sample) -> &'static str {
    match sample {
        Sample::Gyro(_) => "gyro",
        Sample::Encoder { .. } => "encoder",
        Sample::Adc(_) => "adc",
        Sample::Remote(_) => "remote",
        Sample::Command(_) => "command",
        Sample::Obstacle { .. } => "obstacle",
    }
}

#[test]
fn the_counter_does_count() {
    let counted = measure(|| drop(black_box(Box::new(7_u64))));
    assert_eq!(counted.count_total, 1);
    // Copying the constants does allocate: that they are only borrowed in a step is seen.
    let controller = Controller::new(VehicleConfig::default());
    let counted = measure(|| drop(black_box(controller.clone())));
    assert!(counted.count_total > 0, "the channels' names are strings");
}
