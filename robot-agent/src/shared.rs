//! What the agents of one program share, so that many fit into it.

use crate::loop_pool::LoopPool;
use crate::map_reader::MapShelf;
use crate::planner_worker::{PlannerWorker, Planners};
use std::io;
use std::sync::Arc;
use xtb_protocol::Name;

/// What they share. A robot's own agent has one for itself.
#[derive(Debug, Clone, Default)]
pub struct Shared {
    /// Maps that are prepared already: a large one takes megabytes.
    pub(crate) maps: Arc<MapShelf>,
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

    pub(crate) fn loops(&self) -> Option<&LoopPool> {
        self.threads.as_ref().map(|(loops, _)| loops)
    }

    /// Who plans for this robot.
    ///
    /// # Errors
    /// The system cannot start its thread.
    pub(crate) fn planner_worker(&self, robot: &Name) -> io::Result<PlannerWorker> {
        match &self.threads {
            Some((_, planners)) => Ok(planners.worker()),
            None => Ok(Planners::start(1, robot.as_str())?.worker()),
        }
    }
}
