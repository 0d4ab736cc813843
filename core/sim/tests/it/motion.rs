//! Geometry and signs of the motion, and what the encoder and the gyro make of it.

use crate::agent::{board_frames, drive, exact_steering, pulses};
use std::f64::consts::{FRAC_PI_2, PI};
use xtb_control::controller::GyroSample;
use xtb_control::frames::{MapPose, wrap_rad};
use xtb_control::odometry::GYRO_DEG_PER_COUNT;
use xtb_protocol::board::{FrameWriter, FromBoard};
use xtb_protocol::gyro_3dmg::{EULER, GyroFrame, GyroReader};
use xtb_protocol::messages::TruthRobot;
use xtb_sim::{Simulation, Truck, TruckParameters, World};

fn alone(parameters: &TruckParameters, seed: u64) -> Simulation {
    let big = World::for_robots(100, &parameters.body);
    Simulation::new(big, parameters, &["xtb-1"], seed).unwrap()
}

fn truth(simulation: &Simulation) -> TruthRobot {
    simulation.trucks()[0].truth()
}

fn gyro_angles(truck: &mut Truck) -> GyroSample {
    let (mut bytes, mut angles) = (Vec::new(), None);
    truck.gyro_rx(&[EULER]);
    truck.take_gyro_tx(&mut bytes);
    GyroReader::default().push(&bytes, |frame| match frame {
        GyroFrame::Euler(frame) => angles = Some(frame.angles),
        GyroFrame::Firmware(_) => {}
    });
    angles.unwrap()
}

#[test]
fn a_centred_truck_drives_straight_ahead_north() {
    let mut simulation = alone(&exact_steering(), 1);
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(4000, 0), 10.0);
    let truth = truth(&simulation);
    assert_eq!((truth.x_m.abs() < 1e-9, truth.yaw_rad), (true, FRAC_PI_2));
    // 175 counts beyond the dead band of 1447: 0.36 m/s, a little less as the battery sags.
    assert!((3.2..3.6).contains(&truth.y_m), "{truth:?}");
    assert!((0.33..0.363).contains(&truth.speed_mps), "{truth:?}");
    assert_eq!((truth.motor_counts, truth.neutral_since_s, truth.contacts), (4000, None, 0));
}

#[test]
fn a_front_count_below_its_centre_turns_right_and_the_heading_grows() {
    let mut simulation = alone(&TruckParameters::default(), 1);
    let before = gyro_angles(&mut simulation.trucks_mut()[0]).yaw;
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(4000, -300), 1.0);
    let after = gyro_angles(&mut simulation.trucks_mut()[0]).yaw;
    let truth = truth(&simulation);
    assert!(truth.x_m > 0.0 && truth.yaw_rad < FRAC_PI_2, "to the east: {truth:?}");
    assert!(after.wrapping_sub(before) > 1000, "clockwise is positive: {before} to {after}");
}

#[test]
fn astern_the_same_steering_turns_the_heading_the_other_way() {
    let mut simulation = alone(&TruckParameters::default(), 1);
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(3500, -300), 1.0);
    let truth = truth(&simulation);
    assert!(truth.speed_mps < -0.1 && truth.yaw_rad > FRAC_PI_2, "{truth:?}");
}

#[test]
fn the_turning_radius_is_half_the_wheelbase_over_tan_delta() {
    for (offset, delta_deg) in [(-975, 20.0_f64), (-400, 400.0 * 20.0 / 975.0)] {
        let mut simulation = alone(&exact_steering(), 1);
        let (mut writer, pwm) = (FrameWriter::default(), pulses(4000, offset));
        drive(&mut simulation, &mut writer, &pwm, 2.0);
        let (mut way_m, mut turned_rad, mut last) = (0.0, 0.0, truth(&simulation));
        for _ in 0..1000 {
            drive(&mut simulation, &mut writer, &pwm, 0.005);
            let now = truth(&simulation);
            way_m += (now.x_m - last.x_m).hypot(now.y_m - last.y_m);
            turned_rad -= wrap_rad(now.yaw_rad - last.yaw_rad);
            last = now;
        }
        let expected_m = 0.286 / (2.0 * delta_deg.to_radians().tan());
        let radius_m = way_m / turned_rad;
        assert!((radius_m / expected_m - 1.0).abs() < 1e-3, "{radius_m} for {expected_m}");
    }
}

#[test]
fn an_unmirrored_rear_axle_moves_sideways_without_turning() {
    let mut simulation = alone(&exact_steering(), 1);
    let mut pwm = pulses(4000, -400);
    pwm.steer_rear = xtb_control::PwmCount::saturating(4179.0 - 400.0);
    drive(&mut simulation, &mut FrameWriter::default(), &pwm, 3.0);
    let truth = truth(&simulation);
    assert!((truth.yaw_rad - FRAC_PI_2).abs() < 1e-9 && truth.x_m > 0.05, "{truth:?}");
}

