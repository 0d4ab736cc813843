//! What `sim` says when it is ready.

use crate::context::Context;
use crate::text::task as task_text;
use schemars::JsonSchema;
use serde::Serialize;
use std::path::{Path, PathBuf};
use xtb_client::Result;
use xtb_protocol::Name;
use xtb_protocol::messages::{DispatchStatus, RosterEntry, Suspension};
use xtb_services::dispatch::Standing;
use xtb_simulator::Simulator;

/// The one line that says it is ready.
#[derive(Debug, Serialize, JsonSchema)]
pub(super) struct Ready<'a> {
    ready: bool,
    fleet: &'a Name,
    router: &'a str,
    robots: &'a [RosterEntry],
    /// Folder with a folder for each identity.
    #[serde(skip_serializing_if = "Option::is_none")]
    identities: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    ledger: Option<String>,
    /// What the dispatcher found in it.
    #[serde(skip_serializing_if = "Option::is_none")]
    dispatcher: Option<DispatchStatus>,
    #[serde(skip_serializing_if = "Option::is_none")]
    suspended: Option<Vec<Suspension>>,
    /// Where the ledger of before is kept.
    #[serde(skip_serializing_if = "Option::is_none")]
    set_aside: Option<String>,
}

/// A dispatcher beside the robots, and what it found in its ledger.
pub(super) struct Found<'a> {
    pub(super) identities: Option<&'a Path>,
    pub(super) ledger: Option<PathBuf>,
    pub(super) set_aside: Option<PathBuf>,
    pub(super) standing: Option<Standing>,
}

/// Says it: to people where each robot starts, to programs one line.
pub(super) fn announce(
    ctx: &Context,
    simulator: &Simulator,
    speed: f64,
    pty: Option<&Path>,
    found: &Found<'_>,
) -> Result<()> {
    let robots = &simulator.roster().robots;
    if speed > 1.0 {
        ctx.out.note(&format!(
            "at {speed} × real time, a robot's time limits for clients (200 ms, 500 ms …) pass {speed} × as \
             fast: clients run in real time"
        ));
    }
    for robot in robots {
        let Some(pose) = robot.start_pose else { continue };
        let pose = format!("{:.3},{:.3},{:.4}", pose.x_m, pose.y_m, pose.yaw_rad);
        let name = &robot.name;
        ctx.out.note(&match pty {
            None => format!("{name} starts at {pose} (x, y in m, yaw in rad)"),
            Some(folder) => format!(
                "robot-agent --hardware serial --name {name} --board {board} --gyro {gyro} \
                 --start-pose {pose} --connect {router}",
                board = folder.join(format!("{name}.board")).display(),
                gyro = folder.join(format!("{name}.gyro")).display(),
                router = simulator.endpoint(),
            ),
        });
    }
    let standing = found.standing.as_ref();
    let ready = Ready {
        ready: true,
        fleet: &ctx.settings.fleet,
        router: simulator.endpoint(),
        robots,
        identities: found.identities.map(|folder| folder.display().to_string()),
        ledger: found.ledger.as_ref().map(|path| path.display().to_string()),
        dispatcher: standing.map(|standing| standing.status.clone()),
        suspended: standing.map(|standing| standing.suspended.clone()),
        set_aside: found.set_aside.as_ref().map(|path| path.display().to_string()),
    };
    ctx.out.result(&ready, |ready| {
        let many = if robots.len() == 1 { "robot" } else { "robots" };
        let with = ready.ledger.as_ref().map_or_else(String::new, |file| {
            let found = standing.map(Standing::found).unwrap_or_default();
            format!(", dispatcher's ledger {file}: {found}")
        });
        format!("sim ready: {} {many} of fleet {}, router {}{with}", robots.len(), ready.fleet, ready.router)
    })?;
    if let (Some(folder), false) = (&ready.identities, ctx.out.json) {
        ctx.out.note(&format!("as an operator: fleet-cli list --identity {folder}/operator"));
    }
    if let (Some(standing), false) = (standing, ctx.out.json) {
        task_text::found(ctx, &standing.suspended, ready.set_aside.as_deref());
    }
    Ok(())
}
