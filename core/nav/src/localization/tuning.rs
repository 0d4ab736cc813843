//! What the filter assumes of the truck's sensors, each with unit, range, default and origin.

use xtb_control::config::{
    Allowed::Range,
    DefaultOrigin::{Assumed, Ours},
};
use xtb_control::config_section;

config_section! {
    /// The pose filter.
    FilterTuning "filter" {
        start_m: f64 = 0.02, "m", Range(0.001, 10.0), Ours, "Standard deviation of a start pose or a pose that is set.";
        start_rad: f64 = 0.02, "rad", Range(0.001, 1.0), Ours, "The same of its heading.";
        drift_radps: f64 = 0.003, "rad/s", Range(1.0e-6, 0.1), Assumed, "Standard deviation of the gyro's drift (0 to 0.3 deg/s about 0).";
        drift_walk: f64 = 2.0e-5, "rad/s/√s", Range(0.0, 0.01), Assumed, "How fast that drift changes.";
        yaw_noise_rad: f64 = 0.001, "rad", Range(1.0e-5, 0.1), Assumed, "Standard deviation of a yaw reading.";
        yaw_walk: f64 = 3.0e-4, "rad/√s", Range(0.0, 0.1), Assumed, "How fast an error of the yaw grows in addition to the drift.";
        wheel_scale: f64 = 0.012, "of the diameter", Range(1.0e-4, 0.2), Assumed, "Standard deviation of the tyres (± 2 %).";
        open_scale: f64 = 0.1, "of the diameter", Range(0.0, 0.5), Ours, "The same with fixes, which measure it: settings may be wrong.";
        delay_s: f64 = 0.1, "s", Range(0.0, 0.5), Assumed, "Standard deviation of the difference between true and reported age of a fix.";
        delay_walk: f64 = 3.0e-4, "s/√s", Range(0.0, 0.1), Assumed, "How fast that changes.";
        along_walk: f64 = 0.01, "m/√m", Range(0.0, 0.2), Assumed, "Error of the distance driven in addition to the tyres' (slip, play).";
        across_walk: f64 = 0.01, "m/√m", Range(0.0, 0.2), Assumed, "Error to the side (axles that are not quite straight).";
        lost_rad: f64 = 0.35, "rad", Range(0.05, 1.0), Ours, "With a less certain heading single fixes are not accepted, only several that agree.";
        gate: f64 = 1.0, "relative", Range(0.1, 10.0), Ours, "Outlier threshold, relative to the distance that 1 correct fix in 1,000 exceeds.";
        late_s: f64 = 0.5, "s", Range(0.0, 0.6), Ours, "Fixes older than this on arrival are ignored.";
    }
}
