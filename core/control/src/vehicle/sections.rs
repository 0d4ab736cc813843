//! The tables: every constant of the vehicle with unit, range, default and origin.

use super::{BumperFinders, GotoLaw};
use crate::config::Allowed::{OneOf, Range, Switch, Text};
use crate::config::DefaultOrigin::{Assumed, DataSheet, Ours, Printed};
use crate::config_section;
use crate::units::WheelRpm;

config_section! {
    /// The body, seen from above.
    Geometry "geometry" {
        wheelbase_m: f64 = 0.286, "m", Range(0.05, 2.0), Assumed, "Distance between the axles.";
        track_m: f64 = 0.262, "m", Range(0.05, 2.0), Assumed, "Distance between the wheels of an axle.";
        body_length_m: f64 = 0.50, "m", Range(0.1, 3.0), Assumed, "Bumper to bumper.";
        body_width_m: f64 = 0.40, "m", Range(0.1, 3.0), Assumed, "Tyre to tyre.";
        body_ahead_m: f64 = 0.0, "m", Range(-1.0, 1.0), Assumed, "From midway between the axles ahead to the middle of the body.";
        wheel_diameter_m: f64 = 0.1651, "m", Range(0.02, 1.0), Printed("§2.1 (6.5 in)"), "Tyre diameter.";
    }
}

config_section! {
    /// The encoder on the motor shaft (§4.2.3).
    Encoder "encoder" {
        window_s: f64 = 0.052_428_8, "s", Range(0.001, 1.0), Printed("§4.2.3 (0x8000 · 64 / 40 MHz)"), "Length of the counting window.";
        pulses_per_rev: f64 = 60.0, "pulses", Range(1.0, 10_000.0), Printed("§2.2"), "Pulses per revolution of the motor shaft.";
        gear_ratio: f64 = 34.0, "motor turns per wheel turn", Range(1.0, 1000.0), Printed("§2.1"), "Gear box.";
    }
}

config_section! {
    /// The speed controller (§4.7).
    Speed "speed" {
        kp: f64 = 10.0, "counts/rpm", Range(0.0, 1000.0), Printed("§4.7"), "Proportional gain.";
        ki: f64 = 20.0, "counts/(rpm·s)", Range(0.0, 1000.0), Printed("§4.7"), "Integral gain.";
        kd: f64 = 0.1, "counts·s/rpm", Range(0.0, 100.0), Printed("§4.7"), "Differential gain.";
        anti_windup: bool = true, "", Switch, Ours, "Hold the sum while the output is saturated in the error's direction.";
        reset_on_change: bool = true, "", Switch, Ours, "Reset the controller when the mode or the sign of the reference changes.";
        direction_interlock: bool = true, "", Switch, Ours, "Hold a reversed reference at zero until the wheels have stopped.";
        interlock_pulses: u32 = 1, "pulses", Range(0.0, 100.0), Ours, "A window with at most this many pulses counts as standstill.";
    }
}

config_section! {
    /// The steering servos (§4.10, Table 4).
    SteeringServos "steering" {
        front_centre: f64 = 3710.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Front servo, straight ahead.";
        rear_centre: f64 = 4179.0, "counts", Range(2331.0, 5272.0), Printed("Table 4"), "Rear servo, straight ahead.";
        range_counts: f64 = 975.0, "counts", Range(1.0, 1400.0), Printed("§4.10 (5° · 195)"), "Full lock either side of the centre.";
        stop_deg: f64 = 20.0, "deg", Range(1.0, 45.0), Assumed, "Wheel angle at full lock.";
    }
}

config_section! {
    /// What the voltage of a GP2D12 means (§4.5); other range finders have their own curves.
    Infrared "infrared" {
        far_v: f64 = 0.42, "V", Range(0.1, 1.0), Ours, "Below this voltage nothing is in range (the fit ends there).";
        near_v: f64 = 2.35, "V", Range(1.0, 2.35), Ours, "Above this voltage an object is too close (the fit turns back there).";
        near_cm: f64 = 9.74, "cm", Range(1.0, 25.0), Ours, "What a voltage above near_v counts as.";
    }
}

