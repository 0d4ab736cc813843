//! Latched stops: set by a cause, cleared by a reset alone, and only when the cause is gone.
//!
//! | latch | set when | cause is gone when | holds the transmitter too |
//! | --- | --- | --- | --- |
//! | `estop` | somebody calls for it, or presses the switch at the board | at once; the switch is released | yes |
//! | `remote_takeover` | the transmitter takes over from a lease or a goal | its selector is on automatic | no |
//! | `board_lost` | the board is lost after it was well | no fault of the board is left | no |
//! | `gyro_lost` | the gyro is lost after it was well | no fault of the gyro is left | no |
//! | `runaway` | the wheels run away | they stand | yes |
//! | `sensor_fault` | a sensor froze or said what cannot be | it works again | yes |
//! | `battery_critical` | the battery is nearly empty | it is not any more | yes |

use xtb_control::Stamp;
use xtb_protocol::messages::{Latch, LatchState};

#[derive(Debug, Clone)]
struct Set {
    latch: Latch,
    since: Stamp,
    by: String,
}

/// The latches that are set, oldest first; each at most once.
#[derive(Debug, Clone, Default)]
pub struct LatchBook(Vec<Set>);

impl LatchBook {
    /// Sets a latch. True if it was not set.
    pub fn set(&mut self, now: Stamp, latch: Latch, by: &str) -> bool {
        if self.is_set(latch) {
            return false;
        }
        self.0.push(Set { latch, since: now, by: by.to_owned() });
        true
    }

    /// Clears a latch. True if it was set.
    pub fn clear(&mut self, latch: Latch) -> bool {
        let before = self.0.len();
        self.0.retain(|set| set.latch != latch);
        self.0.len() < before
    }

    /// Whether this one is set.
    #[must_use]
    pub fn is_set(&self, latch: Latch) -> bool {
        self.0.iter().any(|set| set.latch == latch)
    }

    /// Those that are set, oldest first.
    pub fn all(&self) -> impl Iterator<Item = Latch> {
        self.0.iter().map(|set| set.latch)
    }

    /// For the state; `present` says whether a latch's cause is still there.
    pub fn states(&self, now: Stamp, present: impl Fn(Latch) -> bool) -> Vec<LatchState> {
        let state = |set: &Set| LatchState {
            latch: set.latch,
            age_ms: now.since_ms(set.since),
            by: set.by.clone(),
            present: present(set.latch),
        };
        self.0.iter().map(state).collect()
    }
}
