//! The QoS chunk of a liveliness token. It never prevents matching in rmw_zenoh; it says what is cached, and what
//! tools show.
//!
//! `<reliability>:<durability>:<history>,<depth>:<deadline s>,<ns>:<lifespan s>,<ns>:<liveliness>,<lease s>,<ns>`, where
//! what equals the default is empty.

use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The depth that is left out.
const DEFAULT_DEPTH: u32 = 42;

/// A text that is no QoS chunk.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{0:?} is not a QoS of rmw_zenoh")]
pub struct NotAQos(String);

/// What an endpoint promises or asks for. Deadline, lifespan and liveliness are always the defaults in what is
/// written here, and left aside in what is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Qos {
    /// False = best effort.
    pub reliable: bool,
    /// Late subscribers get the last `depth` samples (transient local).
    pub latched: bool,
    /// Samples that are kept; `None` = all.
    pub depth: Option<u32>,
}

impl Qos {
    /// Of most topics, and of services.
    pub const DEFAULT: Self = Self { reliable: true, latched: false, depth: Some(10) };
    /// Of `/tf`.
    pub const TF: Self = Self { depth: Some(100), ..Self::DEFAULT };
    /// Of what stays true: maps, static transforms, descriptions, goals.
    pub const LATCHED: Self = Self { latched: true, depth: Some(1), ..Self::DEFAULT };
    /// Of sensors.
    pub const SENSOR: Self = Self { reliable: false, latched: false, depth: Some(5) };
    /// Of `/clock`.
    pub const CLOCK: Self = Self { depth: Some(1), ..Self::SENSOR };
}

impl fmt::Display for Qos {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reliability = if self.reliable { "" } else { "2" };
        let durability = if self.latched { "1" } else { "" };
        write!(f, "{reliability}:{durability}:")?;
        match self.depth {
            None => f.write_str("2,")?,
            Some(DEFAULT_DEPTH) => f.write_str(",")?,
            Some(depth) => write!(f, ",{depth}")?,
        }
        f.write_str(":,:,:,,")
    }
}

impl FromStr for Qos {
    type Err = NotAQos;

    fn from_str(text: &str) -> Result<Self, NotAQos> {
        let refused = || NotAQos(text.chars().take(64).collect());
        let parts: Vec<&str> = text.split(':').take(7).collect();
        let [reliability, durability, history, deadline, lifespan, liveliness] = parts[..] else {
            return Err(refused());
        };
        let numbers = |part: &str| part.split(',').all(|field| field.bytes().all(|b| b.is_ascii_digit()));
        let rest = [(deadline, 2), (lifespan, 2), (liveliness, 3)];
        if !rest.iter().all(|(part, fields)| part.split(',').count() == *fields && numbers(part)) {
            return Err(refused());
        }
        let (history, depth) = history.split_once(',').ok_or_else(refused)?;
        let depth = match depth {
            "" => DEFAULT_DEPTH,
            digits => digits.parse().map_err(|_| refused())?,
        };
        Ok(Self {
            // 0 is the system's default, and that of rmw_zenoh is reliable.
            reliable: pick(reliability, &["", "0", "1"], &["2"]).ok_or_else(refused)?,
            latched: pick(durability, &["1"], &["", "0", "2"]).ok_or_else(refused)?,
            depth: pick(history, &["", "0", "1"], &["2"]).ok_or_else(refused)?.then_some(depth),
        })
    }
}

fn pick(text: &str, yes: &[&str], no: &[&str]) -> Option<bool> {
    if yes.contains(&text) { Some(true) } else { no.contains(&text).then_some(false) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_chunks_are_those_of_the_table() {
        let table = [
            (Qos::DEFAULT, "::,10:,:,:,,"),
            (Qos::TF, "::,100:,:,:,,"),
            (Qos::LATCHED, ":1:,1:,:,:,,"),
            (Qos::SENSOR, "2::,5:,:,:,,"),
            (Qos::CLOCK, "2::,1:,:,:,,"),
        ];
        for (qos, chunk) in table {
            assert_eq!(qos.to_string(), chunk);
            assert_eq!(chunk.parse(), Ok(qos));
        }
    }

    #[test]
    fn spelt_out_defaults_are_read_too() {
        assert_eq!("1:2:1,10:9,0:,:1,5,0".parse(), Ok(Qos::DEFAULT));
        assert_eq!("::2,:,:,:,,".parse::<Qos>().unwrap().depth, None);
        assert_eq!("::,:,:,:,,".parse::<Qos>().unwrap().depth, Some(DEFAULT_DEPTH));
        for bad in
            ["", "::", "::10:,:,:,,", "3::,10:,:,:,,", "::,-1:,:,:,,", "::,10:,:,:,,:", "::,10:x,:,:,,"]
        {
            assert!(bad.parse::<Qos>().is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn chunks_round_trip(reliable: bool, latched: bool, depth: Option<u32>) {
            let qos = Qos { reliable, latched, depth };
            prop_assert_eq!(qos.to_string().parse(), Ok(qos));
        }

        #[test]
        fn no_text_panics(text in "[0-9:,x]{0,30}") {
            let _ = text.parse::<Qos>();
        }
    }
}