config_section! {
    /// The infrared range finders that are fitted (§2.2, §4.5).
    RangeFinders "range_finders" {
        front: BumperFinders = BumperFinders::default(), "", BumperFinders::ALLOWED, Printed("§2.2"), "Those of the front bumper, on its converter channels.";
        rear: BumperFinders = BumperFinders::default(), "", BumperFinders::ALLOWED, Printed("§2.2"), "Those of the rear bumper.";
    }
}

config_section! {
    /// The scanning bumpers (§4.5, Annex A.1); their servos' calibration stands in `calibration`.
    Bumpers "bumpers" {
        front_deg: f64 = 0.0, "deg", Range(-60.0, 60.0), Assumed, "Angle of the front bumper above the horizontal.";
        rear_deg: f64 = 0.0, "deg", Range(-60.0, 60.0), Assumed, "Angle of the rear bumper above the horizontal.";
    }
}

config_section! {
    /// The obstacle rule (§4.6).
    Obstacle "obstacle" {
        threshold_cm: f64 = 25.0, "cm", Range(10.0, 80.0), Printed("§4.6"), "Anything nearer than this is an obstacle.";
        foldback_latch: bool = true, "", Switch, Ours, "Keep a sensor at near when it jumps from near to far: below 10 cm its reading is wrong.";
        foldback_cm: f64 = 14.0, "cm", Range(10.0, 25.0), Ours, "A sensor that was nearer than this may fold back.";
        foldback_clear_s: f64 = 0.0, "s", Range(0.0, 10.0), Ours, "Clear readings for this long release the latch; 0 = never: a touched wall reads clear.";
        foldback_retreat_m: f64 = 0.05, "m", Range(0.0, 1.0), Ours, "Backing off by this much releases the latch.";
        reaction_s: f64 = 0.358, "s", Range(0.1, 5.0), Assumed, "Sensor, scan, pulse and motor lag from sighting to standstill.";
    }
}

config_section! {
    /// A-to-B (§4.10).
    Goto "goto" {
        law: GotoLaw = GotoLaw::Hysteresis, "", OneOf(&["hysteresis", "published"]), Ours, "Table 4 as printed, or with our hysteresis.";
        reference_rpm: f64 = 13.0, "rpm", Range(1.0, WheelRpm::MAX), Printed("§4.10"), "Wheel speed V.";
        kp: f64 = 195.0, "counts/deg", Range(1.0, 5000.0), Printed("§4.10"), "Steering gain.";
        tolerance_m: f64 = 0.20, "m", Range(0.01, 5.0), Printed("§4.10"), "Arrived when both errors are at most this.";
        hysteresis_deg: f64 = 5.0, "deg", Range(0.0, 22.0), Ours, "A slice is kept until the bearing is this far outside it.";
    }
}

config_section! {
    /// Wander (§4.6, Fig. 13).
    Wander "wander" {
        reference_rpm: f64 = 13.0, "rpm", Range(1.0, WheelRpm::MAX), Printed("§4.10 (V)"), "Wheel speed ahead and in reverse.";
        reverse_s: f64 = 6.0, "s", Range(0.1, 60.0), Printed("§4.6"), "Duration of reversing while turning.";
        pause_s: f64 = 2.0, "s", Range(0.0, 60.0), Printed("§5.2"), "Duration of the pause after that.";
        rear_check: bool = true, "", Switch, Ours, "Stop reversing at an obstacle behind.";
        sides: String = "alternate".to_owned(), "", OneOf(&["alternate", "right", "left"]), Ours, "Turn direction while reversing.";
    }
}

config_section! {
    /// Teleoperation over the network.
    Teleop "teleop" {
        max_rpm: f64 = 23.0, "rpm", Range(1.0, WheelRpm::MAX), Ours, "Setpoints are limited to this: 0.2 m/s, so that two trucks head-on can both stop.";
        lifetime_ms: u32 = 200, "ms", Range(20.0, 200.0), Ours, "Lifetime of a setpoint, by the robot's clock.";
    }
}

