//! The follower's constants, each with unit, range, default and origin.

use xtb_control::config::{
    Allowed::Range,
    DefaultOrigin::{Assumed, Ours},
};
use xtb_control::config_section;

config_section! {
    /// How a path is driven.
    FollowerSettings "follower" {
        look_ahead_m: f64 = 0.22, "m", Range(0.05, 2.0), Ours, "Look-ahead at standstill: pose errors decay over about this distance.";
        look_ahead_s: f64 = 0.2, "s", Range(0.0, 2.0), Ours, "Additional look-ahead per m/s of speed.";
        look_ahead_tight_m: f64 = 0.10, "m", Range(0.0, 2.0), Ours, "With less clearance than this the look-ahead is as short as at a standstill.";
        approach_deg: f64 = 35.0, "deg", Range(5.0, 80.0), Ours, "Steepest angle at which it drives back to the path.";
        lock_s: f64 = 0.1, "s", Range(0.0, 2.0), Assumed, "The servos take this long from straight to full lock (20° at 200°/s).";
        servo_lag_s: f64 = 0.03, "s", Range(0.001, 1.0), Assumed, "Their first-order lag near the wanted angle.";
        servo_delay_s: f64 = 0.035, "s", Range(0.0, 0.5), Assumed, "From a command to the servos' first movement: a turn, a frame and a pulse period, in the mean.";
        acceleration_mps2: f64 = 0.5, "m/s²", Range(0.05, 5.0), Ours, "Acceleration of the commanded speed.";
        lead_mps: f64 = 0.2, "m/s", Range(0.05, 5.0), Ours, "Largest lead over the measured speed: slow start after an obstacle.";
        creep_mps: f64 = 0.08, "m/s", Range(0.01, 0.2), Ours, "Lowest commanded speed: out of the dead band within 0.2 s and held within 5 %; 0.05 m/s takes twice, 0.02 m/s ten times as long.";
        stop_s: f64 = 0.45, "s", Range(0.1, 5.0), Ours, "Speed towards a stop is the remaining distance divided by this; more than obstacle.reaction_s (0.358 s).";
        coast_s: f64 = 0.26, "s", Range(0.01, 5.0), Assumed, "With a neutral motor it coasts for its speed times this: motor lag 0.25 s and a pulse's delay to the motor.";
        settle_m: f64 = 0.008, "m", Range(0.001, 0.2), Ours, "A stop at most this far before its point is accepted.";
        standing_mps: f64 = 0.008, "m/s", Range(0.0, 0.1), Ours, "Slower counts as stopped: one pulse per window is 0.005 m/s.";
        standing_s: f64 = 0.12, "s", Range(0.0, 2.0), Ours, "Stopped after this long without motion: two windows of the encoder.";
        turned_s: f64 = 0.05, "s", Range(0.0, 2.0), Ours, "Delay between the expected end of turning the wheels and the motor.";
        turning_s: f64 = 1.0, "s", Range(0.0, 10.0), Ours, "Longest wait for the wheels: a noisy pose keeps them moving.";
        clearance_s: f64 = 0.5, "s", Range(0.1, 10.0), Ours, "Speed limit: clearance divided by this.";
        tight_mps: f64 = 0.10, "m/s", Range(0.01, 1.0), Ours, "Speed allowed at any clearance.";
        ramp_m: f64 = 0.05, "m", Range(0.005, 1.0), Ours, "Slow enough that the wheels turn from one arc's angle to the next within this distance.";
        deviation_m: f64 = 0.12, "m", Range(0.01, 2.0), Ours, "With a larger cross-track error the robot stops and reports it.";
        deviation_deg: f64 = 40.0, "deg", Range(1.0, 180.0), Ours, "The same for the heading.";
        no_motion_s: f64 = 2.0, "s", Range(0.1, 60.0), Ours, "Driving commands for this long without wheel motion: stuck.";
        no_progress_s: f64 = 6.0, "s", Range(0.1, 60.0), Ours, "Turning wheels for this long without progress along the path: stuck.";
        progress_m: f64 = 0.02, "m", Range(0.001, 1.0), Ours, "Less is no progress.";
    }
}
