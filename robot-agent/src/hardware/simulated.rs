//! A simulated truck behind in-memory lines, and the thread that turns its world.
//!
//! The agent cannot tell it from a real one: the same frames come through the same decoders. The
//! world runs on its own clock, [`WorldTime`], at real time or any multiple of it; a busy machine
//! slows it down instead of making robots miss samples.

mod pty;

pub use pty::TruckPorts;

use super::Hardware;
use super::instruments::Instruments;
use crate::clock::{Clock, WorldTime};
use std::collections::VecDeque;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use thiserror::Error;
use xtb_control::VehicleConfig;
use xtb_sim::{STEP_NS, Simulation, SimulationError, TruckParameters, World};

/// Bytes that a line holds; when nobody reads, the oldest go.
const LINE_CAPACITY: usize = 4096;
/// A world that is this far behind real time does not try to catch up.
const GIVE_UP: Duration = Duration::from_millis(250);

/// The world's end of a line to a truck: an in-memory pipe, or a pty ([`TruckLines::over_ptys`]).
pub trait TruckLine: Send {
    /// Bytes from the agent, appended to `into`.
    fn receive(&mut self, into: &mut Vec<u8>);
    /// Bytes from the truck.
    fn send(&mut self, bytes: &[u8]);
}

type Queue = Arc<Mutex<VecDeque<u8>>>;

/// One end of an in-memory line.
#[derive(Debug, Clone)]
pub struct PipeEnd {
    incoming: Queue,
    outgoing: Queue,
}

/// Both ends of an in-memory line.
#[must_use]
pub fn pipe() -> (PipeEnd, PipeEnd) {
    let (a, b) = (Queue::default(), Queue::default());
    (PipeEnd { incoming: a.clone(), outgoing: b.clone() }, PipeEnd { incoming: b, outgoing: a })
}

impl PipeEnd {
    fn read(&self, buffer: &mut [u8]) -> usize {
        let mut queue = self.incoming.lock().unwrap_or_else(PoisonError::into_inner);
        let n = buffer.len().min(queue.len());
        for (slot, byte) in buffer.iter_mut().zip(queue.drain(..n)) {
            *slot = byte;
        }
        n
    }

    fn write(&self, bytes: &[u8]) {
        let mut queue = self.outgoing.lock().unwrap_or_else(PoisonError::into_inner);
        queue.extend(bytes);
        let excess = queue.len().saturating_sub(LINE_CAPACITY);
        queue.drain(..excess);
    }
}

impl TruckLine for PipeEnd {
    fn receive(&mut self, into: &mut Vec<u8>) {
        into.extend(self.incoming.lock().unwrap_or_else(PoisonError::into_inner).drain(..));
    }

    fn send(&mut self, bytes: &[u8]) {
        self.write(bytes);
    }
}

/// The agent's ends of a simulated truck's lines.
#[derive(Debug)]
pub struct SimulatedHardware {
    board: PipeEnd,
    gyro: PipeEnd,
}

/// The world's ends of a truck's two lines.
pub struct TruckLines {
    /// To its I/O board.
    pub board: Box<dyn TruckLine>,
    /// To its gyro.
    pub gyro: Box<dyn TruckLine>,
}

impl SimulatedHardware {
    /// A truck's lines: the agent's ends and the world's.
    #[must_use]
    pub fn connect() -> (Self, TruckLines) {
        let (board, truck_board) = pipe();
        let (gyro, truck_gyro) = pipe();
        (Self { board, gyro }, TruckLines { board: Box::new(truck_board), gyro: Box::new(truck_gyro) })
    }
}

impl Hardware for SimulatedHardware {
    fn kind(&self) -> &'static str {
        "simulated"
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        Ok(self.board.read(buffer))
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        Ok(self.gyro.read(buffer))
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.board.write(bytes);
        Ok(())
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.gyro.write(bytes);
        Ok(())
    }
}

type Order = Box<dyn FnOnce(&mut Simulation, &mut Vec<TruckLines>) + Send>;
type Orders = Arc<Mutex<Vec<Order>>>;

/// Changes a running world from any thread.
#[derive(Clone)]
pub struct WorldOrders(Orders);

impl WorldOrders {
    /// Changes the world between two steps.
    pub fn change(&self, order: impl FnOnce(&mut Simulation) + Send + 'static) {
        self.push(Box::new(move |simulation, _| order(simulation)));
    }

    /// The instruments that a person holds to the truck with this index.
    #[must_use]
    pub fn instruments(&self, index: usize) -> Instruments {
        let orders = self.clone();
        Instruments::new(move || {
            let (answer, answered) = sync_channel(1);
            orders.change(move |simulation| {
                if let Some(truck) = simulation.trucks_mut().get_mut(index) {
                    // Nobody may wait any more.
                    let _ = answer.try_send(truck.measured());
                }
            });
            answered
        })
    }

    fn push(&self, order: Order) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(order);
    }
}

