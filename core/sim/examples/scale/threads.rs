//! An executor on threads of the standard library.

use std::sync::{Mutex, PoisonError};
use xtb_sim::Executor;

/// So many threads, the caller's among them.
pub(crate) struct Threads(pub(crate) usize);

impl Executor for Threads {
    fn threads(&self) -> usize {
        self.0
    }

    fn each<T: Send>(&self, pieces: &mut [T], work: impl Fn(&mut T) + Sync) {
        let threads = self.0.min(pieces.len());
        let queue = Mutex::new(pieces.iter_mut());
        let next = || queue.lock().unwrap_or_else(PoisonError::into_inner).next();
        let turn = || {
            while let Some(piece) = next() {
                work(piece);
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(turn);
            }
            turn();
        });
    }
}