config_section! {
    /// The remote control (§4.2.2, §4.3, Fig. 10).
    Remote "remote" {
        enabled: bool = true, "", Switch, Ours, "Obey the remote control if the board has a receiver.";
        tick_us: f64 = 1.6, "µs", Range(0.1, 100.0), Printed("§4.2.2 (64 / 40 MHz)"), "Length of a time count.";
        period_ms: f64 = 22.2, "ms", Range(1.0, 100.0), Printed("§4.2.2"), "The receiver's pulse period.";
        min_duty_pct: f64 = 4.2, "%", Range(0.1, 49.0), Printed("§4.1"), "A shorter pulse is rejected.";
        max_duty_pct: f64 = 9.5, "%", Range(0.1, 49.0), Printed("§4.1"), "A longer pulse is rejected.";
        selector_counts: f64 = 3750.0, "counts", Range(2331.0, 5272.0), Assumed, "Selector threshold (1.5 ms).";
        manual: String = "below".to_owned(), "", OneOf(&["below", "above"]), Assumed, "Side of the threshold that means manual.";
        lost_after: u32 = 10, "frames", Range(1.0, 1000.0), Ours, "A channel without a usable reading for this long is lost.";
    }
}

config_section! {
    /// What counts as broken: sensors that stand still or read what cannot be, wheels that run away or
    /// do not turn. The monitors of `core/robot` read it.
    GuardLimits "guard" {
        frozen_s: f64 = 0.25, "s", Range(0.1, 5.0), Ours, "Gyro or converter without any change for this long counts as frozen: noise makes that impossible.";
        frozen_scans: u32 = 50, "scans", Range(10.0, 1000.0), Ours, "A range finder without any change for this many scans with turning wheels counts as frozen.";
        infrared_min_v: f64 = 0.1, "V", Range(0.0, 0.2), DataSheet("GP2D12"), "A range finder below this has a broken wire (0.25 V with nothing in sight).";
        infrared_max_v: f64 = 3.0, "V", Range(2.8, 5.0), DataSheet("GP2D12"), "A range finder above this has a short circuit (2.8 V at most).";
        infrared_scans: u32 = 5, "scans", Range(1.0, 100.0), Ours, "This many such readings in a row are a fault; a single one is a disturbance.";
        top_rpm: f64 = 370.0, "rpm", Range(10.0, 1000.0), Printed("§2.2 (12,000 rpm / 34, 5 % over)"), "Maximum possible wheel speed.";
        runaway_part: f64 = 0.3, "", Range(0.05, 2.0), Ours, "Allowed excess of the wheel speed over the reference, as a fraction of it.";
        runaway_s: f64 = 0.3, "s", Range(0.1, 2.0), Ours, "Longer than this above the speed explained by reference or coasting is a runaway.";
        coast_s: f64 = 0.5, "s", Range(0.05, 5.0), Assumed, "Time constant of the slowest coasting to standstill, twice the expected value.";
        stall_counts: f64 = 100.0, "counts", Range(10.0, 1000.0), Assumed, "A motor pulse this far from neutral turns the wheels (the dead band ends at 75). An ESC with a larger dead band needs more, or `stalled` is raised without an obstacle.";
        stall_s: f64 = 0.4, "s", Range(0.1, 0.85), Ours, "Driving for this long without a single encoder pulse is a stall.";
        manual_limit: bool = true, "", Switch, Ours, "Pass on the speed stick only while the truck is slow enough for the obstacle rule to stop it.";
    }
}

