//! Inputs from a corpus: flipped, cut, spliced, repeated. The same seed gives the same inputs.

use rand_core::Rng;
use rand_pcg::Pcg32;

/// Longer than any message that is read.
const MAX_LEN: usize = 20_000;
/// What parsers stumble over.
const WORDS: [&[u8]; 24] = [
    b"nan",
    b"inf",
    b"-0.0",
    b"1e999",
    b"1e308",
    b"-1",
    b"0.1",
    b"9007199254740993",
    b"18446744073709551615",
    b"null",
    b"true",
    b"{}",
    b"[]",
    b"\"",
    b"\\u0000",
    b"\\ud800",
    b"'''",
    b"\n",
    b"#",
    b"\x00",
    b"\xff\xff",
    b"\x0e",
    b"\xf0",
    b"\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01",
];

/// A source of inputs without end.
#[derive(Debug)]
pub struct Mutator {
    dice: Pcg32,
    corpus: Vec<Vec<u8>>,
}

impl Mutator {
    /// Inputs made of these.
    #[must_use]
    pub fn new(seed: u64, corpus: Vec<Vec<u8>>) -> Self {
        Self { dice: Pcg32::new(seed, 0), corpus }
    }

    /// The next input: one of the corpus with one to four changes, mostly one.
    pub fn next_input(&mut self) -> Vec<u8> {
        let mut bytes = self.pick();
        for _ in 0..=self.below(4).min(self.below(4)) {
            self.change(&mut bytes);
        }
        if self.below(500) == 0 && !bytes.is_empty() {
            bytes = bytes.iter().copied().cycle().take(MAX_LEN).collect();
        }
        bytes.truncate(MAX_LEN);
        bytes
    }

    fn change(&mut self, bytes: &mut Vec<u8>) {
        let (from, to) = self.range(bytes.len());
        match self.below(9) {
            0 | 1 if from < bytes.len() => bytes[from] ^= 1 << self.below(8),
            2 if from < bytes.len() => bytes[from] = self.dice.next_u32() as u8,
            3 => bytes.truncate(from),
            4 => drop(bytes.drain(from..to)),
            5 => {
                let part = bytes[from..to].to_vec();
                bytes.splice(from..from, part);
            }
            6 => {
                let other = self.pick();
                let (start, end) = self.range(other.len());
                bytes.splice(from..to, other[start..end].iter().copied());
            }
            7 => {
                let word = WORDS[self.below(WORDS.len())];
                let to = if self.below(2) == 0 { from } else { end_of_number(bytes, from) };
                bytes.splice(from..to, word.iter().copied());
            }
            _ => {
                let tail = self.below(40);
                bytes.truncate(to);
                bytes.extend((0..tail).map(|_| self.dice.next_u32() as u8));
            }
        }
    }

    fn pick(&mut self) -> Vec<u8> {
        let index = self.below(self.corpus.len());
        self.corpus.get(index).cloned().unwrap_or_default()
    }

    /// Two places within a length, in order; mostly near each other.
    fn range(&mut self, len: usize) -> (usize, usize) {
        let from = self.below(len + 1);
        let most = if self.below(4) == 0 { len } else { 16 };
        (from, (from + self.below(most + 1)).min(len))
    }

    fn below(&mut self, end: usize) -> usize {
        // Slightly uneven, which is no matter here.
        self.dice.next_u32() as usize % end.max(1)
    }
}

fn end_of_number(bytes: &[u8], from: usize) -> usize {
    let digits = bytes[from..].iter().take_while(|byte| byte.is_ascii_digit() || b"+-.".contains(byte));
    from + digits.count()
}
