//! As early as can be, and past nobody too near.

use super::*;
use crate::coordinator::discretized_path::DiscretizedPath;
use crate::coordinator::field::Field;
use crate::coordinator::occupancy::Occupancy;
use crate::coordinator::room::GridRoom;
use crate::coordinator::task::{Other, Target};
use rand_core::Rng as _;
use rand_pcg::Pcg32;
use std::f64::consts::FRAC_PI_2;
use xtb_control::VehicleConfig;
use xtb_nav::{Car, MapPose, Path};

/// There and back again: 6 m east, 1 m astern.
const WAY: [Piece; 2] =
    [Piece { length_m: 6.0, curvature_per_m: 0.0 }, Piece { length_m: -1.0, curvature_per_m: 0.0 }];

fn car() -> Car {
    Car::of(&VehicleConfig::default())
}

/// North across the way at `x_m`, from a tick on.
fn crossing(x_m: f64, from: usize) -> Occupancy {
    let mut path = Path::standing(MapPose { x_m, y_m: 1.0, yaw_rad: FRAC_PI_2 });
    path.push(Piece { length_m: 6.0, curvature_per_m: 0.0 });
    let way = DiscretizedPath::new(path, &car());
    let mut at_m = vec![0.0; from];
    at_m.extend((0..=86_u32).map(|tick| (f64::from(tick) * TICK_WAY_M).min(6.0)));
    Occupancy::driving(&way, &car(), &at_m, 0)
}

/// The tick of arrival, if there is one; and in each tick until then nobody is too near.
fn arrives(lines: &[Occupancy]) -> Option<u32> {
    let (room, car) = (GridRoom::with(10.0, 8.0, &[]), car());
    let start = MapPose { x_m: 1.0, y_m: 4.0, yaw_rad: 0.0 };
    let target = Some(Target { x_m: 6.0, y_m: 4.0, yaw_rad: Some(0.0) });
    let field = Field::new(&room, car.half_width_m, &[], [6.0, 4.0]);
    let others: Vec<Other<'_>> =
        lines.iter().map(|line| Other { line, separation_m: 0.08, is_thing: false }).collect();
    let (others, soft) = (&others[..], &[][..]);
    let task =
        Task { room: &room, car: &car, start, gear: 1.0, tick: 0, target, field: &field, others, soft };
    let mut left = 5;
    let legs = keep_to(&task, &WAY, &mut left).ok()?;
    assert_eq!(left, 0, "26 pieces are 5 nodes");
    let (mut pose, mut tick) = (start, 0);
    for leg in &legs {
        let is_free = |pose: &MapPose, tick: u32| {
            let stand = Stand::still(&car, pose);
            others.iter().all(|other| !other.line.hits(&stand, tick, 0.08))
        };
        assert!((tick..leg.depart).all(|tick| is_free(&pose, tick)), "it waits in somebody's way");
        for step in 1..=leg.ticks {
            let way_m = leg.piece.length_m * f64::from(step) / f64::from(leg.ticks);
            assert!(is_free(&leg.piece.after(&pose, way_m), leg.depart + step), "it drives into somebody");
        }
        (pose, tick) = (leg.piece.end(&pose), leg.depart + leg.ticks);
    }
    let driven_m: f64 = legs.iter().map(|leg| leg.piece.length_m).sum();
    assert!((driven_m - 5.0).abs() < 1e-9 && (pose.x_m - 6.0).abs() < 1e-9, "it left its way: {pose:?}");
    Some(tick)
}

#[test]
fn with_nobody_there_it_takes_what_the_way_takes() {
    // 22 pieces of 4 ticks (0.27 m), a change of gear, 4 pieces of 4 ticks (0.25 m).
    assert_eq!(arrives(&[]), Some(22 * 4 + 2 + 4 * 4));
}

#[test]
fn it_goes_before_whoever_comes_late_and_after_whoever_comes_soon() {
    let alone = arrives(&[]).unwrap();
    assert_eq!(arrives(&[crossing(3.5, 200)]), Some(alone));
    let after = arrives(&[crossing(3.5, 0)]).unwrap();
    assert!((alone + 10..alone + 60).contains(&after), "{after} against {alone}");
    // Two gaps, the first of which leads to nothing.
    let both = arrives(&[crossing(2.5, 30), crossing(4.5, 20), crossing(4.5, 60)]).unwrap();
    assert!(both < alone + 110, "{both}");
    // Who stays on its way leaves none.
    let stands = Occupancy::standing(&[Stand::still(&car(), &MapPose { x_m: 4.0, y_m: 4.0, yaw_rad: 0.0 })]);
    assert_eq!(arrives(&[stands]), None);
}

#[test]
fn among_many_that_cross_it_arrives_soon_after_the_last_gap_that_it_needs() {
    let mut random = Pcg32::new(7, 11);
    let alone = arrives(&[]).unwrap();
    for _ in 0..40 {
        let mut draw = |most: u32| random.next_u32() % most;
        let lines: Vec<Occupancy> =
            (0..6).map(|_| crossing(2.0 + f64::from(draw(450)) / 100.0, draw(300) as usize)).collect();
        let last = lines.iter().map(Occupancy::end).max().unwrap();
        let tick = arrives(&lines).unwrap();
        assert!((alone..=alone + last).contains(&tick), "{tick}");
    }
}
