//! The control loop: one thread, absolute deadlines, a turn every 5 ms.
//!
//! It owns the robot and its lines. It never waits for Zenoh or a disk; what crosses to them does so
//! through the bounded queues of [`mailbox`](crate::mailbox).

use crate::clock::Clock;
use crate::hardware::Hardware;
use crate::mailbox::{LineNote, LoopEnds, Snapshot, Waiting};
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use xtb_authority::Robot;
use xtb_authority::robot::TURN_NS;
use xtb_control::Stamp;
use xtb_protocol::gyro_3dmg::START_CONTINUOUS;

/// Requests answered in one turn at most, so that a flood cannot stretch it.
const REQUESTS_A_TURN: usize = 8;
/// State goes out at 20 Hz.
const SNAPSHOT_NS: u64 = 50_000_000;
/// A silent gyro is asked to start this often.
const GYRO_RESTART_NS: u64 = 500_000_000;
/// After this delay the missed turns are given up rather than made up for.
const GIVE_UP_NS: u64 = 100_000_000;
/// Bytes read from a line in one turn at most.
const READ_BUFFER: usize = 1024;

/// Starts the loop on a thread of its own. It runs until `stop`, then sends a neutral frame.
///
/// # Errors
/// The system cannot start a thread.
pub(crate) fn start(
    robot: Robot,
    hardware: Box<dyn Hardware>,
    clock: Clock,
    ends: LoopEnds,
    stop: Arc<AtomicBool>,
) -> io::Result<JoinHandle<()>> {
    let name = format!("control-{}", robot.agent().identity().robot);
    let control = ControlLoop { robot, hardware, ends, broken: [false; 4], gyro_asked: None };
    std::thread::Builder::new().name(name).spawn(move || control.run(&clock, &stop))
}

struct ControlLoop {
    robot: Robot,
    hardware: Box<dyn Hardware>,
    ends: LoopEnds,
    /// Which lines gave an error last time: each is logged once.
    broken: [bool; 4],
    gyro_asked: Option<Stamp>,
}

impl ControlLoop {
    fn run(mut self, clock: &Clock, stop: &AtomicBool) {
        let mut next = clock.now();
        let mut next_snapshot = next;
        while !stop.load(Ordering::Relaxed) {
            next = next.plus_ns(TURN_NS);
            clock.wait_until(next);
            let now = clock.now();
            if now.ns() > next.ns() + GIVE_UP_NS {
                next = now;
            }
            self.read_lines(now);
            self.take_orders(now);
            if let Some(frame) = self.robot.turn(now) {
                let written = self.hardware.write_board(frame.as_bytes());
                self.note(Line::ToBoard, written);
            }
            self.report(now, &mut next_snapshot);
        }
        let frame = self.robot.neutral_frame(clock.now());
        let written = self.hardware.write_board(frame.as_bytes());
        self.note(Line::ToBoard, written);
    }

    fn read_lines(&mut self, now: Stamp) {
        let mut buffer = [0; READ_BUFFER];
        match self.hardware.read_board(&mut buffer) {
            Ok(n) => {
                self.robot.board_bytes(now, &buffer[..n]);
                self.note(Line::FromBoard, Ok(()));
            }
            Err(error) => self.note(Line::FromBoard, Err(error)),
        }
        match self.hardware.read_gyro(&mut buffer) {
            Ok(n) => {
                self.robot.gyro_bytes(now, &buffer[..n]);
                self.note(Line::FromGyro, Ok(()));
            }
            Err(error) => self.note(Line::FromGyro, Err(error)),
        }
        let asked_lately = self.gyro_asked.is_some_and(|at| now.ns() < at.ns() + GYRO_RESTART_NS);
        if !asked_lately && self.robot.gyro_is_silent(now) {
            self.gyro_asked = Some(now);
            let written = self.hardware.write_gyro(&START_CONTINUOUS);
            self.note(Line::ToGyro, written);
        }
    }

    /// A stop first, then requests in their order, then the setpoint.
    fn take_orders(&mut self, now: Stamp) {
        let ends = &mut self.ends;
        self.robot.agent_mut().set_link(ends.link_up.load(Ordering::Relaxed));
        self.robot.agent_mut().stop(now, ends.arrivals.latest_stop());
        for _ in 0..REQUESTS_A_TURN {
            // Without room for its reply a request stays where it is: to drop its question here
            // could wait for Zenoh.
            let Ok(room) = ends.replies.try_reserve() else { break };
            let Ok(job) = ends.requests.try_recv() else { break };
            let reply = self.robot.request(now, job.arrival, &job.client, &job.request);
            room.send((job.answer, reply));
        }
        if let Some(Waiting { at, arrival, client, setpoint }) = ends.setpoint.take() {
            self.robot.agent_mut().setpoint(now, at, arrival, &client, &setpoint);
        }
    }

    /// The state, 20 times a second and before each event (who hears of a goal's end and asks for
    /// the state must not get an older one), and the events.
    fn report(&mut self, now: Stamp, next_snapshot: &mut Stamp) {
        if now >= *next_snapshot || self.robot.agent().has_events() {
            *next_snapshot = now.plus_ns(SNAPSHOT_NS);
            let state = self.robot.state(now, self.ends.counters.rejected_so_far());
            let sensors = self.robot.sensors(now);
            self.ends.snapshot.send_replace(Some(Snapshot { state, sensors }));
        }
        while let Some(event) = self.robot.agent_mut().next_event() {
            if self.ends.events.try_send(event).is_err() {
                self.ends.counters.events_dropped.fetch_add(1, Ordering::Relaxed);
            }
        }
    }

    /// Tells the log when a line breaks and when it works again.
    fn note(&mut self, line: Line, result: io::Result<()>) {
        let broken = std::mem::replace(&mut self.broken[line as usize], result.is_err());
        if broken != result.is_err() {
            let error = result.err().map(|error| error.to_string());
            // A full queue is no reason to wait: the state shows what matters.
            let _ = self.ends.notes.try_send(LineNote { line: line.name(), error });
        }
    }
}

#[derive(Clone, Copy)]
enum Line {
    FromBoard = 0,
    ToBoard = 1,
    FromGyro = 2,
    ToGyro = 3,
}

impl Line {
    fn name(self) -> &'static str {
        match self {
            Self::FromBoard => "line from the board",
            Self::ToBoard => "line to the board",
            Self::FromGyro => "line from the gyro",
            Self::ToGyro => "line to the gyro",
        }
    }
}
