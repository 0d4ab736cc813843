//! What a robot shows of itself: state, samples, and readings for a technician.

use super::{Newest, Robot};
use crate::agent::TurnView;
use crate::faults::INPUT_LOST_MS;
use crate::motion::Motion;
use xtb_control::controller::{AdcSample, GyroSample, RemoteSample};
use xtb_control::pistons::height_m;
use xtb_control::vehicle::{Drivetrain, Platform, SLOTS};
use xtb_control::{AdcCount, PwmCount, Stamp};
use xtb_protocol::bno085::{Bno085Counter, RVC_LEN};
use xtb_protocol::board::{BoardIdentity, BoardStatus, LineCounters};
use xtb_protocol::gyro_3dmg::GyroReader;
use xtb_protocol::messages::{ObstacleView, Rejected, RobotState, Sensors, TiltState};

/// The newest readings as they came; `None` = not heard within the last [`INPUT_LOST_MS`], or never.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Readings {
    /// How the board is.
    pub status: Option<BoardStatus>,
    /// Who the board says it is; `None` also of an older one, which is not asked.
    pub identity: Option<BoardIdentity>,
    /// Whether the board has confirmed its set-up.
    pub set_up: bool,
    /// [`checksum`](xtb_control::tpu::TpuSetup::checksum) of the set-up that it should have.
    pub setup_checksum: u16,
    /// Pulses of the last encoder window.
    pub pulses: Option<u16>,
    /// Ranges, tilt, pistons.
    pub adc: Option<AdcSample>,
    /// Battery in mV; `None` also if the board does not measure it.
    pub battery_mv: Option<u16>,
    /// Remote control.
    pub remote: Option<RemoteSample>,
    /// Angles, as a 3DM-G gives them whichever unit is fitted.
    pub gyro: Option<GyroSample>,
    /// Yaw of a BNO085 as it sends it, in 0.01°.
    pub bno085_yaw_cdeg: Option<i16>,
    /// The gyro's firmware; a BNO085 tells none.
    pub gyro_firmware: Option<u16>,
    /// The board's frames since the start.
    pub board_frames: LineCounters,
    /// The gyro's good frames since the start.
    pub gyro_frames: u64,
    /// Gyro frames that are missing by its own clock.
    pub gyro_lost: u64,
    /// Bytes skipped to find a gyro frame; a frame of a BNO085 with a wrong check sum counts as its 19.
    pub gyro_skipped: u64,
}

/// Good frames of the gyro, and what is missing.
struct GyroCounts {
    frames: u64,
    lost: u64,
    skipped: u64,
}

impl Robot {
    /// What the lines have brought.
    #[must_use]
    pub fn readings(&self, now: Stamp) -> Readings {
        let ages = self.ages(now);
        let fresh = |age: Option<u64>| age.is_some_and(|ms| ms <= INPUT_LOST_MS);
        let Newest { gyro, pulses, adc, battery_mv, remote, status } = self.newest;
        let spoken = fresh(self.heard.board.map(|at| now.since_ms(at)));
        let (counts, converted) = (self.gyro_counts(), fresh(ages.adc));
        let turned = fresh(ages.gyro);
        Readings {
            status: status.filter(|_| spoken),
            identity: self.asker.identity().filter(|_| spoken),
            set_up: self.setup.is_done(),
            setup_checksum: self.setup.setup().checksum(),
            pulses: fresh(ages.encoder).then_some(pulses),
            adc: adc.filter(|_| converted),
            battery_mv: battery_mv.filter(|_| converted),
            remote: fresh(ages.remote).then_some(remote),
            gyro: turned.then_some(gyro),
            bno085_yaw_cdeg: self.bno085.as_ref().filter(|_| turned).map(|link| link.yaw_cdeg),
            gyro_firmware: self.gyro.starter.firmware(),
            board_frames: self.board.reader.counters(),
            gyro_frames: counts.frames,
            gyro_lost: counts.lost,
            gyro_skipped: counts.skipped,
        }
    }

    fn gyro_counts(&self) -> GyroCounts {
        match &self.bno085 {
            None => {
                let GyroReader { frames, lost, skipped, .. } = self.gyro.reader;
                GyroCounts { frames, lost, skipped }
            }
            Some(link) => {
                let Bno085Counter { frames, lost, bad, .. } = link.counter;
                GyroCounts { frames, lost, skipped: bad * RVC_LEN as u64 }
            }
        }
    }

