//! `enrol`: an identity file becomes this robot's identity.

use super::{Failure, print, print_json, tell};
use crate::cli::EnrolArgs;
use robot_agent::enrol::{self, EnrolRefusal};
use std::process::ExitCode;
use std::time::SystemTime;
use xtb_identity::Role;

pub(crate) fn run(args: &EnrolArgs) -> Result<ExitCode, Failure> {
    let failed = |refusal: EnrolRefusal| {
        let code = if refusal.is_of_the_file() { 2 } else { 1 };
        Failure::new(&refusal, refusal.hint()).code(code)
    };
    let is_robot = |role| role == Role::Robot;
    let done = enrol::enrol(&args.file, args.to.as_deref(), args.force, SystemTime::now(), is_robot);
    let mut done = done.map_err(failed)?;
    done.settle(&args.file, args.remove).map_err(failed)?;
    if args.json {
        print_json(&done.report())?;
        return Ok(ExitCode::SUCCESS);
    }
    let folder = done.enrolled.folder.display();
    let identity = args.to.as_ref().map_or_else(String::new, |_| format!(" --identity {folder}"));
    print(&format!("{}\nNext: `robot-agent --hardware serial{identity}`\n", done.text()))?;
    for warning in &done.warnings {
        tell(&format!("warning: {warning}\n"));
    }
    Ok(ExitCode::SUCCESS)
}
