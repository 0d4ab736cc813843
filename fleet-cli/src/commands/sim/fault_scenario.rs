//! `sim --virtual`: a fault scenario of a virtual fleet, from its seed.

use crate::context::Context;
use crate::exit::Exit;
use schemars::JsonSchema;
use serde::Serialize;
use xtb_client::{Error, ErrorKind, Result};

/// A scenario as its seed has it.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Scenario {
    seed: u64,
    robots: usize,
    lasted_ms: u64,
    /// Over every decision of every robot: the same on every machine.
    history: String,
    broken: Option<String>,
}

/// Tells the scenario of this seed; exit code 1 if a rule was broken in it.
pub(super) fn tell(ctx: &Context, seed: u64) -> Result<Exit> {
    let mut printed = Ok(());
    let line = |text: &str| {
        if !ctx.out.json && printed.is_ok() {
            printed = ctx.out.text(text);
        }
    };
    let day = xtb_chaos::tell(seed, xtb_chaos::ScenarioOptions::default(), line)
        .map_err(|error| Error::new(ErrorKind::Failed, error.to_string()))?;
    printed?;
    let broken =
        day.violation.as_ref().map(|violation| format!("{}: {}", violation.invariant, violation.detail));
    let exit = if broken.is_some() { Exit::Failed } else { Exit::Done };
    let short = Scenario {
        seed,
        robots: day.robots,
        lasted_ms: day.lasted_ms,
        history: format!("{:016x}", day.hash),
        broken,
    };
    ctx.out.result(&short, |_| day.to_string())?;
    Ok(exit)
}
