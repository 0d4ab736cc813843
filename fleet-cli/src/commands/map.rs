//! `map`: the floor that the fleet plans on, one verb a file.

mod check;
mod import;
mod picture;
mod serve;
mod show;

use crate::cli::{MapArgs, MapVerb};
use crate::context::Context;
use crate::error::{Exit, Result};
use crate::interrupt::or_interrupted;
use xtb_nav::Map;

/// Carries out one of its verbs.
///
/// # Errors
/// See each verb.
pub async fn run(ctx: &Context, args: &MapArgs) -> Result<Exit> {
    match &args.verb {
        MapVerb::Show(args) => or_interrupted(show::run(ctx, args)).await,
        MapVerb::Check(args) => check::run(ctx, args),
        MapVerb::Import(args) => import::run(ctx, args),
        MapVerb::Serve(args) => serve::run(ctx, args).await,
    }
}

/// Width and depth, in m.
fn size_m(map: &Map) -> [f64; 2] {
    [map.grid().width(), map.grid().height()].map(|cells| rounded(cells as f64 * map.grid().resolution_m()))
}

/// To the sixth decimal: 56.12 instead of 56.120000000000005.
fn rounded(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}

/// In m: `12.20 × 14.20 m, cells of 5 cm`.
fn size(map: &Map) -> String {
    let [width_m, depth_m] = size_m(map);
    format!("{width_m:.2} × {depth_m:.2} m, cells of {}", centimetres(map.grid().resolution_m()))
}

fn centimetres(metres: f64) -> String {
    let text = format!("{:.1}", metres * 100.0);
    format!("{} cm", text.trim_end_matches(".0"))
}
