//! What the agents of one program share, so that many fit into it.

use crate::clock::Clock;
use crate::control_loop::ControlLoop;
use crate::hardware::Hardware;
use crate::loop_pool::{LoopPool, Running};
use crate::mailbox::LoopEnds;
use crate::map_reader::MapCache;
use crate::planner_worker::{PlannerWorker, Planners};
use crate::realtime::{self, Realtime};
use crate::recorder::Recorder;
use crate::sessions::Sessions;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tokio::sync::Semaphore;
use xtb_protocol::Name;
use xtb_robot::Robot;

/// With more at once, hundreds of robots on a slow computer ask and declare so much that none of them gets on.
const STARTING: usize = 8;

/// What they share. A robot's own agent has one for itself.
#[derive(Debug, Clone)]
pub struct SharedResources {
    /// Maps that are prepared already: a large one takes megabytes.
    pub(crate) maps: Arc<MapCache>,
    pub(crate) sessions: Sessions,
    /// Robots that may look for their names and declare themselves at the same time: each hears of all others' keys.
    pub(crate) starting: Arc<Semaphore>,
    /// Threads for all; `None` = each robot has its own.
    threads: Option<(LoopPool, Planners)>,
}

impl Default for SharedResources {
    fn default() -> Self {
        Self {
            maps: Arc::default(),
            sessions: Sessions::of(1),
            starting: Arc::new(Semaphore::new(STARTING)),
            threads: None,
        }
    }
}

impl SharedResources {
    /// With so many threads for the control loops of simulated robots, as many for their planners, and a session for
    /// so many robots each.
    ///
    /// # Errors
    /// The system cannot start them.
    pub fn among(threads: usize, robots_a_session: usize) -> io::Result<Self> {
        let threads = Some((LoopPool::start(threads)?, Planners::start(threads, "shared")?));
        Ok(Self { threads, sessions: Sessions::of(robots_a_session), ..Self::default() })
    }

    /// Starts the control loop of a robot on its hardware. It runs until `stop`, then sends a neutral frame. On
    /// a thread of its own it is prioritized if that is `wanted`; the second value says what became of that.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(crate) fn start_loop(
        &self,
        parts: (Robot, Box<dyn Hardware>, Clock),
        ends: LoopEnds,
        recorder: Option<Recorder>,
        stop: Arc<AtomicBool>,
        wanted: bool,
    ) -> io::Result<(Running, Realtime)> {
        let name = parts.0.agent().identity().robot.clone();
        let control = ControlLoop::new(parts, ends, recorder, stop, self.planner_worker(&name)?);
        if let Some((loops, _)) = &self.threads {
            return Ok((Running::Pooled(loops.run(control)), Realtime::Off));
        }
        let thread = std::thread::Builder::new().name(format!("control-{name}"));
        let (thread, realtime) = realtime::spawn(thread, wanted, move || control.run())?;
        Ok((Running::Thread(thread), realtime))
    }

    /// Who plans for this robot.
    ///
    /// # Errors
    /// The system cannot start its thread.
    fn planner_worker(&self, robot: &Name) -> io::Result<PlannerWorker> {
        match &self.threads {
            Some((_, planners)) => Ok(planners.worker()),
            None => Ok(Planners::start(1, robot.as_str())?.worker()),
        }
    }
}
