//! A robot on a bench, for the tests beside it.

use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::frames::MapPose;
use xtb_control::tpu::{ResetMask, TpuSetup};
use xtb_control::vehicle::{Imu, SLOTS, USUAL_SLOTS};
use xtb_control::{AdcCount, PwmCount, Stamp, VehicleConfig};
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::board::{Ask, BoardStatus, Firmware, FrameReader, FrameWriter, ToBoard};
use xtb_protocol::gyro_3dmg::{EulerFrame, TICK_MS};
use xtb_protocol::messages::{
    Body, Done, EventKind, GoalStatus, Lease, LinkLoss, Outcome, RejectCode, Rejected, Reply, Request,
    RobotState, Setpoint,
};
use xtb_protocol::{Name, Uuid};
use xtb_robot::robot::TURN_NS;
use xtb_robot::{Robot, RobotIdentity};

/// A robot on a bench: wheels that turn as asked, ranges as set, and a clock by hand.
pub(crate) struct Bench {
    pub(crate) robot: Robot,
    pub(crate) board: FrameWriter,
    pub(crate) frames: FrameReader,
    pub(crate) now: Stamp,
    pub(crate) motor: PwmCount,
    pub(crate) steer_front: PwmCount,
    /// Counts of the front range finders; 60 = nothing in range, 300 = something near.
    pub(crate) front: u16,
    /// The same of the seventh and eighth.
    pub(crate) last_front: u16,
    pub(crate) board_silent: bool,
    pub(crate) gyro_silent: bool,
    pub(crate) adc_silent: bool,
    /// The encoder counts interference.
    pub(crate) wild_encoder: bool,
    /// The set-up that the board has been given; it says nothing but its status without one.
    pub(crate) setup: Option<TpuSetup>,
    /// Frames of the receiver, if there is one.
    pub(crate) remote: Option<RemoteSample>,
    pub(crate) resets: Vec<ResetMask>,
    pub(crate) firmware: Firmware,
    /// Whether the board says that its emergency stop is pressed; `None` of a firmware that does not know it.
    pub(crate) stop: Option<bool>,
    pub(crate) asks: Vec<Ask>,
    /// A BNO085 at the board.
    pub(crate) imu: Option<Bno085Sample>,
    pub(crate) tilt: [u16; 2],
    pub(crate) yaw: i16,
    pub(crate) asked: u128,
    pub(crate) arrivals: u64,
    /// Acquired with the first command, and kept for as long as `retains` says so.
    pub(crate) lease: Option<Lease>,
    pub(crate) retains: bool,
    pub(crate) seq: u64,
}

pub(crate) const CLIENT: &str = "cli-1";

