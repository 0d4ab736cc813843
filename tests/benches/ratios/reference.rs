//! The works that figures stand beside: the same instructions in every run, today and in years.
//!
//! Nothing here may change, or no ratio compares with an accepted one any more. So nothing is taken from a
//! library that may become faster, and loops count by hand: without optimization iterators would be most of it.

use fleet_tests::ratios::Reference;
use std::hint::black_box;

/// Rounds of the compute work: about 5 ms with optimization.
const ROUNDS: usize = 6000;
/// Numbers that are sorted in each.
const SORTED: usize = 32;
/// Places of the memory work, 4 bytes each: 8 MiB.
const PLACES: usize = 1 << 21;
/// Places that are visited, one after the other: some ms.
const VISITS: usize = 200_000;

pub(crate) struct References {
    /// To each place the next one; all places are on one ring.
    ring: Vec<u32>,
}

impl References {
    pub(crate) fn new() -> Self {
        let mut ring: Vec<u32> = (0..PLACES as u32).collect();
        let mut random = 0x2545_F491_4F6C_DD1D_u64;
        for place in (1..PLACES).rev() {
            random = xorshift(random);
            // Sattolo: never with itself, so one ring comes out.
            ring.swap(place, (random % place as u64) as usize);
        }
        Self { ring }
    }

    pub(crate) fn run(&self, which: Reference) {
        match which {
            Reference::Compute => black_box(compute()),
            Reference::Memory => black_box(self.visit()),
        };
    }

    fn visit(&self) -> u64 {
        let (mut place, mut visited) = (black_box(0_u32), 0);
        while visited < VISITS {
            place = self.ring[place as usize];
            visited += 1;
        }
        u64::from(place)
    }
}

fn xorshift(mut random: u64) -> u64 {
    random ^= random << 13;
    random ^= random >> 7;
    random ^ (random << 17)
}

/// Draws numbers, sorts them by insertion, sums and hashes them.
fn compute() -> u64 {
    let (mut random, mut hash, mut sum) =
        (black_box(0x9E37_79B9_7F4A_7C15_u64), 0xCBF2_9CE4_8422_2325_u64, 0.0);
    let (mut numbers, mut round) = ([0_u32; SORTED], 0);
    while round < ROUNDS {
        let mut drawn = 0;
        while drawn < SORTED {
            random = xorshift(random);
            let number = (random >> 32) as u32;
            let mut place = drawn;
            while place > 0 && numbers[place - 1] > number {
                numbers[place] = numbers[place - 1];
                place -= 1;
            }
            numbers[place] = number;
            drawn += 1;
        }
        let mut taken = 0;
        while taken < SORTED {
            let part = f64::from(numbers[taken]) / 4_294_967_296.0;
            sum = sum * 0.75 + part * (1.5 - part) / (1.0 + sum);
            hash = (hash ^ u64::from(numbers[taken])).wrapping_mul(0x0000_0100_0000_01B3);
            taken += 1;
        }
        round += 1;
    }
    hash ^ f64::to_bits(sum)
}
