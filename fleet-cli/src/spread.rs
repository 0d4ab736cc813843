//! A point of its own for each of several robots that are sent to one point, or into one area. Pure.
//!
//! Around the point, or over the area, lie circles side by side as in a honeycomb; those of them that are free of
//! walls, unknown cells and keep-out zones are taken, the nearest first, and each robot gets the one that makes all
//! ways together shortest.

use xtb_dispatch::assign::exact;
use xtb_nav::geometry::Clearance;
use xtb_nav::map::polygon;

/// Between the middles of two robots unless it is said otherwise, in m.
pub(crate) const APART_M: f64 = 1.0;
/// Circles that are looked at for each robot.
const TRIES: f64 = 12.0;

/// Where they may stand.
#[derive(Clone, Copy)]
pub(crate) struct Floor<'a> {
    /// What they are sent to, (x, y) in m.
    pub(crate) middle: [f64; 2],
    /// The corners of the area in which their middles have to be; empty = anywhere near.
    pub(crate) area: &'a [[f64; 2]],
    /// Of the map with its keep-out zones; `None` = no map is known.
    pub(crate) clearance: Option<&'a Clearance>,
    /// Where robots stand that stay there.
    pub(crate) others: &'a [[f64; 2]],
}

/// At most `count` points, the nearest to the middle first, `apart_m` or more from each other, each with half of
/// that free around it.
pub(crate) fn points(floor: Floor<'_>, count: usize, apart_m: f64) -> Vec<[f64; 2]> {
    let [x, y] = floor.middle;
    let reach_m = match floor.area {
        [] => apart_m * (TRIES * count as f64).sqrt() / 2.0,
        area => {
            let corner = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y);
            area.iter().map(corner).fold(0.0, f64::max)
        }
    };
    // No area holds more than can be looked at.
    let reach_m = reach_m.min(apart_m * 200.0);
    let row_m = apart_m * 3.0_f64.sqrt() / 2.0;
    let rows = (reach_m / row_m).ceil() as i32;
    let columns = (reach_m / apart_m).ceil() as i32 + 1;
    let is_free = |p: &[f64; 2]| {
        (p[0] - x).hypot(p[1] - y) <= reach_m
            && (floor.area.is_empty() || polygon::holds(floor.area, *p))
            && floor.others.iter().all(|other| (p[0] - other[0]).hypot(p[1] - other[1]) >= apart_m)
            && floor.clearance.is_none_or(|free| free.at_least_m(p[0], p[1]) >= apart_m / 2.0)
    };
    let mut found: Vec<[f64; 2]> = (-rows..=rows)
        .flat_map(|row| (-columns..=columns).map(move |column| (row, column)))
        .map(|(row, column)| {
            let odd = f64::from(row.rem_euclid(2)) / 2.0;
            [x + apart_m * (f64::from(column) + odd), y + row_m * f64::from(row)]
        })
        .filter(is_free)
        .collect();
    let away = |p: &[f64; 2]| (p[0] - x).hypot(p[1] - y);
    found.sort_by(|a, b| away(a).total_cmp(&away(b)));
    found.truncate(count);
    found
}

/// The point of each robot, so that all ways together are shortest; as many points as robots. `None` = nobody knows
/// where that robot is.
pub(crate) fn assigned(robots: &[Option<[f64; 2]>], points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let way = |from: &Option<[f64; 2]>, to: &[f64; 2]| {
        from.map_or(0.0, |from| (from[0] - to[0]).hypot(from[1] - to[1]))
    };
    let cost: Vec<f32> =
        robots.iter().flat_map(|from| points.iter().map(move |to| way(from, to) as f32)).collect();
    let columns = exact::solve(&cost, robots.len(), points.len());
    columns.into_iter().flatten().map(|column| points[column]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_nav::{Cell, Grid};

    fn least_apart(points: &[[f64; 2]]) -> f64 {
        let pairs = points.iter().enumerate().flat_map(|(i, a)| points[..i].iter().map(move |b| (a, b)));
        pairs.map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(f64::INFINITY, f64::min)
    }

    #[test]
    fn the_first_stands_at_the_point_itself_and_the_others_side_by_side_around_it() {
        let floor = Floor { middle: [3.0, -2.0], area: &[], clearance: None, others: &[] };
        for count in [1, 2, 7, 24, 100] {
            let found = points(floor, count, 0.8);
            assert_eq!((found.len(), found[0]), (count, [3.0, -2.0]));
            assert!(least_apart(&found) > 0.8 - 1e-9, "{count}: {found:?}");
        }
        let ring = &points(floor, 7, 1.0)[1..];
        assert!(ring.iter().all(|p| ((p[0] - 3.0).hypot(p[1] + 2.0) - 1.0).abs() < 1e-9), "{ring:?}");
    }

    #[test]
    fn an_area_takes_as_many_as_there_is_room_for() {
        let area = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [0.0, 2.0]];
        let floor = Floor { middle: [2.0, 1.0], area: &area, clearance: None, others: &[[0.0, 1.0]] };
        let found = points(floor, 50, 1.0);
        assert!((8..15).contains(&found.len()), "{found:?}");
        assert!(found.iter().all(|p| polygon::holds(&area, *p)) && least_apart(&found) > 1.0 - 1e-9);
        assert!(found.iter().all(|p| p[0].hypot(p[1] - 1.0) >= 1.0), "another robot stands there: {found:?}");
    }

    #[test]
    fn nobody_is_sent_into_a_wall_or_off_the_map() {
        let mut grid = Grid::free(0.1, [0.0, 0.0], 60, 60).unwrap();
        for row in 0..60 {
            grid.set(30, row, Cell::Occupied);
        }
        let clearance = Clearance::of(&grid);
        let floor = Floor { middle: [3.0, 3.0], area: &[], clearance: Some(&clearance), others: &[] };
        let found = points(floor, 12, 1.0);
        assert!(found.len() >= 8, "{found:?}");
        for [x, y] in found {
            assert!(
                (x - 3.05).abs() > 0.5 && (0.45..=5.55).contains(&x) && (0.45..=5.55).contains(&y),
                "({x}, {y})"
            );
        }
    }

    #[test]
    fn ways_do_not_cross_and_who_is_unknown_takes_what_is_left() {
        let points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]];
        let robots = [Some([2.0, 5.0]), Some([0.0, 5.0]), None];
        assert_eq!(assigned(&robots, &points), [[2.0, 0.0], [0.0, 0.0], [1.0, 0.0]]);
    }
}
