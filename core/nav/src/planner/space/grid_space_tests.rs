//! Footprints, sweeps and layers against brute force.

use super::*;
use rand_core::Rng;
use rand_pcg::Pcg32;
use std::f64::consts::{FRAC_PI_2, PI};

const CAR: Car =
    Car { front_m: 0.25, rear_m: 0.25, half_width_m: 0.2, radius_m: 0.393, gears: crate::Gears::BOTH };

struct Random(Pcg32);

impl Random {
    fn uniform(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    fn pose(&mut self, side_m: f64) -> MapPose {
        let mut along = || self.uniform(0.0, side_m);
        MapPose { x_m: along(), y_m: along(), yaw_rad: self.uniform(-PI, PI) }
    }
}

fn scattered(cells: i64, boxes: usize, random: &mut Random) -> Grid {
    let mut grid = Grid::free(0.05, [0.0, 0.0], cells as usize, cells as usize).unwrap();
    for _ in 0..boxes {
        let mut along = |max: i64| random.uniform(0.0, max as f64) as i64;
        let (column, row, width, height) = (along(cells), along(cells), 1 + along(4), 1 + along(4));
        for (c, r) in (column..column + width).flat_map(|c| (row..row + height).map(move |r| (c, r))) {
            grid.set(c, r, Cell::Occupied);
        }
    }
    grid
}

fn on(grid: &Grid) -> GridSpace {
    GridSpace::new(&GridLayers::map(grid), CAR, LookOut::OFF).unwrap()
}

/// Corners of a rectangle ahead and left of a pose.
fn corners(pose: &MapPose, front: f64, rear: f64, half_width: f64) -> [[f64; 2]; 4] {
    let car = Car {
        front_m: front,
        rear_m: rear,
        half_width_m: half_width,
        radius_m: 1.0,
        gears: crate::Gears::BOTH,
    };
    car.corners(pose)
}

/// Whether a turned rectangle and a square overlap, by separating axes.
fn overlap(a: &[[f64; 2]; 4], yaw: f64, b: &[[f64; 2]; 4]) -> bool {
    let (sin, cos) = libm::sincos(yaw);
    [[cos, sin], [-sin, cos], [1.0, 0.0], [0.0, 1.0]].iter().all(|axis| {
        let span = |c: &[[f64; 2]; 4]| {
            let along = c.map(|p| p[0] * axis[0] + p[1] * axis[1]);
            (along.iter().copied().fold(f64::MAX, f64::min), along.iter().copied().fold(f64::MIN, f64::max))
        };
        let ((a, b), (c, d)) = (span(a), span(b));
        b > c && d > a
    })
}

/// Whether a rectangle touches anything, by looking at every cell.
fn brute(grid: &Grid, pose: &MapPose, front: f64, rear: f64, half_width: f64) -> bool {
    let body = corners(pose, front, rear, half_width);
    let side = grid.resolution_m() * grid.width() as f64;
    let outside = body.iter().flatten().any(|&v| v < 0.0 || v > side);
    outside
        || grid.cells().iter().enumerate().any(|(index, cell)| {
            let (column, row) = ((index % grid.width()) as f64 * 0.05, (index / grid.width()) as f64 * 0.05);
            let square =
                [[column, row], [column + 0.05, row], [column + 0.05, row + 0.05], [column, row + 0.05]];
            *cell != Cell::Free && overlap(&body, pose.yaw_rad, &square)
        })
}

#[test]
fn the_footprint_is_exact() {
    let mut random = Random(Pcg32::new(7, 7));
    let (mut free, mut hit) = (0, 0);
    for _ in 0..40 {
        let grid = scattered(40, 12, &mut random);
        let space = on(&grid);
        for _ in 0..100 {
            let pose = random.pose(2.0);
            let expected = brute(&grid, &pose, 0.25, 0.25, 0.2);
            assert_eq!(space.standing(&pose).is_some(), expected, "{pose:?}");
            *(if expected { &mut hit } else { &mut free }) += 1;
        }
    }
    assert!(free > 300 && hit > 300, "{free} free, {hit} not");
}

#[test]
fn nothing_slips_through_between_samples_and_little_is_refused_for_nothing() {
    let mut random = Random(Pcg32::new(8, 8));
    let (mut free, mut hit, mut cautious) = (0, 0, 0);
    for round in 0..120 {
        let grid = scattered(40, 6, &mut random);
        let look_out =
            if round % 2 == 0 { LookOut::OFF } else { LookOut { ahead_m: 0.28, half_width_m: 0.17 } };
        let space = GridSpace::new(&GridLayers::map(&grid), CAR, look_out).unwrap();
        for _ in 0..20 {
            let from = random.pose(2.0);
            let curvature_per_m = [0.0, 1.0 / 0.393, -1.0 / 0.393, 0.9][random.uniform(0.0, 4.0) as usize];
            let piece = Piece { length_m: random.uniform(-0.9, 0.9), curvature_per_m };
            let touches = |grown: f64| {
                (0..=300).any(|step| {
                    let pose = piece.after(&from, piece.length_m * f64::from(step) / 300.0);
                    let strip = 0.25 + look_out.ahead_m;
                    let (front, rear) = if piece.length_m < 0.0 { (-0.25, strip) } else { (strip, -0.25) };
                    let body = brute(&grid, &pose, 0.25 + grown, 0.25 + grown, 0.2 + grown);
                    body || look_out.ahead_m > 0.0
                        && brute(&grid, &pose, front + grown, rear + grown, 0.17 + grown)
                })
            };
            let (expected, drives) = (touches(0.0), space.drives(&from, &piece));
            assert!(!(drives && expected), "{from:?} {piece:?} slips through");
            assert_eq!(space.driving(&from, &piece).is_none(), drives);
            if !drives && !expected {
                cautious += 1;
                assert!(touches(0.006), "{from:?} {piece:?} has more than 6 mm to spare");
            }
            *(if expected { &mut hit } else { &mut free }) += 1;
        }
    }
    assert!(free > 200 && hit > 200, "{free} free, {hit} not");
    assert!(cautious * 20 < free, "{cautious} of {free} refused within 6 mm");
}

#[test]
fn a_post_between_two_samples_is_seen() {
    // One cell, as wide as the way is short: only the sweep, neither end touches it.
    let mut grid = Grid::free(0.02, [0.0, 0.0], 200, 100).unwrap();
    grid.set(100, 50, Cell::Occupied);
    let space = on(&grid);
    let from = MapPose { x_m: 1.2, y_m: 1.0, yaw_rad: 0.0 };
    let piece = Piece { length_m: 1.6, curvature_per_m: 0.0 };
    assert!(space.standing(&from).is_none() && space.standing(&piece.end(&from)).is_none());
    let hit = space.driving(&from, &piece).unwrap();
    assert_eq!(hit.what, Obstruction::Wall);
    assert!(libm::hypot(hit.x_m - 2.01, hit.y_m - 1.01) < 0.03, "{hit}");
}

#[test]
fn the_strip_counts_in_the_gear_that_is_driven() {
    let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 40).unwrap();
    (0..40).for_each(|row| grid.set(40, row, Cell::Occupied)); // from x = 2.00 m
    let space = GridSpace::new(&GridLayers::map(&grid), CAR, LookOut::TRUCK).unwrap();
    let drive = |x_m: f64, yaw_rad: f64, length_m: f64| {
        let from = MapPose { x_m, y_m: 1.0, yaw_rad };
        space.drives(&from, &Piece { length_m, curvature_per_m: 0.0 })
    };
    // 5 cm from the wall: away from it only, nose or tail first.
    assert!(!drive(1.7, 0.0, 0.01) && drive(1.7, 0.0, -0.5));
    assert!(!drive(1.7, PI, -0.01) && drive(1.7, PI, 0.5));
    // Up to 28 cm before it.
    assert!(drive(1.0, 0.0, 0.46) && !drive(1.0, 0.0, 0.48));
    assert!(on(&grid).drives(
        &MapPose { x_m: 1.0, y_m: 1.0, yaw_rad: 0.0 },
        &Piece { length_m: 0.74, curvature_per_m: 0.0 }
    ));
}

