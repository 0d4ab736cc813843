//! The platform levels a slope. The tests in `platform.rs` and the example `level_plot` measure with
//! this.

use crate::agent::{Bench, steps};
use std::f64::consts::FRAC_PI_2;
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_control::vehicle::Platform;
use xtb_sim::{TruckParameters, World};

/// What §4.8.3 calls level, on both axes.
pub(crate) const LEVEL_DEG: f64 = 0.8;

/// A truck on a slope that rises in this direction relative to its nose (counter-clockwise),
/// levelling itself.
pub(crate) fn on_slope(controller: Platform, slope_deg: f64, bearing_rad: f64, seed: u64) -> Bench {
    let world = format!(
        "[[ramps]]\nx_m = 0.0\ny_m = 0.0\nlength_m = 4.0\nwidth_m = 4.0\nslope_deg = {slope_deg:?}\n\
         uphill_rad = {:?}",
        FRAC_PI_2 + bearing_rad
    );
    let world = World::from_toml(&world).unwrap();
    let config = VehicleConfig { platform: controller, ..VehicleConfig::default() };
    let start = MapPose { yaw_rad: FRAC_PI_2, ..MapPose::default() };
    Bench::with_config(world, &TruckParameters::default(), start, seed, config)
}

/// The platform's tilt over time.
#[derive(Debug, Clone)]
pub(crate) struct Levelling {
    /// Seconds since the first reading, x and y in degrees.
    pub(crate) course: Vec<(f64, f64, f64)>,
    pub(crate) end_stop_pushes: u64,
}

impl Levelling {
    /// Watches for so long.
    pub(crate) fn watch(mut bench: Bench, seconds: f64) -> Self {
        let (mut course, mut began_s) = (Vec::new(), None);
        for _ in 0..steps(seconds) {
            bench.step();
            let now_s = bench.simulation.now().s();
            if let Some((x_deg, y_deg)) = bench.agent.outputs.tilt.both() {
                course.push((now_s - *began_s.get_or_insert(now_s), x_deg, y_deg));
            }
        }
        Self { course, end_stop_pushes: bench.truck().end_stop_pushes() }
    }

    /// From when on it is level and stays so; `None` if it is not at the end.
    pub(crate) fn settled_s(&self) -> Option<f64> {
        let level =
            |(_, x_deg, y_deg): &(f64, f64, f64)| x_deg.abs() <= LEVEL_DEG && y_deg.abs() <= LEVEL_DEG;
        match self.course.iter().rposition(|moment| !level(moment)) {
            None => self.course.first().map(|moment| moment.0),
            Some(last) => self.course.get(last + 1).map(|moment| moment.0),
        }
    }
}
