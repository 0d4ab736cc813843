//! `enrol`: an identity file becomes this robot's identity.

use super::{Failure, print, print_json, tell};
use crate::cli::EnrolArgs;
use robot_agent::enrol;
use serde::Serialize;
use std::process::ExitCode;
use std::time::SystemTime;
use xtb_identity::{Identity, Role};
use xtb_protocol::Name;

#[derive(Serialize)]
struct Enrolled<'a> {
    name: &'a Name,
    fleet: &'a Name,
    role: Role,
    generation: u32,
    expires: String,
    routers: &'a [String],
    folder: String,
    warnings: &'a [String],
}

pub(crate) fn run(args: &EnrolArgs) -> Result<ExitCode, Failure> {
    let is_robot = |role| role == Role::Robot;
    let done = enrol::enrol(&args.file, args.to.as_deref(), args.force, SystemTime::now(), is_robot);
    let mut done = done.map_err(|refusal| {
        let code = if refusal.is_of_the_file() { 2 } else { 1 };
        Failure::new(&refusal, refusal.hint()).code(code)
    })?;
    let file = args.file.display();
    if args.remove {
        std::fs::remove_file(&args.file).map_err(|error| {
            let message = format!("enrolled, but cannot delete {file}: {error}");
            Failure::new(message, "delete it: it holds the private key")
        })?;
    } else {
        done.warnings.push(format!("{file} still holds the private key: delete it (--remove does)"));
    }
    let folder = done.enrolled.folder.display().to_string();
    if args.json {
        let Identity { name, fleet, role, generation, routers, .. } = &done.enrolled.identity;
        print_json(&Enrolled {
            name,
            fleet,
            role: *role,
            generation: *generation,
            expires: humantime::format_rfc3339_seconds(done.expires).to_string(),
            routers,
            folder,
            warnings: &done.warnings,
        })?;
        return Ok(ExitCode::SUCCESS);
    }
    let identity = args.to.as_ref().map_or_else(String::new, |_| format!(" --identity {folder}"));
    print(&format!("{}\nNext: `robot-agent --hardware serial{identity}`\n", done.text()))?;
    for warning in &done.warnings {
        tell(&format!("warning: {warning}\n"));
    }
    Ok(ExitCode::SUCCESS)
}