config_section! {
    /// What the battery's voltage means: 7.2 V, six cells of NiMH or NiCd. Their voltage lies between
    /// 1.3 and 1.2 V a cell for the most part of a discharge and falls steeply below 1.1 V.
    BatteryLevels "battery" {
        warn_v: f64 = 7.2, "V", Range(1.0, 60.0), Assumed, "Below this, charge the battery soon: 1.20 V per cell.";
        finish_v: f64 = 6.9, "V", Range(1.0, 60.0), Assumed, "Below this nothing new is started: 1.15 V per cell.";
        stop_v: f64 = 6.6, "V", Range(1.0, 60.0), Assumed, "Below this the truck stops: 1.10 V per cell.";
        hysteresis_v: f64 = 0.2, "V", Range(0.0, 2.0), Ours, "A level ends only this far above its voltage: a pack at rest recovers.";
        hold_s: f64 = 2.0, "s", Range(0.1, 60.0), Ours, "A level begins or ends only after this time: the voltage sags when the motor starts.";
    }
}

config_section! {
    /// The dual-axis tilt sensor (§4.8.1).
    Tilt "tilt" {
        x_zero_v: f64 = 2.525, "V", Range(0.0, 5.0), Printed("§4.8.1"), "Reading of x (pitch) when level.";
        y_zero_v: f64 = 2.503, "V", Range(0.0, 5.0), Printed("§4.8.1"), "Reading of y (roll) when level.";
        x_v_per_deg: f64 = 0.034_813, "V/deg", Range(0.001, 1.0), Printed("§4.8.1"), "Sensitivity of x.";
        y_v_per_deg: f64 = 0.033_934, "V/deg", Range(0.001, 1.0), Printed("§4.8.1"), "Sensitivity of y.";
    }
}

config_section! {
    /// The four suspension pistons (§4.8).
    Pistons "pistons" {
        travel_m: f64 = 0.040, "m", Range(0.001, 1.0), Assumed, "Travel of a piston over the full range of its sensor.";
        middle_m: f64 = 0.020, "m", Range(0.0, 1.0), Assumed, "Middle position.";
        min_m: f64 = 0.002, "m", Range(0.0, 1.0), Assumed, "Lower end stop.";
        max_m: f64 = 0.038, "m", Range(0.0, 1.0), Assumed, "Upper end stop.";
        max_offset_counts: f64 = 400.0, "counts", Range(1.0, 1400.0), Assumed, "Fastest pulse either side of zero movement (§4.8.3 limits the speed).";
    }
}

config_section! {
    /// The balance controller (§4.8.3).
    Balance "balance" {
        convergence: f64 = 5.0, "", Range(0.01, 100.0), Printed("§4.8.3 (K)"), "Speed of convergence K.";
        dt_s: f64 = 0.1, "s", Range(0.001, 10.0), Assumed, "Time for a piston to cover its displacement.";
        tolerance_deg: f64 = 0.8, "deg", Range(0.0, 20.0), Printed("§4.8.3"), "Level within this: all pistons stop.";
    }
}

config_section! {
    /// The platform PID (§4.8.2).
    PlatformPid "platform_pid" {
        kp: f64 = 200.0, "counts/deg", Range(0.0, 10_000.0), Printed("§4.8.2"), "Proportional gain.";
        ki: f64 = 10.0, "counts/(deg·s)", Range(0.0, 10_000.0), Printed("§4.8.2"), "Integral gain.";
        kd: f64 = 0.1, "counts·s/deg", Range(0.0, 1000.0), Printed("§4.8.2"), "Differential gain.";
        sample_s: f64 = 0.038, "s", Range(0.001, 10.0), Ours, "Sample period, that of the converter (the memorandum uses the encoder's).";
        anti_windup: bool = true, "", Switch, Ours, "Hold the sum while the correction is beyond the pistons' speed limit.";
    }
}

