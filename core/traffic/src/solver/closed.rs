//! The best cost known of each state.

use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// State → least cost. Nobody asks for its order, so the same happens in each run.
pub(crate) type Closed = HashMap<u64, u32, BuildHasherDefault<Mixed>>;

/// Spreads the bits of a number (D. Knuth, *The Art of Computer Programming* 3, 6.4: multiplicative hashing).
#[derive(Debug, Default)]
pub(crate) struct Mixed(u64);

impl Hasher for Mixed {
    fn write(&mut self, bytes: &[u8]) {
        bytes.iter().for_each(|byte| self.write_u64(u64::from(*byte)));
    }

    fn write_u64(&mut self, number: u64) {
        let product = (self.0 ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = product ^ product >> 32;
    }

    fn finish(&self) -> u64 {
        self.0
    }
}
