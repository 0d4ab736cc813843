//! The common name of a certificate: who, and the how-many-eth certificate of that identity.

use std::fmt;
use std::str::FromStr;
use xtb_protocol::Name;

/// `alice.2`: alice's second certificate. The router's rules admit one generation of each name.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct CommonName {
    /// Whose.
    pub name: Name,
    /// From 1.
    pub generation: u32,
}

impl fmt::Display for CommonName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.name, self.generation)
    }
}

impl FromStr for CommonName {
    type Err = ();

    fn from_str(text: &str) -> Result<Self, ()> {
        let (name, generation) = text.rsplit_once('.').ok_or(())?;
        let own =
            Self { name: Name::new(name).map_err(drop)?, generation: generation.parse().map_err(drop)? };
        // One spelling each: no `+1`, no `01`.
        if own.generation >= 1 && own.to_string() == text { Ok(own) } else { Err(()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_common_name_has_one_spelling() {
        let own: CommonName = "xtb-1.12".parse().unwrap();
        assert_eq!((own.name.as_str(), own.generation), ("xtb-1", 12));
        for bad in ["alice", "alice.", "alice.0", "alice.01", "alice.+1", ".1", "Alice.1", "a.b.1"] {
            assert!(bad.parse::<CommonName>().is_err(), "{bad}");
        }
    }
}