pub(crate) fn client() -> Name {
    Name::new(CLIENT).unwrap()
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(VehicleConfig::default())
    }

    pub(crate) fn with(vehicle: VehicleConfig) -> Self {
        Self::at_board(vehicle, Firmware(0x0100))
    }

    /// With a board of this firmware, and the unit that the vehicle has.
    pub(crate) fn at_board(vehicle: VehicleConfig, firmware: Firmware) -> Self {
        let mut bench = Self::booted(vehicle, firmware);
        bench.run_ms(200);
        bench
    }

    /// The same at boot.
    pub(crate) fn booted(vehicle: VehicleConfig, firmware: Firmware) -> Self {
        let imu = (vehicle.imu == Imu::Bno085Rvc).then(Bno085Sample::default);
        let identity = RobotIdentity {
            fleet: Name::new("lab").unwrap(),
            robot: Name::new("xtb-1").unwrap(),
            epoch: 42,
            start_pose: MapPose::default(),
        };
        let mut bench = Self {
            robot: Robot::new(identity, vehicle, "test"),
            board: FrameWriter::default(),
            frames: FrameReader::default(),
            now: Stamp::ZERO,
            motor: PwmCount::NEUTRAL,
            steer_front: PwmCount::NEUTRAL,
            front: 60,
            last_front: 60,
            board_silent: false,
            gyro_silent: false,
            adc_silent: false,
            wild_encoder: false,
            setup: None,
            remote: None,
            resets: Vec::new(),
            firmware,
            stop: firmware.answers_asks().then_some(false),
            asks: Vec::new(),
            imu,
            tilt: [517, 513],
            yaw: 0,
            asked: 0,
            arrivals: 0,
            lease: None,
            retains: true,
            seq: 0,
        };
        bench.robot.agent_mut().set_link(true);
        bench
    }

    /// Turns as the loop takes them: gyro each 10 ms, converter each 40, encoder each 50.
    pub(crate) fn run_ms(&mut self, ms: u64) {
        let end = self.now.plus_ms(ms);
        while self.now < end {
            self.now = self.now.plus_ns(TURN_NS);
            let at = self.now.ms();
            if let Some(lease) = self.lease.filter(|_| self.retains) {
                self.robot.agent_mut().heard(self.now, lease);
            }
            if at.is_multiple_of(10) && !self.gyro_silent && self.imu.is_none() {
                let frame = self.gyro_frame(at).encode();
                self.robot.gyro_bytes(self.now, &frame);
            }
            if !self.board_silent {
                self.board_samples(at);
            }
            if let Some(frame) = self.robot.turn(self.now) {
                self.board_hears(frame.as_bytes());
            }
            while let Some(frame) = self.robot.board_request(self.now) {
                self.board_hears(frame.as_bytes());
            }
        }
    }

    /// A gyro that is alive: its timer runs, and roll and pitch are noisy.
    pub(crate) fn gyro_frame(&self, at_ms: u64) -> EulerFrame {
        let noise = |n: u64| (at_ms / 10 * n % 7) as i16 - 3;
        let angles = GyroSample { roll: noise(3), pitch: noise(5), yaw: self.yaw };
        EulerFrame { angles, ticks: (at_ms as f64 / TICK_MS) as u16 }
    }

    pub(crate) fn board_hears(&mut self, bytes: &[u8]) {
        let Self { frames, motor, steer_front, setup, resets, asks, .. } = self;
        frames.to_board(bytes, |frame| match frame.unwrap() {
            ToBoard::Pwm(pwm) => (*motor, *steer_front) = (pwm.motor, pwm.steer_front),
            ToBoard::Setup(wanted) => *setup = Some(wanted),
            ToBoard::Reset(mask) => resets.push(mask),
            ToBoard::Ask(ask) => asks.push(ask),
        });
    }

    pub(crate) fn board_samples(&mut self, at: u64) {
        if at.is_multiple_of(20) {
            let setup_checksum = self.setup.map_or(0, |setup| setup.checksum());
            let ready = self.setup.is_some();
            let status = BoardStatus {
                firmware: self.firmware,
                ready,
                watchdog: self.stop == Some(true),
                emergency_stop: self.stop,
                setup_checksum,
                rejected: 0,
            };
            let frame = self.board.status(&status);
            self.robot.board_bytes(self.now, frame.as_bytes());
            if let Some(remote) = self.remote.filter(|_| ready) {
                let frame = self.board.remote(&remote);
                self.robot.board_bytes(self.now, frame.as_bytes());
            }
        }
        if at.is_multiple_of(10) && !self.gyro_silent {
            self.board_imu();
        }
        if at.is_multiple_of(50) {
            let pulses = if self.motor == PwmCount::NEUTRAL { 0 } else { 20 };
            let pulses = if self.wild_encoder { 4711 } else { pulses };
            let frame = self.board.encoder(pulses);
            self.robot.board_bytes(self.now, frame.as_bytes());
        }
        if at.is_multiple_of(40) && !self.adc_silent {
            let count = |n: u16| AdcCount::try_from(n).unwrap();
            // A count of noise, which is no distance.
            let mut ir_front = [count(self.front + (at / 40 % 2) as u16); SLOTS];
            ir_front[USUAL_SLOTS..].fill(count(self.last_front + (at / 40 % 2) as u16));
            let sample = AdcSample {
                ir_front,
                ir_rear: [count(60 + (at / 40 % 2) as u16); SLOTS],
                tilt: self.tilt.map(count),
                pistons: [count(512); 4],
            };
            let is_wide = self.asks.last().is_some_and(|ask| ask.wide_scan);
            let write = if is_wide { FrameWriter::wide_adc } else { FrameWriter::adc };
            let frame = write(&mut self.board, &sample, Some(7800));
            self.robot.board_bytes(self.now, frame.as_bytes());
        }
    }

    /// A BNO085 that is alive: it counts, and its accelerations are noisy.
    fn board_imu(&mut self) {
        let asked = self.asks.last().is_some_and(|ask| ask.imu) && self.setup.is_some();
        if let Some(sample) = self.imu.as_mut().filter(|_| asked) {
            sample.index = sample.index.wrapping_add(1);
            sample.acceleration_mg[2] = 1000 + i16::from(sample.index % 3);
            sample.pitch_cdeg = i16::from(sample.index % 5);
            let frame = self.board.bno085(sample);
            self.robot.board_bytes(self.now, frame.as_bytes());
        }
    }

    /// Asks with the lease, which is acquired first if need be.
    pub(crate) fn ask(&mut self, body: Body) -> Reply {
        self.asked += 1;
        self.ask_with_id(Uuid::from_u128(1000 + self.asked), body)
    }

    pub(crate) fn ask_with_id(&mut self, id: Uuid, body: Body) -> Reply {
        let lease = self.lease_of(CLIENT);
        self.ask_with(Request { id, lease: Some(lease), body })
    }

    pub(crate) fn ask_with(&mut self, request: Request) -> Reply {
        self.ask_as(CLIENT, &request)
    }

    pub(crate) fn ask_as(&mut self, client: &str, request: &Request) -> Reply {
        self.arrivals += 1;
        self.robot.request(self.now, self.arrivals, &Name::new(client).unwrap(), request)
    }

    /// The lease, acquired by `client` if nobody has it yet.
    pub(crate) fn lease_of(&mut self, client: &str) -> Lease {
        if let Some(lease) = self.lease {
            return lease;
        }
        self.asked += 1;
        let id = Uuid::from_u128(1000 + self.asked);
        let reply = self.ask_as(client, &Request { id, lease: None, body: Body::Acquire { take: false } });
        let Outcome::Ok(Done { lease: Some(lease), .. }) = reply.result else { panic!("{reply:?}") };
        self.lease = Some(lease);
        lease
    }

    pub(crate) fn setpoint(&mut self, rpm: f64) {
        self.lease_of(CLIENT);
        let setpoint = self.fresh_setpoint(rpm);
        self.put(&setpoint);
    }

    /// What the holder would send now.
    pub(crate) fn fresh_setpoint(&mut self, rpm: f64) -> Setpoint {
        self.seq += 1;
        let echo_tick_ms = Some(self.now.ms());
        Setpoint { lease: self.lease, seq: self.seq, echo_tick_ms, rpm, steering: 0.0 }
    }

    pub(crate) fn put(&mut self, setpoint: &Setpoint) {
        self.arrivals += 1;
        let (now, arrival) = (self.now, self.arrivals);
        self.robot.agent_mut().setpoint(now, now, arrival, &client(), setpoint);
    }

    pub(crate) fn estop(&mut self, id: u128) {
        self.arrivals += 1;
        let (now, arrival) = (self.now, self.arrivals);
        self.robot.agent_mut().estop(now, arrival, &client(), Uuid::from_u128(id));
    }

    pub(crate) fn state(&mut self) -> RobotState {
        self.robot.state(self.now, Rejected::default())
    }

    pub(crate) fn goal_events(&mut self) -> Vec<(Uuid, GoalStatus)> {
        let mut events = Vec::new();
        while let Some(event) = self.robot.agent_mut().next_event() {
            if let EventKind::Goal { id, status, .. } = event.kind {
                events.push((id, status));
            }
        }
        events
    }
}

pub(crate) fn ahead(y_m: f64) -> Body {
    Body::Goto { x_m: 0.0, y_m, yaw_rad: None, via: None, on_link_loss: LinkLoss::Halt, finish_s: 300.0 }
}

pub(crate) fn goal_of(reply: &Reply) -> Uuid {
    match &reply.result {
        Outcome::Ok(Done { goal: Some(goal), .. }) => *goal,
        other => panic!("{other:?}"),
    }
}

pub(crate) fn code_of(reply: &Reply) -> RejectCode {
    match &reply.result {
        Outcome::Error(error) => error.code,
        Outcome::Ok(done) => panic!("{done:?}"),
    }
}
