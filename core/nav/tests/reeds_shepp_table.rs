//! Reeds–Shepp lengths against an independent implementation: reeds_shepp_table.py made the numbers
//! with the Open Motion Planning Library.
#![allow(clippy::unwrap_used)]

use xtb_nav::MapPose;
use xtb_nav::geometry::reeds_shepp;

#[test]
fn lengths_are_those_of_the_open_motion_planning_library() {
    let lines = include_str!("reeds_shepp_table.csv").lines().skip(1);
    let mut compared = 0;
    for line in lines {
        let numbers: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        let [radius, x0, y0, yaw0, x1, y1, yaw1, length] = numbers[..] else { panic!("{line}") };
        let from = MapPose { x_m: x0, y_m: y0, yaw_rad: yaw0 };
        let to = MapPose { x_m: x1, y_m: y1, yaw_rad: yaw1 };
        let ours = reeds_shepp::distance_m(&from, &to, radius);
        assert!((ours - length).abs() < 1e-6 * radius, "{ours} instead of {length}: {line}");
        let path = reeds_shepp::shortest(&from, &to, radius);
        let end = path.end();
        assert!((path.length_m() - length).abs() < 1e-6 * radius, "{path:?}");
        assert!(libm::hypot(end.x_m - x1, end.y_m - y1) < 1e-6 * radius, "{path:?} ends beside {to:?}");
        compared += 1;
    }
    assert_eq!(compared, 2000);
}
