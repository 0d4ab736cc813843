//! A BNO085 in UART-RVC mode at the board: 100 frames a second from power-on, without being asked.
//!
//! Mounted flat with its x axis ahead. Its yaw is 0 at power-on and drifts as a 3DM-G's; accelerations are gravity's
//! and noise, as nobody uses more of them.

use crate::faults::{GyroFault, InjectedLineFault};
use crate::gyro::Attitude;
use crate::parameters::GyroTruth;
use crate::rng::Rng;
use xtb_control::units::Stamp;
use xtb_control::vehicle::ImuYaw;
use xtb_protocol::bno085::Bno085Sample;

const PERIOD_NS: u64 = 10_000_000;
/// Standard deviation of an acceleration, in mg: assumed.
const NOISE_MG: f64 = 2.0;

#[derive(Debug, Clone)]
pub(crate) struct Bno085 {
    noise_deg: f64,
    drift_dps: f64,
    yaw: ImuYaw,
    /// Its streams are its own, so that a truck without it draws as before.
    noise: Rng,
    next_ns: u64,
    /// Heading at power-on.
    north_deg: Option<f64>,
    line: InjectedLineFault,
    /// The frame at which it froze.
    stuck: Option<Bno085Sample>,
    fault: GyroFault,
    /// The last frame, also of a line that lost it.
    last: Bno085Sample,
    bad: u8,
}

impl Bno085 {
    pub(crate) fn new(truth: &GyroTruth, mut noise: Rng) -> Self {
        Self {
            noise_deg: truth.noise_deg,
            drift_dps: noise.uniform(0.0, truth.yaw_drift_dps),
            yaw: truth.imu_yaw,
            next_ns: noise.up_to(PERIOD_NS),
            noise,
            north_deg: None,
            line: InjectedLineFault::None,
            stuck: None,
            fault: GyroFault::None,
            last: Bno085Sample::default(),
            bad: 0,
        }
    }

    /// Breaks or mends its wire to the board.
    pub(crate) fn set_line_fault(&mut self, fault: InjectedLineFault) {
        (self.line, self.stuck) = (fault, (fault == InjectedLineFault::Frozen).then_some(self.last));
    }

    /// Breaks or mends it.
    pub(crate) fn set_fault(&mut self, fault: GyroFault) {
        self.fault = fault;
    }

    /// The frame that has come to the board until `now`, if any; one of two a step.
    pub(crate) fn step(&mut self, now: Stamp, attitude: &Attitude) -> Option<Bno085Sample> {
        if self.next_ns > now.ns() {
            return None;
        }
        self.next_ns += PERIOD_NS;
        let sample = self.sample(now, attitude);
        self.last = match self.fault {
            GyroFault::None => sample,
            GyroFault::AnglesFrozen => {
                let Bno085Sample { yaw_cdeg, pitch_cdeg, roll_cdeg, .. } = self.last;
                Bno085Sample { yaw_cdeg, pitch_cdeg, roll_cdeg, ..sample }
            }
            GyroFault::TimerFrozen => Bno085Sample { index: self.last.index, ..sample },
            GyroFault::Frozen => self.last,
        };
        match self.line {
            InjectedLineFault::None => Some(self.last),
            InjectedLineFault::Lossy(part) => (!self.noise.chance(part)).then_some(self.last),
            // The board sees frames that begin and have a wrong sum, and says so with the next good one.
            InjectedLineFault::Garbage | InjectedLineFault::HalfFrames => {
                self.bad = self.bad.wrapping_add(1);
                None
            }
            InjectedLineFault::Frozen => self.stuck,
            InjectedLineFault::Silent | InjectedLineFault::WrongDevice => None,
        }
    }

