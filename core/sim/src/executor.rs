//! On what a lockstep simulation works: this crate knows no threads, its caller may have some.

/// Does pieces of work that have nothing in common, on as many threads as the caller likes.
pub trait Executor {
    /// How many pieces may be under way at the same time.
    fn threads(&self) -> usize;

    /// Does `work` once on each piece, in any order and on any thread, and returns when all are done.
    fn each<T: Send>(&self, pieces: &mut [T], work: impl Fn(&mut T) + Sync);
}

/// One piece after the other, on the caller's thread.
#[derive(Debug, Clone, Copy, Default)]
pub struct Sequential;

impl Executor for Sequential {
    fn threads(&self) -> usize {
        1
    }

    fn each<T: Send>(&self, pieces: &mut [T], work: impl Fn(&mut T) + Sync) {
        pieces.iter_mut().for_each(work);
    }
}
