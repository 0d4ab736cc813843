//! The truck at its board's pins, for a board that takes the place of the simulated one.

use super::Truck;
use crate::board::ShaftTravel;
use crate::external::{External, ExternalBoard, Pins};
use crate::gyro::Attitude;
use std::sync::{Arc, Mutex};
use xtb_protocol::bno085::Bno085Sample;

impl Truck {
    /// Puts a board in the place of the simulated one, before the first step. What breaks in the simulated board
    /// ([`crate::EncoderFault`], its line, its converter, a power cycle) does not break this one, and
    /// [`Self::board_counters`] knows nothing of it.
    pub fn set_external_board(&mut self, board: Arc<Mutex<dyn ExternalBoard>>) {
        self.external = Some(External::new(board));
    }

    /// One step of the board in the simulated one's place, whose pulses the next step obeys.
    pub(super) fn step_external(
        &mut self,
        travel: &ShaftTravel,
        attitude: &Attitude,
        imu: Option<&Bno085Sample>,
    ) {
        let pins = Pins {
            now: self.now,
            range_finders_v: self.range_finders.volts(),
            tilt_v: self.platform.tilt_v(attitude),
            pistons_v: self.platform.positions_v(),
            battery_v: self.battery.volts(),
            imu: imu.map(|sample| sample.to_rvc().to_vec()).unwrap_or_default(),
            emergency_stop: self.emergency_stop,
            encoder_edges: travel.edges().collect(),
            receiver_ms: self.board.receiver_ms(),
        };
        if let Some(external) = &mut self.external {
            let (to_agent, outputs, since) = external.step(&pins, self.board.outputs());
            self.board.stand_in(outputs, since);
            self.board.outbox().pass(&to_agent);
        }
    }
}
