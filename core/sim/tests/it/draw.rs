//! What the tests draw from a seed, and how they use both cores without losing the order.

use rand_core::Rng;
use rand_pcg::Pcg32;
use std::ops::Range;

/// Numbers for one case; another stream than the truck's own.
pub(crate) struct Draw(Pcg32);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        let mut draw = Self(Pcg32::new(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15), seed));
        draw.below(2); // the first one still knows the seed
        draw
    }

    /// Uniform in [min, max).
    pub(crate) fn uniform(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    /// A whole number less than `n`.
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.uniform(0.0, n as f64) as usize
    }
}

/// `f` of each number, in their order.
pub(crate) fn in_parallel<T: Send>(numbers: Range<u64>, f: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let threads = std::thread::available_parallelism().map_or(1, |n| n.get() as u64);
    let (first, end) = (numbers.start, numbers.end);
    let mut lanes: Vec<std::vec::IntoIter<T>> = std::thread::scope(|scope| {
        let f = &f;
        let lane =
            |lane: u64| scope.spawn(move || (first + lane..end).step_by(threads as usize).map(f).collect());
        let lanes: Vec<std::thread::ScopedJoinHandle<'_, Vec<T>>> = (0..threads).map(lane).collect();
        lanes.into_iter().map(|lane| lane.join().unwrap().into_iter()).collect()
    });
    numbers.map(|n| lanes[((n - first) % threads) as usize].next().unwrap()).collect()
}