/// A world that runs on a thread of its own until this is dropped.
pub struct RunningWorld {
    time: Arc<WorldTime>,
    orders: Orders,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl RunningWorld {
    /// Starts `simulation` at `speed` × real time. `lines` belong to its trucks, in order;
    /// `each_step` sees every step.
    ///
    /// # Errors
    /// The system cannot start a thread.
    pub fn start(
        simulation: Simulation,
        lines: Vec<TruckLines>,
        time: Arc<WorldTime>,
        speed: f64,
        each_step: impl FnMut(&Simulation) + Send + 'static,
    ) -> io::Result<Self> {
        let (orders, stop) = (Orders::default(), Arc::new(AtomicBool::new(false)));
        let world = WorldThread { simulation, lines, orders: orders.clone(), time: time.clone() };
        let (flag, step) = (stop.clone(), Duration::from_nanos((STEP_NS as f64 / speed) as u64));
        let thread = std::thread::Builder::new()
            .name("world".into())
            .spawn(move || world.run(step, &flag, each_step))?;
        Ok(Self { time, orders, stop, thread: Some(thread) })
    }

    /// Changes the world between two steps.
    pub fn change(&self, order: impl FnOnce(&mut Simulation) + Send + 'static) {
        self.orders().change(order);
    }

    /// For those who change it later.
    #[must_use]
    pub fn orders(&self) -> WorldOrders {
        WorldOrders(self.orders.clone())
    }

    /// Plugs other lines into the truck with this index.
    pub fn replace_lines(&self, index: usize, new: TruckLines) {
        self.orders().push(Box::new(move |_, lines| {
            if let Some(old) = lines.get_mut(index) {
                *old = new;
            }
        }));
    }

    /// The instruments that a person holds to the truck with this index.
    #[must_use]
    pub fn instruments(&self, index: usize) -> Instruments {
        self.orders().instruments(index)
    }

    /// The world's clock.
    #[must_use]
    pub fn time(&self) -> &Arc<WorldTime> {
        &self.time
    }
}

impl Drop for RunningWorld {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct WorldThread {
    simulation: Simulation,
    lines: Vec<TruckLines>,
    orders: Orders,
    time: Arc<WorldTime>,
}

impl WorldThread {
    fn run(mut self, step: Duration, stop: &AtomicBool, mut each_step: impl FnMut(&Simulation)) {
        let mut bytes = Vec::with_capacity(LINE_CAPACITY);
        let mut next = Instant::now();
        while !stop.load(Ordering::Relaxed) {
            next += step;
            let now = Instant::now();
            match next.checked_duration_since(now) {
                Some(ahead) => std::thread::sleep(ahead),
                None if now - next > GIVE_UP => next = now,
                None => {}
            }
            for order in self.orders.lock().unwrap_or_else(PoisonError::into_inner).drain(..) {
                order(&mut self.simulation, &mut self.lines);
            }
            self.exchange(&mut bytes);
            each_step(&self.simulation);
            self.time.advance(self.simulation.now());
        }
        self.time.end();
    }

    /// One step: what the agents sent, the physics, what the trucks send.
    fn exchange(&mut self, bytes: &mut Vec<u8>) {
        for (truck, lines) in self.simulation.trucks_mut().iter_mut().zip(&mut self.lines) {
            bytes.clear();
            lines.board.receive(bytes);
            truck.board_rx(bytes);
            bytes.clear();
            lines.gyro.receive(bytes);
            truck.gyro_rx(bytes);
        }
        self.simulation.step();
        for (truck, lines) in self.simulation.trucks_mut().iter_mut().zip(&mut self.lines) {
            bytes.clear();
            truck.take_board_tx(bytes);
            lines.board.send(bytes);
            bytes.clear();
            truck.take_gyro_tx(bytes);
            lines.gyro.send(bytes);
        }
    }
}

/// The lone truck could not be put into its room.
#[derive(Debug, Error)]
pub enum LoneTruckError {
    /// The room or the truck is impossible.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// No thread for the world.
    #[error("cannot start the simulation: {0}")]
    Thread(#[from] io::Error),
}

/// `--hardware simulated`: one truck alone in an empty room, its world in this process. It is an XTB, whatever the
/// settings say of the vehicle, but for its inertial unit.
pub struct LoneTruck {
    lines: SimulatedHardware,
    world: RunningWorld,
}

impl LoneTruck {
    /// Starts the world at real time.
    ///
    /// # Errors
    /// [`LoneTruckError`].
    pub fn start(seed: u64) -> Result<(Self, Clock), LoneTruckError> {
        Self::start_at(seed, 1.0, &VehicleConfig::default())
    }

    /// Starts the world at `speed` × real time, as far as the machine goes, with the unit of this vehicle.
    ///
    /// # Errors
    /// [`LoneTruckError`].
    pub fn start_at(seed: u64, speed: f64, vehicle: &VehicleConfig) -> Result<(Self, Clock), LoneTruckError> {
        let VehicleConfig { imu, imu_yaw, .. } = *vehicle;
        let parameters = TruckParameters::of(&VehicleConfig { imu, imu_yaw, ..VehicleConfig::default() });
        Self::start_of(&parameters, seed, speed)
    }

    /// The same with a truck of this kind.
    ///
    /// # Errors
    /// [`LoneTruckError`].
    pub fn start_of(
        parameters: &TruckParameters,
        seed: u64,
        speed: f64,
    ) -> Result<(Self, Clock), LoneTruckError> {
        let simulation = Simulation::new(World::default(), parameters, &["truck"], seed)?;
        let (lines, world_lines) = SimulatedHardware::connect();
        let time = WorldTime::new();
        let clock = time.join();
        let world = RunningWorld::start(simulation, vec![world_lines], time, speed, |_| {})?;
        Ok((Self { lines, world }, clock))
    }

    /// The instruments that a person holds to it.
    #[must_use]
    pub fn instruments(&self) -> Instruments {
        self.world.instruments(0)
    }

    /// For whoever changes its world; the truck has the index 0.
    #[must_use]
    pub fn orders(&self) -> WorldOrders {
        self.world.orders()
    }
}

impl Hardware for LoneTruck {
    fn kind(&self) -> &'static str {
        self.lines.kind()
    }

    fn read_board(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.lines.read_board(buffer)
    }

    fn read_gyro(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.lines.read_gyro(buffer)
    }

    fn write_board(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.lines.write_board(bytes)
    }

    fn write_gyro(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.lines.write_gyro(bytes)
    }
}
