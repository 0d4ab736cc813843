//! How far it is, with walls in between.

use xtb_control::VehicleConfig;
use xtb_dispatch::assign::{Candidate, Demand, assign};
use xtb_dispatch::{MapTravelCost, OpenTravelCost, TravelCost};
use xtb_nav::{Car, Cell, Grid, Map, MapPose};
use xtb_protocol::messages::{TaskId, Waypoint};

/// A room of `side_m` by 8 m, with a wall across at y = 4 m that leaves 2 m free in the east, or nothing.
fn walled(side_m: f64, door: bool) -> MapTravelCost {
    let cells = (side_m / 0.05) as usize;
    let mut grid = Grid::free(0.05, [0.0, 0.0], cells, 160).unwrap();
    let wall = if door { cells - 40 } else { cells };
    (0..wall).for_each(|column| grid.set(column as i64, 80, Cell::Occupied));
    MapTravelCost::new(Map::new("rooms", grid, Vec::new()).unwrap())
}

fn truck() -> Car {
    Car::of(&VehicleConfig::default())
}

fn at(x_m: f64, y_m: f64) -> MapPose {
    MapPose { x_m, y_m, yaw_rad: 0.0 }
}

fn to(x_m: f64, y_m: f64) -> Waypoint {
    Waypoint { x_m, y_m, yaw_rad: None }
}

#[test]
fn the_robot_in_the_same_room_goes_and_not_the_one_behind_the_wall() {
    let candidate = |pose| Candidate { pose, car: truck(), extra_m: 0.0 };
    let robots = [candidate(at(1.0, 4.8)), candidate(at(6.0, 1.0))];
    let task = [Demand { id: TaskId::new(1), level: 5, first: Some(to(1.0, 3.0)) }];
    let any = |_: usize, _: usize| Some(0.0);
    assert_eq!(assign(&task, &robots, &walled(10.0, true), &any), [(0, 1)]);
    assert_eq!(
        assign(&task, &robots, &OpenTravelCost, &any),
        [(0, 0)],
        "without walls it would be the other one"
    );
}

#[test]
fn a_way_around_a_wall_is_as_long_as_it_is_and_one_in_the_open_as_before() {
    let (travel_cost, car) = (walled(10.0, true), truck());
    // From (1, 3) to the door's near corner at (8, 4), through it, and back to (1, 5).
    let around_m = 2.0 * (7.0_f64.powi(2) + 1.0).sqrt();
    let found_m = travel_cost.distance_m(&car, &at(1.0, 3.0), &to(1.0, 5.0));
    assert!((0.9..1.1).contains(&(found_m / around_m)), "{found_m}, by the ruler {around_m}");
    for (from, to) in
        [(at(1.0, 1.0), to(6.0, 2.0)), (at(8.5, 2.0), to(2.0, 3.0)), (at(9.0, 2.0), to(9.0, 7.0))]
    {
        let (found_m, open_m) =
            (travel_cost.distance_m(&car, &from, &to), OpenTravelCost.distance_m(&car, &from, &to));
        assert!((found_m - open_m).abs() < 0.02 * open_m, "{found_m}, in the open {open_m}");
    }
}

#[test]
fn where_no_way_leads_is_far_but_not_out_of_the_question() {
    let (travel_cost, car) = (walled(10.0, false), truck());
    let (from, to) = (at(1.0, 3.0), to(1.0, 5.0));
    let more_m = travel_cost.distance_m(&car, &from, &to) - OpenTravelCost.distance_m(&car, &from, &to);
    assert!((more_m - 50.0).abs() < 1e-9, "{more_m}");
}

#[test]
fn a_round_measures_so_many_ways_at_most_and_the_next_one_goes_on() {
    let (travel_cost, car) = (walled(100.0, true), truck()); // 80,000 cells a flood
    let around = |i: usize| {
        let x_m = 1.0 + 5.0 * i as f64;
        travel_cost.distance_m(&car, &at(x_m, 3.0), &to(x_m, 5.0)) > 10.0
    };
    let measured = |round: std::ops::Range<usize>| round.filter(|i| around(*i)).count();
    assert_eq!(measured(0..10), 4);
    assert_eq!(measured(0..10), 4, "no more in the same round");
    travel_cost.begin_round();
    assert_eq!(measured(0..10), 8);
    travel_cost.begin_round();
    assert_eq!(measured(0..10), 10);
}

#[test]
fn a_gap_is_a_way_for_the_car_that_fits_through_it() {
    let mut grid = Grid::free(0.05, [0.0, 0.0], 200, 160).unwrap();
    (0..195).for_each(|column| grid.set(column, 80, Cell::Occupied)); // 0.25 m are left
    let travel_cost = MapTravelCost::new(Map::new("gap", grid, Vec::new()).unwrap());
    let small = Car { half_width_m: 0.1, ..truck() };
    let (from, beyond, in_gap) = (at(9.0, 2.0), to(9.0, 7.0), to(9.875, 4.0));
    assert_eq!(travel_cost.is_reachable(&truck(), &from, &beyond), Some(false));
    assert_eq!(travel_cost.is_reachable(&small, &from, &beyond), Some(true));
    assert!(travel_cost.admits(&small, &in_gap).is_ok() && travel_cost.admits(&truck(), &in_gap).is_err());
}

#[test]
fn a_point_nearer_to_a_wall_than_traffic_control_plans_has_no_room_though_a_robot_could_stand_there() {
    let (travel_cost, car) = (walled(10.0, false), truck());
    // The wall begins at 4 m, and half a truck is 0.2 m wide.
    let (near, far) = (to(5.0, 3.795), to(5.0, 3.78));
    assert!(travel_cost.admits(&car, &near).is_ok() && travel_cost.admits(&car, &far).is_ok());
    assert!(!travel_cost.has_room(&car, &near) && travel_cost.has_room(&car, &far));
    let across = Waypoint { yaw_rad: Some(std::f64::consts::FRAC_PI_2), ..far };
    assert!(!travel_cost.has_room(&car, &across), "it is longer than wide");
    assert!(OpenTravelCost.has_room(&car, &near), "nobody knows of a wall");
}
