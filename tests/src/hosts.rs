//! Computers of a test: network namespaces, each with an address, and a cable (a pair of virtual Ethernet devices)
//! to each of the others. Nothing outside them can be reached.
//!
//! A namespace lasts as long as the process that holds it, so nothing stays behind, however a test ends. Making
//! one takes rights that not every machine gives.

use crate::processes::Process;
use std::path::Path;
use std::process::{Command, Stdio};

/// Says that it is in its namespace, and holds it for longer than any test takes.
const HOLD: &str = "ip link set lo up && echo ready && exec sleep 3600";

/// One computer.
pub struct Host {
    holder: Process,
    number: usize,
}

/// So many, or why this machine has none.
///
/// # Errors
/// What is missing, or was refused.
pub fn hosts(count: usize) -> Result<Vec<Host>, String> {
    run(Command::new("unshare").args(["--net", "ip", "link", "set", "lo", "up"]))?;
    let hosts = (1..=count).map(Host::start).collect::<Result<Vec<Host>, String>>()?;
    for (index, host) in hosts.iter().enumerate() {
        for other in &hosts[..index] {
            host.connect(other)?;
        }
    }
    Ok(hosts)
}

impl Host {
    fn start(number: usize) -> Result<Self, String> {
        let mut command = Command::new("unshare");
        let (holder, line) = Process::start_ready(command.args(["--net", "sh", "-c", HOLD]));
        if line.trim() == "ready" { Ok(Self { holder, number }) } else { Err("no network namespace".into()) }
    }

    /// Where the others reach it; one of the addresses for documentation, which no network has.
    #[must_use]
    pub fn address(&self) -> String {
        format!("192.0.2.{}", self.number)
    }

    /// A program that runs on it.
    #[must_use]
    pub fn command(&self, program: &Path) -> Command {
        let mut command = Command::new("nsenter");
        command.arg(format!("--net=/proc/{}/ns/net", self.holder.0.id())).arg(program);
        command
    }

    fn connect(&self, other: &Self) -> Result<(), String> {
        let (here, there) = (format!("to-{}", other.number), format!("to-{}", self.number));
        let namespace = other.holder.0.id().to_string();
        self.ip(&["link", "add", &here, "type", "veth", "peer", "name", &there, "netns", &namespace])?;
        for (host, peer, device) in [(self, other, &here), (other, self, &there)] {
            host.ip(&["address", "add", &host.address(), "peer", &peer.address(), "dev", device])?;
            host.ip(&["link", "set", device, "up"])?;
        }
        Ok(())
    }

    /// Plugs the cable to another one in, or pulls it out.
    ///
    /// # Panics
    /// If there is none.
    pub fn plug(&self, other: &Self, is_in: bool) {
        let done =
            self.ip(&["link", "set", &format!("to-{}", other.number), if is_in { "up" } else { "down" }]);
        done.unwrap_or_else(|error| panic!("{error}"));
    }

    fn ip(&self, arguments: &[&str]) -> Result<(), String> {
        run(self.command(Path::new("ip")).args(arguments))
    }
}

/// Runs a command to its end.
fn run(command: &mut Command) -> Result<(), String> {
    let output = command.stdin(Stdio::null()).output().map_err(|error| format!("{command:?}: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr);
    if output.status.success() { Ok(()) } else { Err(format!("{command:?}: {}", said.trim())) }
}
