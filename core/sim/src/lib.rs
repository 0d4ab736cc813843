//! The simulated truck and its world.
//!
//! A [`Truck`] talks to an agent through the same bytes as the real one: I/O board frames and gyro
//! frames. A [`Simulation`] holds the trucks of a [`World`] and moves them on in steps of 5 ms. Pure:
//! time, bytes and the seed are arguments; same seed, same bits, on any number of threads.
//! Start reading at [`vehicle`] for one truck and at [`simulation`] for all of them.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod bno085;
mod board;
mod bodies;
pub mod calibration;
mod converter;
mod drive;
mod executor;
pub mod external;
pub mod faults;
pub mod fixes;
mod geometry;
mod grid;
mod gyro;
pub mod hands;
mod impostors;
mod infrared;
mod islands;
mod lattice;
mod line;
pub mod lockstep;
pub mod parameters;
mod platform;
mod range_curves;
pub mod real_time;
pub mod receiver;
pub mod rng;
mod scene;
mod servos;
pub mod simulation;
mod starts;
mod step;
mod to_map;
pub mod vehicle;
mod vehicle_file;
pub mod world;
mod world_error;

pub use calibration::CalibrationTruth;
pub use executor::{Executor, Sequential};
pub use external::{ExternalBoard, Pins, Pulses};
pub use faults::{
    DriveFault, EncoderFault, GyroFault, InjectedLineFault, LineFaults, RangeFinderFault, SensorFaults,
};
pub use fixes::{FixMaker, FixTruth, SimulatedFix};
pub use hands::Hands;
pub use lattice::FREE_AHEAD_M;
pub use lockstep::{Lockstep, LockstepError};
pub use parameters::{Body, TruckParameters};
pub use real_time::{Pace, RealTimeMeter};
pub use receiver::Transmitter;
pub use scene::StepContext;
pub use simulation::{MOST_FOREIGN, Simulation, SimulationError};
pub use step::STEP_NS;
pub use to_map::{MAP_RESOLUTION_M, ToMapError};
pub use vehicle::Truck;
pub use vehicle_file::{VehicleFile, VehicleFileError};
pub use world::{BoxSpec, World};
pub use world_error::WorldError;
