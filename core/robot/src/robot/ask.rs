//! What a board is asked for beyond its set-up: who it is, and the samples of its inertial unit.
//!
//! Only a board whose status names a firmware that answers is asked, so an older one has nothing to refuse.

use xtb_control::Stamp;
use xtb_protocol::board::rates::ASK_EVERY_S;
use xtb_protocol::board::{Ask, BoardIdentity, Firmware};

const ASK_EVERY_MS: u64 = (ASK_EVERY_S * 1000.0) as u64;
/// A board that has not said who it is after so many asks may remain unknown: that stops nothing.
const IDENTITY_ASKS: u32 = 3;

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

    /// The ask to send now, if any. `imu`: whether samples of the inertial unit are wanted, and whether they are missing.
    pub(super) fn request(&mut self, now: Stamp, firmware: Firmware, imu: (bool, bool)) -> Option<Ask> {
        let waits = self.asked.is_some_and(|at| now.since_ms(at) < ASK_EVERY_MS);
        let identity = self.identity.is_none() && self.asks < IDENTITY_ASKS;
        let (wanted, missing) = imu;
        if waits || !firmware.answers_asks() || !(identity || (wanted && missing)) {
            return None;
        }
        self.asked = Some(now);
        self.asks = self.asks.saturating_add(1);
        Some(Ask { identity, imu: wanted })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEW: Firmware = Firmware(0x0101);

    fn asks(asker: &mut Asker, firmware: Firmware, imu: (bool, bool)) -> Vec<Ask> {
        (0..200).filter_map(|turn| asker.request(Stamp::from_ms(5 * turn), firmware, imu)).collect()
    }

    #[test]
    fn a_board_is_asked_who_it_is_three_times_at_most_and_an_older_one_never() {
        let identity = Ask { identity: true, imu: false };
        assert_eq!(asks(&mut Asker::default(), NEW, (false, true)), [identity; 3]);
        for firmware in [0, 0x0100, 0x0200] {
            assert_eq!(asks(&mut Asker::default(), Firmware(firmware), (true, true)), []);
        }
    }

    #[test]
    fn samples_are_asked_for_until_they_come_and_each_ask_names_them() {
        let mut asker = Asker::default();
        let asked = asks(&mut asker, NEW, (true, true));
        assert_eq!(asked.len(), 10, "each 100 ms");
        assert!(asked.iter().all(|ask| ask.imu));
        assert_eq!(asks(&mut Asker::default(), NEW, (true, false)).len(), 3, "only for the identity");
    }
}
