//! What a board is asked for beyond its set-up: who it is, the samples of its inertial unit, and scans with all range
//! finders of a car that has more than six on a bumper.
//!
//! Only a board whose status names a firmware that answers is asked, so an older one has nothing to refuse.

use xtb_control::Stamp;
use xtb_protocol::board::rates::ASK_EVERY_S;
use xtb_protocol::board::{Ask, BoardIdentity, Firmware};

const ASK_EVERY_MS: u64 = (ASK_EVERY_S * 1000.0) as u64;
/// A board that has not said who it is after so many asks may remain unknown: that stops nothing.
const IDENTITY_ASKS: u32 = 3;

/// What a board has to send beside what every board sends, as the car needs it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Wanted {
    /// Samples of its inertial unit.
    pub(super) imu: bool,
    /// Wide scans.
    pub(super) wide_scan: bool,
    /// Whether one of them is missing.
    pub(super) missing: bool,
}

/// Asks, and keeps the answer.
#[derive(Debug, Clone, Default)]
pub(super) struct Asker {
    identity: Option<BoardIdentity>,
    asks: u32,
    asked: Option<Stamp>,
}

impl Asker {
    pub(super) fn identity(&self) -> Option<BoardIdentity> {
        self.identity
    }

    pub(super) fn heard(&mut self, identity: BoardIdentity) {
        self.identity = Some(identity);
    }

    /// The board has restarted, or another may have been plugged in.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The ask to send now, if any.
    pub(super) fn request(&mut self, now: Stamp, firmware: Firmware, wanted: Wanted) -> Option<Ask> {
        let waits = self.asked.is_some_and(|at| now.since_ms(at) < ASK_EVERY_MS);
        let identity = self.identity.is_none() && self.asks < IDENTITY_ASKS;
        let wide_scan = wanted.wide_scan && firmware.sends_wide_scans();
        let missing = wanted.missing && (wanted.imu || wide_scan);
        if waits || !firmware.answers_asks() || !(identity || missing) {
            return None;
        }
        self.asked = Some(now);
        self.asks = self.asks.saturating_add(1);
        Some(Ask { identity, imu: wanted.imu, wide_scan })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEW: Firmware = Firmware(0x0102);
    const IMU: Wanted = Wanted { imu: true, wide_scan: false, missing: true };
    const WIDE: Wanted = Wanted { imu: false, wide_scan: true, missing: true };

    fn asks(firmware: Firmware, wanted: Wanted) -> Vec<Ask> {
        let mut asker = Asker::default();
        (0..200).filter_map(|turn| asker.request(Stamp::from_ms(5 * turn), firmware, wanted)).collect()
    }

    #[test]
    fn a_board_is_asked_who_it_is_three_times_at_most_and_an_older_one_never() {
        let identity = Ask { identity: true, ..Ask::default() };
        let nothing = Wanted { missing: true, ..Wanted::default() };
        assert_eq!(asks(NEW, nothing), [identity; 3]);
        for firmware in [0, 0x0100, 0x0200] {
            assert_eq!(asks(Firmware(firmware), IMU), []);
            assert_eq!(asks(Firmware(firmware), WIDE), []);
        }
    }

    #[test]
    fn samples_are_asked_for_until_they_come_and_each_ask_names_them() {
        let both = Wanted { imu: true, ..WIDE };
        for wanted in [IMU, WIDE, both] {
            let asked = asks(NEW, wanted);
            assert_eq!(asked.len(), 10, "each 100 ms");
            assert!(asked.iter().all(|ask| (ask.imu, ask.wide_scan) == (wanted.imu, wanted.wide_scan)));
            assert_eq!(asks(NEW, Wanted { missing: false, ..wanted }).len(), 3, "only for the identity");
        }
    }

    #[test]
    fn a_board_that_does_not_know_wide_scans_is_not_asked_for_them() {
        let older = Firmware(0x0101);
        assert_eq!(asks(older, WIDE), [Ask { identity: true, ..Ask::default() }; 3]);
        assert!(asks(older, Wanted { imu: true, ..WIDE }).iter().all(|ask| ask.imu && !ask.wide_scan));
    }
}
