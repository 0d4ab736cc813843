//! What a person with a protractor reads off a truck (Annex A), for a truck that can tell it by itself.

use std::sync::mpsc::Receiver;
use xtb_control::calibration::Measured;

/// Instruments held to one truck.
pub struct Instruments(Box<dyn Fn() -> Receiver<Measured> + Send>);

impl Instruments {
    /// Instruments that answer a reading through `read`.
    pub fn new(read: impl Fn() -> Receiver<Measured> + Send + 'static) -> Self {
        Self(Box::new(read))
    }

    /// Reads them at the truck's next step, so whoever waits for the answer must go on taking turns. No
    /// answer comes from a world that has ended.
    #[must_use]
    pub fn read(&self) -> Receiver<Measured> {
        (self.0)()
    }
}