#[test]
fn the_encoder_counts_the_way_within_the_wheel_scale_error() {
    let mut scales = Vec::new();
    for seed in 0..20 {
        let mut simulation = alone(&TruckParameters::default(), seed);
        let (mut writer, mut pulses_seen) = (FrameWriter::default(), 0.0);
        for (motor, seconds) in [(4000, 10.0), (3750, 3.0)] {
            for _ in 0..(seconds * 2.0) as u32 {
                drive(&mut simulation, &mut writer, &pulses(motor, 0), 0.5);
                for frame in board_frames(&mut simulation.trucks_mut()[0]) {
                    if let FromBoard::Encoder { pulses } = frame {
                        pulses_seen += f64::from(pulses);
                    }
                }
            }
        }
        let nominal_m = pulses_seen / 60.0 / 34.0 * PI * 0.1651;
        scales.push(truth(&simulation).y_m / nominal_m);
    }
    assert!(scales.iter().all(|s| (s - 1.0).abs() < 0.0205), "{scales:?}");
    assert!(scales.iter().any(|s| *s > 1.005) && scales.iter().any(|s| *s < 0.995), "{scales:?}");
}

#[test]
fn an_opposite_pulse_stops_the_truck_before_it_reverses() {
    let mut simulation = alone(&TruckParameters::default(), 1);
    let mut writer = FrameWriter::default();
    drive(&mut simulation, &mut writer, &pulses(4600, 0), 2.0);
    let before = truth(&simulation).speed_mps;
    drive(&mut simulation, &mut writer, &pulses(2900, 0), 0.25);
    let braking = truth(&simulation).speed_mps;
    assert!(braking > 0.02 && braking < before / 4.0, "brakes from {before} to {braking}");
    drive(&mut simulation, &mut writer, &pulses(2900, 0), 2.0);
    assert!(truth(&simulation).speed_mps < -1.0);
}

#[test]
fn a_silent_agent_lets_the_truck_stop_by_itself() {
    let mut simulation = alone(&TruckParameters::default(), 1);
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(4000, -300), 2.0);
    let silent_from_s = simulation.now().s();
    for _ in 0..600 {
        simulation.step();
    }
    let truth = truth(&simulation);
    assert_eq!((truth.motor_counts, truth.speed_mps), (3750, 0.0));
    let after_s = truth.neutral_since_s.unwrap() - silent_from_s;
    assert!((0.09..0.13).contains(&after_s), "{after_s}");
}

#[test]
fn a_ramp_tilts_the_truck_and_slows_it_a_little() {
    let ramp = "[room]\nwidth_m = 14.0\ndepth_m = 14.0\n[[ramps]]\nx_m = 0.0\ny_m = 3.0\n\
                length_m = 6.0\nwidth_m = 4.0\nslope_deg = 6.0\nuphill_rad = 1.5707963267948966";
    let world = World::from_toml(ramp).unwrap();
    let start = MapPose { x_m: 0.0, y_m: 1.0, yaw_rad: FRAC_PI_2 };
    let parameters = TruckParameters::default();
    let mut sloping = Simulation::with_starts(world, &parameters, &[("a", start)], 1).unwrap();
    let mut level = Simulation::with_starts(World::default(), &parameters, &[("a", start)], 1).unwrap();
    for simulation in [&mut sloping, &mut level] {
        drive(simulation, &mut FrameWriter::default(), &pulses(4000, 0), 5.0);
    }
    let ratio = truth(&sloping).speed_mps / truth(&level).speed_mps;
    assert!((0.85..0.95).contains(&ratio), "{ratio}");
    let tilt_x_v = board_frames(&mut sloping.trucks_mut()[0]).iter().rev().find_map(|frame| match frame {
        FromBoard::Adc { sample, .. } => Some(sample.tilt[0].volts()),
        _ => None,
    });
    let nose_down_deg = (tilt_x_v.unwrap() - 2.525) / 0.034_813;
    assert!((nose_down_deg + 6.0).abs() < 0.1, "{nose_down_deg}");
    let pitch_deg = f64::from(gyro_angles(&mut sloping.trucks_mut()[0]).pitch) * GYRO_DEG_PER_COUNT;
    assert!((pitch_deg - 6.0).abs() < 0.3, "nose up is positive: {pitch_deg}");
}

#[test]
fn a_bank_that_rises_to_the_right_rolls_the_truck_to_the_left() {
    let bank = "[[ramps]]\nx_m = 0.0\ny_m = 0.0\nlength_m = 4.0\nwidth_m = 4.0\nslope_deg = 5.0\n\
                uphill_rad = 0.0";
    let world = World::from_toml(bank).unwrap();
    let mut simulation = Simulation::new(world, &TruckParameters::default(), &["a"], 1).unwrap();
    drive(&mut simulation, &mut FrameWriter::default(), &pulses(3750, 0), 0.1);
    let angles = gyro_angles(&mut simulation.trucks_mut()[0]);
    let (roll_deg, pitch_deg) =
        (f64::from(angles.roll) * GYRO_DEG_PER_COUNT, f64::from(angles.pitch) * GYRO_DEG_PER_COUNT);
    assert!((roll_deg + 5.0).abs() < 0.3 && pitch_deg.abs() < 0.3, "{roll_deg} {pitch_deg}");
    let tilt_y_v = board_frames(&mut simulation.trucks_mut()[0]).iter().rev().find_map(|frame| match frame {
        FromBoard::Adc { sample, .. } => Some(sample.tilt[1].volts()),
        _ => None,
    });
    let left_down_deg = (tilt_y_v.unwrap() - 2.503) / 0.033_934;
    assert!((left_down_deg - 5.0).abs() < 0.1, "{left_down_deg}");
}
