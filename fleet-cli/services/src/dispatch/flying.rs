//! The write that is out: at the disk, and then until the stand-by has it.

use crate::ledger::{self, LedgerWriteError};
use tokio::sync::oneshot;

/// A write at the disk.
pub(super) struct Flying {
    pub(super) id: u64,
    pub(super) last_n: u64,
    pub(super) snapshot: bool,
    pub(super) ticket: ledger::PendingWrite,
}

/// A write on the disk of which nobody may know yet.
pub(super) struct Unacknowledged {
    pub(super) id: u64,
    pub(super) last_n: u64,
    pub(super) snapshot: bool,
}

/// What came of a write.
pub(super) type Written = Result<Result<u64, LedgerWriteError>, oneshot::error::RecvError>;

/// Resolves when the write that is out has an outcome; never if none is.
pub(super) async fn durable(flying: &mut Option<Flying>) -> (Flying, Written) {
    match flying {
        Some(out) => {
            let written = (&mut out.ticket).await;
            match flying.take() {
                Some(out) => (out, written),
                None => std::future::pending().await,
            }
        }
        None => std::future::pending().await,
    }
}
