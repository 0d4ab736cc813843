//! What breaks while a truck drives: each fault of sensors, drive and battery, and how long it takes
//! until it has its name and the board's motor pulse is neutral. The tests in `guards.rs` and the
//! example `guard_table` measure with this.

use crate::draw::{Draw, in_parallel};
use crate::whole_robot::WholeRobot;
use std::f64::consts::FRAC_PI_2;
use xtb_control::frames::MapPose;
use xtb_control::{PwmCount, VehicleConfig};
use xtb_protocol::messages::Fault;
use xtb_sim::{
    DriveFault, EncoderFault, GyroFault, InjectedLineFault, LineFaults, RangeFinderFault, SensorFaults,
    Truck, TruckParameters, World,
};

/// A hazard: what breaks, its name, and within what time the robot has to know and the board's motor has
/// to be neutral.
pub(crate) struct Hazard {
    pub(crate) name: &'static str,
    break_it: fn(&mut Truck, usize),
    pub(crate) fault: Fault,
    pub(crate) limit_ms: u64,
    /// Whether the driver lets go at the same moment: what runs away is seen only then.
    lets_go: bool,
}

/// What came of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Outcome {
    /// Until the fault had its name; `None` = never.
    pub(crate) named_ms: Option<u64>,
    /// Until the motor's pulse on the board was neutral for good; `None` = never.
    pub(crate) neutral_ms: Option<u64>,
    /// Fastest from the moment it broke.
    pub(crate) fastest_mps: f64,
}

fn line(board: InjectedLineFault, gyro: InjectedLineFault) -> LineFaults {
    LineFaults { board, gyro }
}

fn gyro(truck: &mut Truck, fault: GyroFault) {
    truck.set_sensor_faults(SensorFaults { gyro: fault, ..SensorFaults::default() });
}

fn encoder(truck: &mut Truck, fault: EncoderFault) {
    truck.set_sensor_faults(SensorFaults { encoder: fault, ..SensorFaults::default() });
}

/// All that this part of the project guards against.
pub(crate) const HAZARDS: [Hazard; 14] = {
    const fn hazard(
        name: &'static str,
        break_it: fn(&mut Truck, usize),
        fault: Fault,
        limit_ms: u64,
    ) -> Hazard {
        Hazard { name, break_it, fault, limit_ms, lets_go: false }
    }
    [
        hazard(
            "the gyro's angles stand still",
            |truck, _| gyro(truck, GyroFault::AnglesFrozen),
            Fault::GyroFrozen,
            300,
        ),
        hazard(
            "the gyro's timer stands still",
            |truck, _| gyro(truck, GyroFault::TimerFrozen),
            Fault::GyroFrozen,
            300,
        ),
        hazard("the gyro hangs", |truck, _| gyro(truck, GyroFault::Frozen), Fault::GyroFrozen, 300),
        hazard(
            "the gyro repeats one frame",
            |truck, _| truck.set_line_faults(line(InjectedLineFault::None, InjectedLineFault::Frozen)),
            Fault::GyroFrozen,
            300,
        ),
        hazard(
            "the board repeats one frame",
            |truck, _| truck.set_line_faults(line(InjectedLineFault::Frozen, InjectedLineFault::None)),
            Fault::BoardFrozen,
            250,
        ),
        hazard(
            "the converter hangs",
            |truck, _| truck.set_sensor_faults(SensorFaults { converter_frozen: true, ..Default::default() }),
            Fault::ConverterFrozen,
            350,
        ),
        hazard(
            "one range finder hangs",
            |truck, i| truck.set_sensor_faults(SensorFaults::range_finder(i, RangeFinderFault::Frozen)),
            Fault::InfraredFrozen,
            2200,
        ),
        hazard(
            "a range finder's wire breaks",
            |truck, i| truck.set_sensor_faults(SensorFaults::range_finder(i, RangeFinderFault::BrokenWire)),
            Fault::InfraredOutOfRange,
            250,
        ),
        hazard(
            "a range finder has a short circuit",
            |truck, i| truck.set_sensor_faults(SensorFaults::range_finder(i, RangeFinderFault::Short)),
            Fault::InfraredOutOfRange,
            250,
        ),
        hazard(
            "the encoder's wire breaks",
            |truck, _| encoder(truck, EncoderFault::BrokenWire),
            Fault::Stalled,
            1000,
        ),
        hazard(
            "the encoder counts interference",
            |truck, _| encoder(truck, EncoderFault::Wild),
            Fault::EncoderOutOfRange,
            250,
        ),
        hazard(
            "something holds the wheels",
            |truck, _| truck.set_drive_fault(DriveFault::Held),
            Fault::Stalled,
            1000,
        ),
        Hazard {
            name: "the ESC drives on at neutral",
            break_it: |truck, _| truck.set_drive_fault(DriveFault::Stuck),
            fault: Fault::Runaway,
            limit_ms: 750,
            lets_go: true,
        },
        hazard("the battery is empty", |truck, _| truck.set_battery_left(0.0), Fault::BatteryCritical, 2200),
    ]
};

impl Hazard {
    /// It happens 1 to 4 s into a drive; everything else about it comes from `seed`.
    pub(crate) fn run(&self, seed: u64) -> Outcome {
        let mut draw = Draw::new(seed);
        let free = World::from_toml("").unwrap();
        let start = MapPose { x_m: 0.0, y_m: 0.0, yaw_rad: FRAC_PI_2 };
        let config = VehicleConfig::default();
        let mut whole = WholeRobot::new(free, &TruckParameters::default(), start, seed, &config);
        match draw.below(3) {
            0 => assert!(whole.goto(draw.uniform(-2.0, 2.0), 20.0)),
            1 => whole.setpoint = Some((draw.uniform(8.0, 23.0), draw.uniform(-1.0, 1.0))),
            _ => whole.setpoint = Some((draw.uniform(-23.0, -8.0), draw.uniform(-1.0, 1.0))),
        }
        whole.run_s(draw.uniform(1.0, 4.0));
        assert!(whole.seen.is_empty() && whole.truck().truth().speed_mps.abs() > 0.02, "it drives");
        (self.break_it)(whole.truck(), draw.below(12));
        if self.lets_go {
            whole.setpoint = None;
            whole.ask(xtb_protocol::messages::Body::Stop {});
        }
        self.watch(&mut whole)
    }

    fn watch(&self, whole: &mut WholeRobot) -> Outcome {
        let broke = whole.simulation.now();
        let mut outcome = Outcome { named_ms: None, neutral_ms: None, fastest_mps: 0.0 };
        for _ in 0..800 {
            whole.step();
            let (now, truth) = (whole.simulation.now(), whole.truck().truth());
            let neutral = truth.motor_counts == PwmCount::NEUTRAL.get();
            outcome.neutral_ms = outcome.neutral_ms.filter(|_| neutral);
            if neutral {
                outcome.neutral_ms.get_or_insert(now.since_ms(broke));
            }
            if whole.has(self.fault) {
                outcome.named_ms.get_or_insert(now.since_ms(broke));
            }
            outcome.fastest_mps = outcome.fastest_mps.max(truth.speed_mps.abs());
        }
        outcome
    }

    /// The first so many of it.
    pub(crate) fn measure(&self, count: u64) -> Vec<Outcome> {
        in_parallel(0..count, |seed| self.run(seed))
    }
}
