//! What the agents of one program share, so that many fit into it.

use crate::clock::Clock;
use crate::control_loop::ControlLoop;
use crate::hardware::Hardware;
use crate::loop_pool::{LoopPool, Running};
use crate::mailbox::LoopEnds;
use crate::map_reader::MapShelf;
use crate::planner_worker::{PlannerWorker, Planners};
use crate::recorder::Recorder;
use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use tokio::sync::{Semaphore, SemaphorePermit};
use xtb_protocol::Name;
use xtb_robot::Robot;

/// So many sessions are being opened at once: of a thousand each would take longer than Zenoh waits for an answer.
const OPENED_AT_ONCE: usize = 16;

/// Room for sessions that are being opened.
#[derive(Debug, Clone)]
pub(crate) struct Opening(Arc<Semaphore>);

impl Default for Opening {
    fn default() -> Self {
        Self(Arc::new(Semaphore::new(OPENED_AT_ONCE)))
    }
}

impl Opening {
    /// Waits for room, which is taken until what is returned is dropped.
    pub(crate) async fn room(&self) -> Option<SemaphorePermit<'_>> {
        self.0.acquire().await.ok() // nobody closes it
    }
}

/// What they share. A robot's own agent has one for itself.
#[derive(Debug, Clone, Default)]
pub struct Shared {
    /// Maps that are prepared already: a large one takes megabytes.
    pub(crate) maps: Arc<MapShelf>,
    pub(crate) opening: Opening,
    /// Threads for all; `None` = each robot has its own.
    threads: Option<(LoopPool, Planners)>,
}

impl Shared {
    /// With so many threads for the control loops of simulated robots, and as many for their planners.
    ///
    /// # Errors
    /// The system cannot start them.
    pub fn with_threads(threads: usize) -> io::Result<Self> {
        let threads = Some((LoopPool::start(threads)?, Planners::start(threads, "shared")?));
        Ok(Self { threads, ..Self::default() })
    }

    /// Starts the control loop of a robot on its hardware. It runs until `stop`, then sends a neutral frame.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub(crate) fn start_loop(
        &self,
        parts: (Robot, Box<dyn Hardware>, Clock),
        ends: LoopEnds,
        recorder: Option<Recorder>,
        stop: Arc<AtomicBool>,
    ) -> io::Result<Running> {
        let name = parts.0.agent().identity().robot.clone();
        let control = ControlLoop::new(parts, ends, recorder, stop, self.planner_worker(&name)?);
        if let Some((loops, _)) = &self.threads {
            return Ok(Running::Pooled(loops.run(control)));
        }
        let thread = std::thread::Builder::new().name(format!("control-{name}"));
        Ok(Running::Thread(thread.spawn(move || control.run())?))
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