    /// The state at `now`. `rejected` brings what the links outside have counted.
    pub fn state(&mut self, now: Stamp, rejected: Rejected) -> RobotState {
        let ages = self.ages(now);
        let view = TurnView {
            outputs: &self.outputs,
            ages,
            neutral: self.neutral_since.is_some(),
            over_speed: self.over_speed(),
        };
        let fresh = |age: Option<u64>| age.is_some_and(|ms| ms <= INPUT_LOST_MS);
        let converted = fresh(ages.adc);
        let gears = self.vehicle().range_finders.gears();
        let seen = |side: bool, is_fitted: bool| (converted && is_fitted).then_some(side);
        let battery_mv = self.newest.battery_mv.filter(|_| converted);
        let (board, gyro) = (self.board.reader.counters(), self.gyro_counts());
        let seq = self.state_seq;
        self.state_seq += 1;
        RobotState {
            robot: self.agent.identity().robot.clone(),
            epoch: self.agent.identity().epoch,
            seq,
            tick_ms: now.ms(),
            mode: self.outputs.mode,
            lease: self.agent.lease().state(now),
            pose: self.agent.pose(now, view),
            speed_mps: fresh(ages.encoder).then(|| {
                self.outputs.rpm * self.controller.config().mps_per_rpm() * self.agent.odometry_scale()
            }),
            reference_rpm: self.outputs.reference_rpm,
            steering: self.outputs.steering,
            obstacle: ObstacleView {
                front: seen(self.outputs.obstacle.front, gears.ahead),
                rear: seen(self.outputs.obstacle.rear, gears.astern),
            },
            tilt_deg: TiltState {
                x: self.outputs.tilt.x.filter(|_| converted),
                y: self.outputs.tilt.y.filter(|_| converted),
            },
            battery_v: battery_mv.map(|mv| f64::from(mv) / 1000.0),
            battery_level: self.battery_level(now),
            nav: self.agent.nav_state(now),
            goal: self.agent.goal().map(|goal| goal.state(now)),
            ended_goals: self.agent.ended_goals().collect(),
            faults: self.agent.faults().states(now),
            latches: self.agent.latch_states(now),
            stopped_because: self.agent.stopped_because(view),
            stopped_age_ms: self.neutral_since.map(|since| now.since_ms(since)),
            input_age_ms: ages,
            turn_late_us: std::mem::take(&mut self.late_ns) / 1000,
            turns_late: self.turns_late,
            rejected: Rejected {
                refused: self.agent.refused,
                stale: self.agent.stale,
                fixes: self.agent.fixes_refused(),
                out_of_range: self.agent.routes_refused() + rejected.out_of_range,
                fenced: self.agent.fenced + rejected.fenced,
                events_dropped: self.agent.events_dropped + rejected.events_dropped,
                board_frames: board.rejected,
                board_lost: board.lost,
                board_repeated: board.repeated,
                gyro_bytes: gyro.skipped,
                gyro_lost: gyro.lost,
                remote_readings: self.controller.remote_rejected(),
                record_dropped: self.step_log.dropped() + rejected.record_dropped,
                ..rejected
            },
        }
    }

    /// Where the odometry has it, in a frame that never jumps, and how it moves. The yaw rate is the turn since the
    /// last time that this was asked, so it is to be asked regularly.
    pub fn motion(&mut self, now: Stamp) -> Option<Motion> {
        let ages = self.ages(now);
        let fresh = |age: Option<u64>| age.is_some_and(|ms| ms <= INPUT_LOST_MS);
        self.motion.step(now, &self.outputs.pose, false);
        let mps = self.outputs.rpm * self.controller.config().mps_per_rpm();
        self.motion.motion(fresh(ages.encoder).then_some(mps), fresh(ages.gyro))
    }

    /// The last samples; `None` until the converter has been heard.
    #[must_use]
    pub fn sensors(&self, now: Stamp) -> Option<Sensors> {
        let adc = self.newest.adc?;
        let config = self.controller.config();
        let [front, rear] =
            [&config.range_finders.front, &config.range_finders.rear].map(|it| it.0.len().min(SLOTS));
        let counts = |side: &[AdcCount]| side.iter().map(|count| count.get() as u16).collect();
        let pwm = &self.outputs.pwm;
        let remote = self.newest.remote;
        let has_platform = config.platform != Platform::Off;
        let has_rear_steering = config.drivetrain == Drivetrain::BothAxles;
        Some(Sensors {
            robot: self.agent.identity().robot.clone(),
            tick_ms: now.ms(),
            gyro_yaw: self.newest.gyro.yaw,
            encoder_pulses: self.newest.pulses,
            ir_front: counts(&adc.ir_front[..front]),
            ir_rear: counts(&adc.ir_rear[..rear]),
            ir_front_cm: self.outputs.ir_front_cm[..front].to_vec(),
            ir_rear_cm: self.outputs.ir_rear_cm[..rear].to_vec(),
            tilt: has_platform.then(|| adc.tilt.map(AdcCount::get)),
            pistons: has_platform.then(|| adc.pistons.map(AdcCount::get)),
            pistons_m: has_platform.then(|| adc.pistons.map(|reading| height_m(&config.pistons, reading))),
            remote: config.remote.enabled.then_some([remote.speed, remote.steering, remote.selector]),
            gyro_firmware: self.gyro.starter.firmware(),
            board_firmware: self.newest.status.map(|status| status.firmware.0),
            rpm: self.outputs.rpm,
            motor_counts: pwm.motor.get(),
            steer_front_counts: pwm.steer_front.get(),
            steer_rear_counts: has_rear_steering.then(|| pwm.steer_rear.get()),
            bumper_counts: [pwm.bumper_front, pwm.bumper_rear].map(PwmCount::get),
            piston_counts: has_platform.then(|| pwm.pistons.map(PwmCount::get)),
        })
    }
}