#[test]
fn zones_keep_the_body_out_but_not_the_sensors() {
    let grid = Grid::free(0.05, [0.0, 0.0], 80, 40).unwrap();
    let cells = (0..80 * 40).map(|index| if index % 80 >= 40 { 2 } else { 0 }).collect();
    let zones = Zones { names: vec!["dock".into(), "lab".into()], cells };
    let layers = GridLayers { zones: Some(&zones), ..GridLayers::map(&grid) };
    let space = GridSpace::new(&layers, CAR, LookOut::TRUCK).unwrap();
    let at = |x_m: f64| MapPose { x_m, y_m: 1.0, yaw_rad: 0.0 };
    assert_eq!(space.standing(&at(1.8)).unwrap().what, Obstruction::KeepOut("lab".into()));
    assert!(space.drives(&at(1.0), &Piece { length_m: 0.7, curvature_per_m: 0.0 }));
    assert!(!space.drives(&at(1.0), &Piece { length_m: 0.8, curvature_per_m: 0.0 }));
    let unnamed = Zones { names: vec!["dock".into()], ..zones.clone() };
    let layers = GridLayers { zones: Some(&unnamed), ..layers };
    assert_eq!(GridSpace::new(&layers, CAR, LookOut::OFF).unwrap_err(), LayersError::Unnamed(2));
    let short = Zones { cells: vec![0; 7], ..zones.clone() };
    let layers = GridLayers { zones: Some(&short), ..layers };
    assert!(GridSpace::new(&layers, CAR, LookOut::OFF).unwrap_err().to_string().contains("7 cells"));
}

