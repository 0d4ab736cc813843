//! The gamepads of this computer, for `teleop --gamepad`. Built in with the feature `gamepad` only: on Linux that needs
//! libudev.

#[cfg(feature = "gamepad")]
pub(super) use built_in::Gamepads;
#[cfg(not(feature = "gamepad"))]
pub(super) use left_out::Gamepads;

#[cfg(feature = "gamepad")]
mod built_in {
    use super::super::deadman::Pad;
    use gilrs::{Axis, Button, Gamepad, GamepadId, Gilrs, MappingSource};
    use std::collections::HashMap;
    use xtb_client::{Error, ErrorKind, Result};

    /// Either of them is the deadman button.
    const DEADMAN: [Button; 2] = [Button::LeftTrigger, Button::RightTrigger];

    /// All that are plugged in now.
    pub(in super::super) struct Gamepads {
        gilrs: Gilrs,
        /// Of each.
        changes: HashMap<GamepadId, u64>,
    }

    impl Gamepads {
        /// Looks for them.
        ///
        /// # Errors
        /// [`ErrorKind::Failed`]: the system has no gamepads for programs.
        pub(in super::super) fn open() -> Result<Self> {
            let failed = |error| Error::new(ErrorKind::Failed, format!("cannot look for gamepads: {error}"));
            Ok(Self { gilrs: Gilrs::new().map_err(failed)?, changes: HashMap::new() })
        }

        /// What the one says whose deadman button is held, else the first one whose layout is known; `None` = there
        /// is none.
        pub(in super::super) fn look(&mut self) -> Option<Pad> {
            while let Some(event) = self.gilrs.next_event() {
                *self.changes.entry(event.id).or_default() += 1;
            }
            let is_known =
                |pad: &Gamepad<'_>| pad.is_connected() && pad.mapping_source() != MappingSource::None;
            let deadman = |pad: &Gamepad<'_>| DEADMAN.iter().any(|button| pad.is_pressed(*button));
            let mut pads: Vec<_> = self.gilrs.gamepads().map(|(_, pad)| pad).filter(is_known).collect();
            pads.sort_by_key(|pad| !deadman(pad));
            let pad = pads.first()?;
            let along = |axis| f64::from(pad.value(axis));
            let (x, y) = (along(Axis::LeftStickX), along(Axis::LeftStickY));
            let changes = self.changes.get(&pad.id()).copied().unwrap_or_default();
            Some(Pad { id: pad.id().into(), deadman: deadman(pad), x, y, changes })
        }
    }
}

#[cfg(not(feature = "gamepad"))]
mod left_out {
    use super::super::deadman::Pad;
    use xtb_client::{Error, ErrorKind, Result};

    /// There are none in this build.
    pub(in super::super) enum Gamepads {}

    impl Gamepads {
        /// # Errors
        /// [`ErrorKind::Invalid`], always.
        pub(in super::super) fn open() -> Result<Self> {
            let error = Error::new(ErrorKind::Invalid, "this fleet-cli was built without gamepads");
            Err(error.hint(
                "build it with `cargo build --release -p fleet-cli --features gamepad` (on Linux with libudev-dev), or \
                 drive from the page of `fleet-cli dashboard`, which takes gamepads",
            ))
        }

        pub(in super::super) fn look(&mut self) -> Option<Pad> {
            match *self {}
        }
    }
}
