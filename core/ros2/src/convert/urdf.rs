//! The robot's URDF, made from its settings: the body as a box, wheels, and the sensors' frames.
//!
//! Links bear the names of the frames, so RViz needs no prefix; wheels are drawn on `base_link`, as nothing says how
//! far they have turned.

use super::robot::Robot;
use std::fmt::Write as _;

/// Width of a tyre and height of the body, in parts of the wheel's diameter (assumed): the settings do not say them.
const TYRE: f64 = 0.4;

impl Robot {
    /// The text of `robot_description`.
    #[must_use]
    pub fn description(&self) -> String {
        let geometry = &self.vehicle.geometry;
        let (diameter_m, radius_m) = (geometry.wheel_diameter_m, geometry.wheel_diameter_m / 2.0);
        let tyre_m = TYRE * diameter_m;
        let base_link = &self.frames.base_link;
        let mut text = format!("<?xml version=\"1.0\"?>\n<robot name=\"{}\">\n", self.frames.prefix());
        let (length_m, width_m) =
            (geometry.body_length_m, (geometry.body_width_m - 2.0 * tyre_m).max(tyre_m));
        let midway_m = self.vehicle.drivetrain.midway_m(geometry.wheelbase_m);
        let body_m = self.vehicle.body_ahead_m();
        let mut visuals = visual(
            &format!("xyz=\"{body_m} 0 {diameter_m}\""),
            &format!("<box size=\"{length_m} {width_m} {radius_m}\"/>"),
            ("body", "0.85 0.35 0.1 1"),
        );
        for (ahead, left) in [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)] {
            let (x_m, y_m) = (midway_m + ahead * geometry.wheelbase_m / 2.0, left * geometry.track_m / 2.0);
            visuals += &visual(
                &format!("xyz=\"{x_m} {y_m} {radius_m}\" rpy=\"1.5707963 0 0\""),
                &format!("<cylinder radius=\"{radius_m}\" length=\"{tyre_m}\"/>"),
                ("tyre", "0.1 0.1 0.1 1"),
            );
        }
        let collision = format!(
            "    <collision><origin xyz=\"{body_m} 0 {radius_m}\"/><geometry><box size=\"{length_m} {} {diameter_m}\"/>\
             </geometry></collision>\n",
            geometry.body_width_m
        );
        push(&mut text, format_args!("  <link name=\"{base_link}\">\n{visuals}{collision}  </link>\n"));
        for (frame, pose) in self.frames.sensors(&self.vehicle) {
            let (at, yaw_rad) = (&pose.position, 2.0 * libm::atan2(pose.orientation.z, pose.orientation.w));
            push(
                &mut text,
                format_args!(
                    "  <link name=\"{frame}\"/>\n  <joint name=\"{frame}_joint\" type=\"fixed\"><parent link=\"{base_link}\"/>\
                     <child link=\"{frame}\"/><origin xyz=\"{} {} {}\" rpy=\"0 0 {yaw_rad}\"/></joint>\n",
                    at.x, at.y, at.z
                ),
            );
        }
        text + "</robot>\n"
    }
}

fn visual(origin: &str, geometry: &str, (material, rgba): (&str, &str)) -> String {
    format!(
        "    <visual><origin {origin}/><geometry>{geometry}</geometry>\
         <material name=\"{material}\"><color rgba=\"{rgba}\"/></material></visual>\n"
    )
}

/// A String takes everything.
fn push(text: &mut String, more: std::fmt::Arguments<'_>) {
    let _ = text.write_fmt(more);
}