config_section! {
    /// Linear fits of Annex A: quantity = slope · PWM count + intercept. The memorandum's own numbers
    /// are lost with its figures; `robot-agent calibrate` measures them.
    Calibration "calibration" {
        steering_front_slope: f64 = -20.0 / 975.0, "deg/count", Range(-1.0, 1.0), Assumed, "Wheel angle of the front axle, + = right.";
        steering_front_intercept: f64 = 20.0 / 975.0 * 3710.0, "deg", Range(-5000.0, 5000.0), Assumed, "At count 0.";
        steering_rear_slope: f64 = -20.0 / 975.0, "deg/count", Range(-1.0, 1.0), Assumed, "Wheel angle of the rear axle, + = right.";
        steering_rear_intercept: f64 = 20.0 / 975.0 * 4179.0, "deg", Range(-5000.0, 5000.0), Assumed, "At count 0.";
        bumper_front_slope: f64 = 0.036, "deg/count", Range(-1.0, 1.0), Assumed, "Angle of the front bumper, + = up.";
        bumper_front_intercept: f64 = -135.0, "deg", Range(-5000.0, 5000.0), Assumed, "At count 0.";
        bumper_rear_slope: f64 = 0.036, "deg/count", Range(-1.0, 1.0), Assumed, "Angle of the rear bumper, + = up.";
        bumper_rear_intercept: f64 = -135.0, "deg", Range(-5000.0, 5000.0), Assumed, "At count 0.";
        piston_fl_slope: f64 = 5.0e-5, "m/s/count", Range(-0.01, 0.01), Assumed, "Speed of the front-left piston, + = up.";
        piston_fl_intercept: f64 = -0.1875, "m/s", Range(-50.0, 50.0), Assumed, "At count 0.";
        piston_fr_slope: f64 = 5.0e-5, "m/s/count", Range(-0.01, 0.01), Assumed, "Speed of the front-right piston.";
        piston_fr_intercept: f64 = -0.1875, "m/s", Range(-50.0, 50.0), Assumed, "At count 0.";
        piston_rl_slope: f64 = 5.0e-5, "m/s/count", Range(-0.01, 0.01), Assumed, "Speed of the rear-left piston.";
        piston_rl_intercept: f64 = -0.1875, "m/s", Range(-50.0, 50.0), Assumed, "At count 0.";
        piston_rr_slope: f64 = 5.0e-5, "m/s/count", Range(-0.01, 0.01), Assumed, "Speed of the rear-right piston.";
        piston_rr_intercept: f64 = -0.1875, "m/s", Range(-50.0, 50.0), Assumed, "At count 0.";
    }
}

config_section! {
    /// Which pin is on which channel (§4.1: eight PWM channels, two on the TPU).
    Channels "channels" {
        motor: String = "pwm0".to_owned(), "", Text, Assumed, "Motor (PWM by §4.1; the numbers are not printed).";
        steer_front: String = "pwm1".to_owned(), "", Text, Assumed, "Front steering (PWM by §4.1).";
        steer_rear: String = "pwm2".to_owned(), "", Text, Assumed, "Rear steering (missing in §4.1's list).";
        bumper_front: String = "tpua0".to_owned(), "", Text, Assumed, "Front bumper (TPU by §4.1).";
        bumper_rear: String = "pwm3".to_owned(), "", Text, Assumed, "Rear bumper (PWM by §4.1).";
        piston_fl: String = "pwm4".to_owned(), "", Text, Assumed, "Front-left piston (PWM by §4.1).";
        piston_fr: String = "tpua1".to_owned(), "", Text, Assumed, "Front-right piston (TPU by §4.1).";
        piston_rl: String = "pwm5".to_owned(), "", Text, Assumed, "Rear-left piston (PWM by §4.1).";
        piston_rr: String = "pwm6".to_owned(), "", Text, Assumed, "Rear-right piston (PWM by §4.1).";
        spare: String = "pwm7".to_owned(), "", Text, Assumed, "Not connected.";
        encoder: String = "tpua2".to_owned(), "", Text, Assumed, "Encoder input (FQM, §4.2.3).";
        remote_speed: String = "tpua3".to_owned(), "", Text, Assumed, "Remote control's speed (NITC, §4.2.2).";
        remote_steering: String = "tpua4".to_owned(), "", Text, Assumed, "Remote control's steering.";
        remote_selector: String = "tpua5".to_owned(), "", Text, Assumed, "Remote control's selector.";
    }
}

config_section! {
    /// Odometry (§4.9).
    Odometry "odometry" {
        keep_pose: bool = true, "", Switch, Ours, "Keep pose and yaw when the remote control hands over to automatic.";
    }
}
