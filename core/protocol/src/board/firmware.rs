//! Which firmware a board runs, and what that lets the agent expect.
//!
//! The version of the firmware is that of the protocol which it speaks (`docs/io-board.md`): the same major version
//! means that both understand each other, a higher minor one that the board does more.

use std::fmt;
use thiserror::Error;

/// The major version that this agent speaks.
pub const MAJOR: u8 = 1;
/// Since 1.1: [asks](super::ToBoard::Ask), what answers them, and the bit of the emergency stop.
const WITH_ASKS: Firmware = Firmware(0x0101);
/// Since 1.2: scans with eight range finders a bumper, if they are asked for.
const WITH_WIDE_SCANS: Firmware = Firmware(0x0102);

/// A board's firmware as its status names it, major version in the high byte.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Firmware(pub u16);

impl Firmware {
    /// Major and minor version; `None` of a board that names none.
    #[must_use]
    pub fn version(self) -> Option<(u8, u8)> {
        let [major, minor] = self.0.to_be_bytes();
        (self.0 != 0).then_some((major, minor))
    }

    /// Whether this agent understands such a board. One that names no version is believed to be.
    ///
    /// # Errors
    /// It speaks another version of the protocol.
    pub fn check(self) -> Result<(), UnknownFirmware> {
        match self.version() {
            Some((major, _)) if major > MAJOR => Err(UnknownFirmware { version: self.to_string() }),
            _ => Ok(()),
        }
    }

    /// Whether it answers [asks](super::ToBoard::Ask), and knows the bit of the emergency stop.
    #[must_use]
    pub fn answers_asks(self) -> bool {
        self.check().is_ok() && self >= WITH_ASKS
    }

    /// Whether it sends scans with eight range finders a bumper.
    #[must_use]
    pub fn sends_wide_scans(self) -> bool {
        self.check().is_ok() && self >= WITH_WIDE_SCANS
    }
}

impl fmt::Display for Firmware {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.version() {
            Some((major, minor)) => write!(f, "{major}.{minor}"),
            None => f.write_str("unknown"),
        }
    }
}

/// A board whose firmware speaks a version of the protocol that this agent does not know: it is not set up.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("firmware {version} is not known to this agent, which knows {MAJOR}.x: {}", UnknownFirmware::HINT)]
pub struct UnknownFirmware {
    /// As people write it.
    pub version: String,
}

impl UnknownFirmware {
    /// What a person does about it.
    pub const HINT: &'static str = "flash the firmware of this agent's release (`cargo xtask uf2`)";

    /// Of a board whose frames have a layout of this version.
    #[must_use]
    pub fn of_layout(version: u8) -> Self {
        Self { version: format!("{version}.x") }
    }
}

/// Who a board says it is, when it is asked.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct BoardIdentity {
    /// As in its status.
    pub firmware: Firmware,
    /// CRC-32 of the program in its flash.
    pub hash: u32,
    /// 1 = Pico, 2 = Pico 2, 0 = simulated.
    pub model: u8,
    /// Its last start was a reset by its hardware watchdog.
    pub after_hang: bool,
    /// PWM periods whose new pulses waited for the next period, since power-on.
    pub late_periods: u16,
    /// Samples that newer ones replaced before the line had room for them, since power-on.
    pub replaced_samples: u16,
}

impl BoardIdentity {
    /// [`Self::model`] of a simulated board.
    pub const SIMULATED: u8 = 0;

    /// The board, as people call it.
    #[must_use]
    pub fn model_name(&self) -> &'static str {
        match self.model {
            Self::SIMULATED => "simulated",
            1 => "Pico",
            2 => "Pico 2",
            _ => "unknown board",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_higher_major_version_is_refused_and_the_refusal_says_what_to_do() {
        for (word, text, asks, wide) in [
            (0, "unknown", false, false),
            (0x0100, "1.0", false, false),
            (0x0101, "1.1", true, false),
            (0x0102, "1.2", true, true),
        ] {
            let firmware = Firmware(word);
            assert_eq!((firmware.check(), firmware.to_string()), (Ok(()), text.to_owned()));
            assert_eq!((firmware.answers_asks(), firmware.sends_wide_scans()), (asks, wide), "{text}");
        }
        let newer = Firmware(0x01FF);
        assert!(newer.answers_asks() && newer.sends_wide_scans(), "what is newer does no less");
        assert!(!Firmware(0x0200).answers_asks() && !Firmware(0x0200).sends_wide_scans());
        assert_eq!(
            Firmware(0x0203).check().unwrap_err().to_string(),
            "firmware 2.3 is not known to this agent, which knows 1.x: flash the firmware of this agent's \
             release (`cargo xtask uf2`)"
        );
    }
}
