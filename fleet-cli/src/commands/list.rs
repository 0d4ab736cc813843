//! `list`: which robots are there, which are missing, and how they are.

use crate::cli::ListArgs;
use crate::client::Client;
use crate::context::Context;
use crate::describe::{self, UNKNOWN};
use crate::error::{Exit, Result};
use crate::output::{Output, Tone};
use crate::table::{Cell, Table};
use crate::view::{FleetView, RobotView};
use crate::words;
use std::time::Duration;

const HEADINGS: [&str; 8] = ["name", "mode", "pose", "speed", "battery", "lease", "goal", "age"];

/// Asks once and prints a row for each robot. A robot that should be there and is not makes it
/// [`Exit::Unknown`].
///
/// # Errors
/// No router, or nobody is there and nobody is expected.
pub async fn run(ctx: &Context, args: &ListArgs) -> Result<Exit> {
    let client = Client::open(ctx).await?;
    let expected = client.roster(&args.expect).await?.unwrap_or_default();
    let view = FleetView::ask(&client, &ctx.fleet, &expected).await?;
    if view.robots.is_empty() {
        return Err(client.nobody());
    }
    ctx.out.result(&view, |view| table(view, &ctx.out))?;
    if !view.robots.iter().any(|robot| robot.alive) && !ctx.out.json {
        ctx.out.failure(&client.nobody());
    }
    client.close().await;
    let complete = view.robots.iter().all(|robot| robot.alive);
    Ok(if complete { Exit::Done } else { Exit::Unknown })
}

fn table(view: &FleetView, out: &Output) -> String {
    let mut table = Table::new(&HEADINGS);
    for robot in &view.robots {
        table.row(row(robot));
    }
    table.render(out)
}

fn row(robot: &RobotView) -> Vec<Cell> {
    let name = Cell::new(robot.name.as_str(), Tone::Strong);
    let age = robot.age_ms.map_or_else(|| UNKNOWN.to_owned(), |ms| describe::age(Duration::from_millis(ms)));
    match &robot.state {
        _ if !robot.alive => vec![name, Cell::new("missing", Tone::Bad)],
        None => {
            let mut cells = vec![name];
            cells.resize(HEADINGS.len() - 1, Cell::new(UNKNOWN, Tone::Warning));
            cells.push(Cell::new(age, Tone::Bad));
            cells
        }
        Some(state) => vec![
            name,
            words::name(&state.mode).into(),
            describe::pose(&state.pose).into(),
            describe::speed(state).into(),
            describe::battery(state).into(),
            describe::lease(state).into(),
            state.goal.as_ref().map_or_else(|| "none".to_owned(), describe::goal).into(),
            Cell::new(age, Tone::Dim),
        ],
    }
}
