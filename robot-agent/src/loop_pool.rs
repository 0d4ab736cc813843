//! Control loops of simulated robots, many on a thread: a step of their world is a turn of each. With a thread for
//! each robot the system would wake hundreds of threads two hundred times a second.
//!
//! A robot on real lines keeps a thread of its own.

use crate::control_loop::ControlLoop;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;
use std::thread::JoinHandle;

/// Threads for control loops. They end when this and all its loops are gone.
#[derive(Debug, Clone)]
pub(crate) struct LoopPool {
    /// To each thread, one entry a robot.
    inlets: Arc<[mpsc::Sender<Seat>]>,
    seated: Arc<AtomicUsize>,
}

impl LoopPool {
    /// Starts so many threads, at least one.
    ///
    /// # Errors
    /// The system cannot.
    pub(crate) fn start(threads: usize) -> io::Result<Self> {
        let start = |number: usize| -> io::Result<mpsc::Sender<Seat>> {
            let (inlet, newcomers) = mpsc::channel();
            let name = format!("control-{number}");
            std::thread::Builder::new().name(name).spawn(move || work(&newcomers))?;
            Ok(inlet)
        };
        let inlets = (0..threads.max(1)).map(start).collect::<io::Result<Vec<_>>>()?;
        Ok(Self { inlets: inlets.into(), seated: Arc::default() })
    }

    /// Runs a loop on one of the threads, all of which get as many. What is returned hears true once when the loop
    /// has ended, false if it panicked.
    pub(crate) fn run(&self, mut control: ControlLoop) -> mpsc::Receiver<bool> {
        let (told, ended) = mpsc::channel();
        // Here: its thread may wait for the world, which would wait for this loop.
        control.begin();
        let seat = Seat { control, end: End { told, well: false } };
        let number = self.seated.fetch_add(1, Ordering::Relaxed) % self.inlets.len();
        // The thread lives as long as this.
        let _ = self.inlets[number].send(seat);
        ended
    }
}

/// A loop that was started.
pub(crate) enum Running {
    /// On a thread of its own.
    Thread(JoinHandle<()>),
    /// Among others.
    Pooled(mpsc::Receiver<bool>),
}

impl Running {
    /// Waits until it has ended and is gone.
    ///
    /// # Errors
    /// It panicked.
    pub(crate) fn join(self) -> std::thread::Result<()> {
        match self {
            Self::Thread(thread) => thread.join(),
            Self::Pooled(ended) if ended.recv() == Ok(true) => Ok(()),
            Self::Pooled(_) => Err(Box::new("a control loop panicked")),
        }
    }
}

/// A loop on its thread. Its parts are dropped in this order: who hears of the end finds the loop gone.
struct Seat {
    control: ControlLoop,
    end: End,
}

/// Tells how a loop has ended.
struct End {
    told: mpsc::Sender<bool>,
    well: bool,
}

impl Drop for End {
    fn drop(&mut self) {
        // Nobody has to wait for it.
        let _ = self.told.send(self.well);
    }
}

impl Seat {
    /// One turn; false = the loop has ended. A panic is this robot's alone.
    fn turn(&mut self) -> bool {
        let went = catch_unwind(AssertUnwindSafe(|| self.control.turn()));
        self.end.well = went.is_ok();
        went.unwrap_or(false)
    }
}

fn work(newcomers: &mpsc::Receiver<Seat>) {
    let mut seats: Vec<Seat> = Vec::new();
    loop {
        if seats.is_empty() {
            let Ok(first) = newcomers.recv() else { return };
            seats.push(first);
        }
        seats.extend(newcomers.try_iter());
        // Those that are behind first: the others would wait for a step that waits for these.
        let behind = seats.iter().map(|seat| seat.control.next_turn()).min();
        seats.retain_mut(|seat| Some(seat.control.next_turn()) > behind || seat.turn());
    }
}

#[cfg(test)]
#[cfg(feature = "sim")]
mod tests {
    use crate::clock::WorldTime;
    use crate::hardware::Hardware;
    use crate::hardware::simulated::SimulatedHardware;
    use crate::mailbox::mailbox;
    use crate::realtime::Realtime;
    use crate::shared::SharedResources;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::time::Duration;
    use xtb_control::frames::MapPose;
    use xtb_control::{Stamp, VehicleConfig};
    use xtb_protocol::Name;
    use xtb_robot::{Robot, RobotIdentity};

    /// A machine that is busy with other tests is slow, not stuck.
    const PATIENCE: Duration = Duration::from_secs(20);

    fn robot(number: usize) -> Robot {
        let name = |text: &str| Name::new(text).unwrap();
        let identity = RobotIdentity {
            fleet: name("lab"),
            robot: name(&format!("xtb-{number}")),
            epoch: 1,
            start_pose: MapPose::default(),
        };
        Robot::new(identity, VehicleConfig::default(), "test")
    }

    #[test]
    fn fifty_loops_on_two_threads_take_a_turn_for_each_step_of_their_world_from_their_start_on() {
        let (world, shared) = (WorldTime::new(), SharedResources::among(2, 1).unwrap());
        let stop = Arc::new(AtomicBool::new(false));
        let (mut sessions, mut running, mut lines) = (Vec::new(), Vec::new(), Vec::new());
        for number in 1..=50 {
            let (loop_ends, session_ends, notes) = mailbox();
            let (hardware, theirs) = SimulatedHardware::connect();
            let hardware: Box<dyn Hardware> = Box::new(hardware);
            lines.push(theirs);
            sessions.push((session_ends, notes));
            let parts = (robot(number), hardware, world.join());
            let (started, realtime) = shared.start_loop(parts, loop_ends, None, stop.clone(), true).unwrap();
            assert!(matches!(realtime, Realtime::Off), "{realtime:?}: such a thread is not one robot's");
            running.push(started);
            // It comes while the threads wait with the loops that they have.
            assert!(
                world.advance_within(Stamp::from_ms(5 * number as u64), PATIENCE),
                "robot {number} was not waited for"
            );
        }
        for step in 51..=100 {
            assert!(
                world.advance_within(Stamp::from_ms(5 * step), PATIENCE),
                "step {step} was not waited for"
            );
        }
        for (session, _) in &sessions {
            let snapshot = session.snapshot.borrow().clone().unwrap();
            // The last one within 50 ms, and its turn is over.
            assert!(snapshot.state.tick_ms > 440, "{} ms", snapshot.state.tick_ms);
        }
        stop.store(true, Ordering::Relaxed);
        world.end();
        for running in running {
            assert!(running.join().is_ok());
        }
    }
}
