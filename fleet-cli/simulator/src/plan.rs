//! What to simulate, and what follows from it: the world with its trucks, and the session.

use std::path::PathBuf;
use std::time::Duration;
use xtb_bus::{Bus, LINK_LEASE, Role};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::VehicleConfig;
use xtb_control::frames::MapPose;
use xtb_protocol::Name;
use xtb_services::router;
use xtb_sim::fixes::FixTruth;
use xtb_sim::{Simulation, TruckParameters, World};

/// More robots than this do not fit one process at real time.
pub const MAX_ROBOTS: usize = 500;
/// Router and agents in one overloaded process are late with their keep-alives; where one of them dies, all do,
/// and whoever is connected sees that at once. (Zenoh's own default.)
const OWN_LINK_LEASE: Duration = Duration::from_secs(10);

/// What to simulate.
#[derive(Debug, Clone)]
pub struct Plan {
    /// The fleet's name.
    pub fleet: Name,
    /// How many robots: `xtb-1` … `xtb-N`.
    pub robots: usize,
    /// The room; `None` = an empty one, large enough.
    pub world: Option<World>,
    /// What the robots are, in their order; those beyond are XTBs.
    pub vehicles: Vec<VehicleConfig>,
    /// Where the robots start; empty = the world's own choice.
    pub starts: Vec<MapPose>,
    /// Seed of every random number.
    pub seed: u64,
    /// Times real time.
    pub speed: f64,
    /// Its own router here, unless `connect` names others.
    pub listen: String,
    /// Routers to use instead of an own one.
    pub connect: Vec<String>,
    /// No agents, but two ptys a truck in this folder.
    pub pty: Option<PathBuf>,
    /// Where to write the truth at every step.
    pub truth_log: Option<PathBuf>,
    /// What measures the robots' poses.
    pub fixes: FixTruth,
    /// Folder where every agent records its steps.
    pub record: Option<PathBuf>,
}

impl Plan {
    /// Whether that can be.
    pub(super) fn check(&self) -> Result<()> {
        if self.robots == 0 || self.robots > MAX_ROBOTS {
            let message = format!("{} robots cannot be simulated", self.robots);
            return Err(
                Error::new(ErrorKind::Invalid, message).hint(format!("--robots must be 1 to {MAX_ROBOTS}"))
            );
        }
        if !(self.speed.is_finite() && (0.01..=1000.0).contains(&self.speed)) {
            let message = format!("the simulation cannot run at {} × real time", self.speed);
            return Err(Error::new(ErrorKind::Invalid, message).hint("--speed must be 0.01 to 1000"));
        }
        Ok(())
    }

    /// Its world, with a truck of each of these kinds.
    pub(super) fn simulation(&self, kinds: &[TruckParameters], world: World) -> Result<Simulation> {
        let names: Vec<String> = (1..=self.robots).map(|n| format!("xtb-{n}")).collect();
        let made = if self.starts.is_empty() {
            Simulation::of_kinds(world, kinds, &names, self.seed)
        } else {
            let starts: Vec<_> = names.iter().map(String::as_str).zip(self.starts.iter().copied()).collect();
            Simulation::of_kinds_at(world, &kinds[..starts.len()], &starts, self.seed)
        };
        made.map_err(|error| {
            Error::new(ErrorKind::Config, error.to_string())
                .hint("use fewer --robots, or a world with more room")
        })
    }

    /// Real agents, on ptys, and routers elsewhere notice a lost link as ever.
    pub(super) fn link_lease(&self) -> Duration {
        let alone = self.connect.is_empty() && self.pty.is_none();
        if alone { OWN_LINK_LEASE } else { LINK_LEASE }
    }

    /// The simulator's own session, where it can be reached, and where its agents connect.
    pub(super) async fn session(&self) -> Result<(Bus, String, Vec<String>)> {
        if self.connect.is_empty() {
            let (bus, endpoint) = router::open_leased(&self.listen, self.link_lease()).await?;
            return Ok((bus, endpoint.clone(), vec![endpoint]));
        }
        let bus = xtb_bus::open(&Role::Client { connect: self.connect.clone() }).await?;
        Ok((bus, self.connect.join(", "), self.connect.clone()))
    }
}
