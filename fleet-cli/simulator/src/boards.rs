//! Trucks whose I/O boards are emulated and run a board's own firmware, in the world's time.

use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;
use xtb_board_emulator::{Emulator, EmulatorError};
use xtb_client::{Error, ErrorKind, Result};
use xtb_sim::{Simulation, TruckParameters};

/// Between two looks at the boards.
const LOOK_EVERY: Duration = Duration::from_millis(100);

/// What runs on the boards.
#[derive(Debug, Clone)]
pub struct BoardFirmware {
    /// Its ELF file.
    pub firmware: PathBuf,
    /// Folder with `bridge.mjs`.
    pub emulator: PathBuf,
}

/// The boards, each in a process of its own; none if they are simulated.
pub(super) struct Boards(Vec<Arc<Mutex<Emulator>>>);

impl Boards {
    /// Gives every truck its board.
    pub(super) fn switch_on(
        board: Option<&BoardFirmware>,
        simulation: &mut Simulation,
        kinds: &[TruckParameters],
    ) -> Result<Self> {
        let Some(BoardFirmware { firmware, emulator }) = board else { return Ok(Self(Vec::new())) };
        let mut boards = Vec::new();
        for (truck, kind) in simulation.trucks_mut().iter_mut().zip(kinds) {
            let board =
                Emulator::start(firmware, emulator, kind.receiver.fitted).map_err(|it| failed(&it))?;
            let board = Arc::new(Mutex::new(board));
            truck.set_external_board(board.clone());
            boards.push(board);
        }
        Ok(Self(boards))
    }

    /// Resolves when one has ended; one that is in a step is looked at the next time.
    pub(super) async fn ended(&self) -> Error {
        loop {
            match self.0.iter().find_map(|board| board.try_lock().ok()?.failure().map(failed)) {
                Some(failure) => return failure,
                None => tokio::time::sleep(LOOK_EVERY).await,
            }
        }
    }
}

fn failed(error: &EmulatorError) -> Error {
    let kind = match error {
        EmulatorError::NoNode(_) | EmulatorError::Ended(_) => ErrorKind::Failed,
        _ => ErrorKind::Invalid,
    };
    Error::new(kind, error.to_string()).hint(error.hint())
}