    fn sample(&mut self, now: Stamp, attitude: &Attitude) -> Bno085Sample {
        let noise = &mut self.noise;
        let mut cdeg = |deg: f64, most: f64| {
            let noisy = (deg + noise.bell(self.noise_deg)) * 100.0;
            libm::round(noisy).clamp(-most, most) as i16
        };
        let sign = match self.yaw {
            ImuYaw::CounterClockwise => -1.0,
            ImuYaw::Clockwise => 1.0,
        };
        let north_deg = *self.north_deg.get_or_insert(attitude.heading_deg);
        let turned_deg = sign * (attitude.heading_deg - north_deg + self.drift_dps * now.s());
        let yaw_deg = turned_deg - 360.0 * libm::round(turned_deg / 360.0);
        let (yaw_cdeg, pitch_cdeg, roll_cdeg) = (
            cdeg(yaw_deg, 18_000.0),
            cdeg(sign * attitude.pitch_deg, 9_000.0),
            cdeg(attitude.roll_deg, 18_000.0),
        );
        let (pitch, roll) = (attitude.pitch_deg.to_radians(), attitude.roll_deg.to_radians());
        let up = [libm::sin(pitch), libm::sin(roll), 1.0].map(|part| 1000.0 * part);
        Bno085Sample {
            index: self.last.index.wrapping_add(1),
            bad: self.bad,
            yaw_cdeg,
            pitch_cdeg,
            roll_cdeg,
            acceleration_mg: up.map(|mg| libm::round(mg + self.noise.bell(NOISE_MG)) as i16),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(imu_yaw: ImuYaw) -> Bno085 {
        let truth = GyroTruth { noise_deg: 0.0, yaw_drift_dps: 0.0, imu_yaw, ..GyroTruth::default() };
        Bno085::new(&truth, Rng::new(5, 0))
    }

    /// Samples of the next second, in which the heading turns clockwise by 1° a ms, from 350° at first.
    fn second(unit: &mut Bno085) -> Vec<Bno085Sample> {
        let from_ms = unit.next_ns / 1_000_000 / 10 * 10;
        let attitude = |ms: u64| Attitude { heading_deg: 350.0 + ms as f64, pitch_deg: 2.0, roll_deg: -3.0 };
        let times = (from_ms + 5..=from_ms + 1000).step_by(5);
        times.filter_map(|ms| unit.step(Stamp::from_ms(ms), &attitude(ms))).collect()
    }

    #[test]
    fn it_sends_a_hundred_numbered_frames_a_second_and_its_yaw_begins_at_0() {
        let samples = second(&mut unit(ImuYaw::Clockwise));
        assert_eq!(samples.len(), 100);
        assert!(samples.windows(2).all(|pair| pair[1].index == pair[0].index.wrapping_add(1)));
        assert_eq!(samples[0].yaw_cdeg, 0);
        assert_eq!(samples[17].yaw_cdeg, 17_000, "170 ms later");
        assert_eq!(samples[20].yaw_cdeg, -16_000, "past half a turn");
    }

    #[test]
    fn yaw_and_pitch_grow_as_the_truth_says_and_gravity_is_felt() {
        let (right, left) =
            (second(&mut unit(ImuYaw::Clockwise)), second(&mut unit(ImuYaw::CounterClockwise)));
        assert_eq!((right[9].yaw_cdeg, left[9].yaw_cdeg), (9_000, -9_000));
        assert_eq!((right[9].pitch_cdeg, left[9].pitch_cdeg, left[9].roll_cdeg), (200, -200, -300));
        assert!(left.iter().all(|sample| (sample.acceleration_mg[2] - 1000).abs() < 10));
    }

    #[test]
    fn what_breaks_is_seen_at_the_board() {
        let mut unit = unit(ImuYaw::Clockwise);
        unit.set_line_fault(InjectedLineFault::Garbage);
        assert_eq!(second(&mut unit), []);
        unit.set_line_fault(InjectedLineFault::None);
        let samples = second(&mut unit);
        assert_eq!((samples.len(), samples[0].bad, samples[0].index), (100, 100, 101));
        for (line, fault) in
            [(InjectedLineFault::Frozen, GyroFault::None), (InjectedLineFault::None, GyroFault::Frozen)]
        {
            unit.set_line_fault(line);
            unit.set_fault(fault);
            let still = second(&mut unit);
            assert!(still.len() == 100 && still.windows(2).all(|pair| pair[0] == pair[1]));
        }
    }
}
