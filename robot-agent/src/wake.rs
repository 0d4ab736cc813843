//! What must not wait for the next turn wakes the control loop: a setpoint of the holder, a stop.
//!
//! Zenoh's threads call, the loop hears it between two turns. There is no lock that either could wait for.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::Thread;

/// See the module's documentation.
#[derive(Debug, Default)]
pub(crate) struct Wake {
    sleeper: OnceLock<Thread>,
    called: AtomicBool,
}

impl Wake {
    /// From now on a call wakes the calling thread.
    pub(crate) fn wakes_me(&self) {
        // A second loop on the same ends does not exist.
        let _ = self.sleeper.set(std::thread::current());
    }

    /// Something waits for a turn.
    pub(crate) fn call(&self) {
        self.called.store(true, Ordering::Release);
        if let Some(sleeper) = self.sleeper.get() {
            sleeper.unpark();
        }
    }

    /// Whether somebody has called since the last time that this was asked.
    pub(crate) fn take_call(&self) -> bool {
        self.called.swap(false, Ordering::AcqRel)
    }
}
