//! Maps for the properties.

use proptest::prelude::*;
use xtb_nav::{Cell, Grid, Map, Zone, ZoneKind};

pub(crate) fn cell() -> impl Strategy<Value = Cell> {
    prop_oneof![Just(Cell::Free), Just(Cell::Occupied), Just(Cell::Unknown)]
}

pub(crate) fn grid() -> impl Strategy<Value = Grid> {
    let sizes = (1_usize..40, 1_usize..40, 0.005..1.0_f64, -1000.0..1000.0_f64, -1000.0..1000.0_f64);
    sizes.prop_flat_map(|(width, height, resolution_m, x_m, y_m)| {
        prop::collection::vec(cell(), width * height)
            .prop_map(move |cells| Grid::new(resolution_m, [x_m, y_m], width, height, cells).unwrap())
    })
}

/// A star around a point: simple by construction.
pub(crate) fn star() -> impl Strategy<Value = Vec<[f64; 2]>> {
    let radii = prop::collection::vec(0.1..4.0_f64, 3..12);
    (-5.0..5.0_f64, -5.0..5.0_f64, radii, 0.0..0.5_f64).prop_map(|(x_m, y_m, radii, turned)| {
        let corner = |(i, radius): (usize, &f64)| {
            let angle = (i as f64 + turned) / radii.len() as f64 * std::f64::consts::TAU;
            [x_m + radius * angle.cos(), y_m + radius * angle.sin()]
        };
        radii.iter().enumerate().map(corner).collect()
    })
}

pub(crate) fn zones() -> impl Strategy<Value = Vec<Zone>> {
    let kind = prop_oneof![
        Just(ZoneKind::KeepOut),
        (-7.0..7.0_f64).prop_map(|heading_rad| ZoneKind::OneWay { heading_rad })
    ];
    let name = prop_oneof!["[a-z]{1,8}", "[0-9]{1,3}", "[a-z:#'\" -]{1,6}[a-z]", "(true|null|~|é→x)"];
    prop::collection::vec((name, kind, star()), 0..4).prop_map(|zones| {
        let zone = |(i, (name, kind, points)): (usize, (String, ZoneKind, Vec<[f64; 2]>))| {
            let name = if i == 0 { name.trim().to_owned() } else { format!("{} {i}", name.trim()) };
            Zone::new(&name, kind, points).unwrap()
        };
        zones.into_iter().enumerate().map(zone).collect()
    })
}

pub(crate) fn map() -> impl Strategy<Value = Map> {
    (prop_oneof!["[a-z][a-z0-9 -]{0,8}[a-z]", "[0-9]{1,3}"], grid(), zones())
        .prop_map(|(name, grid, zones)| Map::new(&name, grid, zones).unwrap())
}
