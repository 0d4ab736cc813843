//! What is seen over the whole check: what is still missing, counters, the last usable readings.

use super::rows::Counted;
use xtb_control::controller::RemoteSample;
use xtb_control::remote::{TickReading, reading};
use xtb_control::vehicle::Imu;
use xtb_control::{Stamp, VehicleConfig};
use xtb_robot::robot::Readings;

/// Everything has to go on for this long, so that every range finder has measured, a receiver has
/// had its frames and the counters have something to count.
const SETTLE_MS: u64 = 500;
/// A line's first frames may be cut or out of sequence; they are not counted.
const BEGINNING_MS: u64 = 200;

/// Counters of one line when its beginning was over.
#[derive(Debug, Clone, Copy, Default)]
struct Beginning {
    heard: Option<Stamp>,
    counters: Option<Counted>,
}

/// Looks at each turn of the check.
#[derive(Debug)]
pub(super) struct Watch {
    remote_settings: xtb_control::vehicle::Remote,
    imu: Imu,
    complete_since: Option<Stamp>,
    most_pulses: Option<u16>,
    usable: [Option<u32>; 3],
    board: Beginning,
    gyro: Beginning,
}

impl Watch {
    pub(super) fn new(vehicle: &VehicleConfig) -> Self {
        Self {
            remote_settings: vehicle.remote.clone(),
            imu: vehicle.imu,
            complete_since: None,
            most_pulses: None,
            usable: [None; 3],
            board: Beginning::default(),
            gyro: Beginning::default(),
        }
    }

    /// One turn.
    pub(super) fn turn(&mut self, now: Stamp, readings: &Readings) {
        if self.missing_things(readings).next().is_some() {
            self.complete_since = None;
        } else {
            self.complete_since.get_or_insert(now);
        }
        self.most_pulses = self.most_pulses.max(readings.pulses);
        if let Some(sample) = readings.remote {
            for (usable, ticks) in self.usable.iter_mut().zip(channels(sample)) {
                if matches!(reading(&self.remote_settings, ticks), TickReading::Usable(_)) {
                    *usable = ticks;
                }
            }
        }
        self.board.turn(now, readings.status.is_some(), readings);
        self.gyro.turn(now, readings.gyro.is_some(), readings);
    }

    /// Whether everything has been heard for long enough.
    pub(super) fn is_complete(&self, now: Stamp) -> bool {
        self.complete_since.is_some_and(|at| now.since_ms(at) >= SETTLE_MS)
    }

    /// What has not been heard, in words.
    pub(super) fn missing(&self, readings: &Readings) -> String {
        let missing: Vec<_> = self.missing_things(readings).collect();
        if missing.is_empty() { "a few more samples".to_owned() } else { missing.join(", ") }
    }

    fn missing_things(&self, readings: &Readings) -> impl Iterator<Item = &'static str> + use<> {
        [
            (readings.status.is_none(), "the board"),
            (!readings.set_up, "the board's set-up"),
            (readings.pulses.is_none(), "the encoder"),
            (readings.adc.is_none(), "the converter"),
            (readings.gyro.is_none(), "the gyro"),
            (readings.gyro_firmware.is_none() && self.imu == Imu::ThreeDmG, "the gyro's firmware"),
        ]
        .into_iter()
        .filter_map(|(missing, name)| missing.then_some(name))
    }

    /// Most pulses of any window.
    pub(super) fn most_pulses(&self) -> Option<u16> {
        self.most_pulses
    }

    /// Each channel's last usable reading, else its last one; `None` without a receiver.
    pub(super) fn remote(&self, readings: &Readings) -> Option<[Option<u32>; 3]> {
        let newest = channels(readings.remote?);
        Some(std::array::from_fn(|i| self.usable[i].or(newest[i])))
    }

    /// What has been counted since the lines' beginnings.
    pub(super) fn counted(&self, readings: &Readings) -> Counted {
        let now = Counted::of(readings);
        let board = self.board.counters.unwrap_or_default();
        let gyro = self.gyro.counters.unwrap_or_default();
        Counted {
            board_frames: now.board_frames - board.board_frames,
            board_rejected: now.board_rejected - board.board_rejected,
            board_lost: now.board_lost - board.board_lost,
            // The board counts since its power-on, modulo 65,536; one that has restarted begins anew.
            refused_by_board: match (readings.status, self.board.counters) {
                (Some(_), Some(then)) => now.refused_by_board.wrapping_sub(then.refused_by_board),
                _ => 0,
            },
            gyro_frames: now.gyro_frames - gyro.gyro_frames,
            gyro_lost: now.gyro_lost - gyro.gyro_lost,
            gyro_skipped: now.gyro_skipped - gyro.gyro_skipped,
        }
    }
}

impl Beginning {
    fn turn(&mut self, now: Stamp, heard: bool, readings: &Readings) {
        if heard {
            self.heard.get_or_insert(now);
        }
        if self.heard.is_some_and(|at| now.since_ms(at) >= BEGINNING_MS) {
            self.counters.get_or_insert_with(|| Counted::of(readings));
        }
    }
}

fn channels(sample: RemoteSample) -> [Option<u32>; 3] {
    [sample.speed, sample.steering, sample.selector]
}
