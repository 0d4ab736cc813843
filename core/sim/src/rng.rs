//! Seeded randomness of one truck: a stream of its own, so that neither the number of other trucks
//! nor the order in which they are stepped changes a bit of it.

use rand_core::Rng as _;
use rand_pcg::Pcg32;

/// A stream of random numbers.
#[derive(Debug, Clone)]
pub struct Rng(Pcg32);

impl Rng {
    /// The stream of this number that belongs to the seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        // Streams of one state are correlated; the golden ratio spreads the states as well.
        Self(Pcg32::new(seed ^ (stream + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15), stream))
    }

    /// A stream of its own for a part whose use must not change what the rest draws.
    pub fn fork(&mut self) -> Self {
        Self::new(self.0.next_u64(), self.0.next_u64())
    }

    /// Whether something of this probability happens; certain and impossible things draw nothing.
    pub fn chance(&mut self, probability: f64) -> bool {
        probability > 0.0 && (probability >= 1.0 || self.uniform(0.0, 1.0) < probability)
    }

    /// Uniform in [min, max).
    pub fn uniform(&mut self, min: f64, max: f64) -> f64 {
        min + (max - min) * f64::from(self.0.next_u32()) / 4_294_967_296.0
    }

    /// Uniform in 0..=`max`.
    pub fn up_to(&mut self, max: u64) -> u64 {
        self.uniform(0.0, max as f64 + 1.0) as u64
    }

    /// Bell-shaped with mean 0 and the given standard deviation: the sum of four uniform 16-bit
    /// numbers, which never exceeds 3.5 σ and needs no logarithm.
    pub fn bell(&mut self, sigma: f64) -> f64 {
        const MEAN: f64 = 2.0 * 65_535.0;
        /// √(4 · (65536² − 1) / 12)
        const SIGMA: f64 = 37_837.227_2;
        let bits = self.0.next_u64();
        let sum: u64 = (0..4).map(|i| bits >> (16 * i) & 0xFFFF).sum();
        (sum as f64 - MEAN) / SIGMA * sigma
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bell_has_the_mean_and_deviation_asked_for() {
        let mut rng = Rng::new(1, 2);
        let values: Vec<f64> = (0..20_000).map(|_| rng.bell(3.0)).collect();
        let mean = values.iter().sum::<f64>() / 20_000.0;
        let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 20_000.0;
        assert!(mean.abs() < 0.1, "{mean}");
        assert!((libm::sqrt(variance) - 3.0).abs() < 0.1, "{variance}");
    }

    #[test]
    fn drawing_from_a_fork_leaves_the_rest_as_it_is() {
        let rest = |drawn: usize| {
            let mut rng = Rng::new(7, 0);
            let mut fork = rng.fork();
            for _ in 0..drawn {
                fork.uniform(0.0, 1.0);
            }
            (rng.uniform(0.0, 1.0), fork.uniform(0.0, 1.0))
        };
        assert_eq!(rest(0).0, rest(100).0);
        assert_ne!(rest(0).1, rest(100).1);
        assert_ne!(rest(0).0, rest(0).1);
    }

    #[test]
    fn chances_come_as_often_as_they_should() {
        let mut rng = Rng::new(7, 0);
        let happened = (0..10_000).filter(|_| rng.chance(0.25)).count();
        assert!((2350..2650).contains(&happened), "{happened}");
        assert!(rng.chance(1.0) && !rng.chance(0.0));
    }

    #[test]
    fn streams_differ_and_seeds_reproduce() {
        let draw = |seed, stream| Rng::new(seed, stream).uniform(0.0, 1.0);
        assert_eq!(draw(7, 0), draw(7, 0));
        assert_ne!(draw(7, 0), draw(7, 1));
        assert_ne!(draw(7, 0), draw(8, 0));
    }
}