#[test]
fn one_way_zones_are_driven_along_whichever_end_is_ahead() {
    let grid = Grid::free(0.05, [0.0, 0.0], 80, 40).unwrap();
    let east = vec![Some(0.0); 80 * 40];
    let layers = GridLayers { one_way: Some(&east), ..GridLayers::map(&grid) };
    let space = GridSpace::new(&layers, CAR, LookOut::OFF).unwrap();
    let drive = |yaw_rad, length_m, curvature_per_m| {
        space.driving(&MapPose { x_m: 2.0, y_m: 1.0, yaw_rad }, &Piece { length_m, curvature_per_m })
    };
    assert_eq!(drive(0.0, 0.5, 0.0), None);
    assert_eq!(drive(PI, -0.5, 0.0), None);
    assert_eq!(drive(0.0, -0.5, 0.0).unwrap().what, Obstruction::OneWay);
    assert_eq!(drive(PI, 0.5, 0.0).unwrap().what, Obstruction::OneWay);
    let drives_on = |yaw_rad| space.lets_drive_on(&MapPose { x_m: 2.0, y_m: 1.0, yaw_rad });
    assert!(drives_on(0.7) && drives_on(-2.5) && !drives_on(1.0) && !drives_on(-FRAC_PI_2));
    // A quarter turn is the most.
    assert_eq!(drive(0.0, 0.9 * FRAC_PI_2 * 0.4, 2.5), None);
    assert!(drive(0.0, 1.1 * FRAC_PI_2 * 0.4, 2.5).is_some());
}

#[test]
fn things_are_named_by_what_they_are() {
    let mut grid = Grid::free(0.05, [0.0, 0.0], 80, 80).unwrap();
    grid.set(60, 60, Cell::Unknown);
    let layers = GridLayers { local_m: &[[1.01, 1.01], [-4.0, 0.0]], ..GridLayers::map(&grid) };
    let space = GridSpace::new(&layers, CAR, LookOut::OFF).unwrap();
    let what = |x_m, y_m| space.standing(&MapPose { x_m, y_m, yaw_rad: 0.0 }).map(|hit| hit.what);
    assert_eq!(what(1.0, 1.0), Some(Obstruction::Local));
    assert_eq!(what(3.0, 3.0), Some(Obstruction::Unknown));
    assert_eq!(what(0.1, 2.0), Some(Obstruction::Edge));
    assert_eq!(what(9.0, 9.0), Some(Obstruction::Edge));
    assert_eq!(what(2.0, 2.0), None);
    let hit = space.standing(&MapPose { x_m: 1.0, y_m: 1.0, yaw_rad: 0.0 }).unwrap();
    assert_eq!(hit.to_string(), "an unmapped obstacle at (1.03, 1.03)");
}

#[test]
fn a_quick_look_refuses_only_what_cannot_be_driven() {
    let mut random = Random(Pcg32::new(9, 9));
    let (mut refused, mut kept, mut free) = (0, 0, 0);
    for _ in 0..60 {
        let space = on(&scattered(60, 12, &mut random));
        for _ in 0..40 {
            let from = random.pose(3.0);
            let curvatures = [0.0, 1.0 / 0.393, -1.0 / 0.393];
            let mut piece = |curvature_per_m| Piece { length_m: random.uniform(-1.0, 1.0), curvature_per_m };
            let pieces = curvatures.map(&mut piece);
            match (space.may_drive_all(&from, &pieces), space.drives_all(&from, &pieces)) {
                (false, drives) => {
                    refused += 1;
                    assert!(!drives, "{from:?} {pieces:?}");
                }
                (true, drives) => *(if drives { &mut free } else { &mut kept }) += 1,
            }
        }
    }
    assert!(refused > 4 * kept && free > 20, "{refused} refused, {kept} found out later, {free} free");
}

#[test]
fn rounding_beside_a_wall_does_not_part_what_is_driven_from_what_is_named() {
    let mut random = Random(Pcg32::new(10, 10));
    let space = on(&scattered(80, 12, &mut random));
    let mut free = 0;
    for _ in 0..4000 {
        let mut on_cells = |most: f64| 0.05 * libm::floor(random.uniform(0.0, most));
        let from =
            MapPose { x_m: on_cells(80.0), y_m: on_cells(80.0), yaw_rad: on_cells(4.0) * 20.0 * FRAC_PI_2 };
        let piece = Piece { length_m: on_cells(20.0) - 0.5, curvature_per_m: 0.0 };
        let drives = space.drives(&from, &piece);
        assert_eq!(space.driving(&from, &piece).is_none(), drives, "{from:?} {piece:?}");
        free += usize::from(drives);
    }
    assert!((100..3900).contains(&free), "{free} free");
}
