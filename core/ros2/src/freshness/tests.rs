//! What a publisher's samples are worth when the network plays tricks.

use super::*;
use proptest::prelude::*;

const A: Gid = Gid([1; 16]);
const MS: i64 = NS_PER_MS;

/// A publisher whose clock is off by this.
struct Publisher {
    sources: Sources,
    off_ms: i64,
}

impl Publisher {
    fn new(off_ms: i64) -> Self {
        Self { sources: Sources::default(), off_ms }
    }

    /// Made and come at these times here.
    fn sample(&mut self, made_ms: i64, came_ms: i64) -> Freshness {
        self.sources.judge(A, came_ms * MS, (made_ms + self.off_ms) * MS)
    }

    /// At 10 Hz, each 5 ms on the way; how many counted.
    fn steady(&mut self, from_ms: i64, to_ms: i64) -> usize {
        let times = (from_ms..to_ms).step_by(100);
        times.filter(|at| self.sample(*at, at + 5) == Freshness::Fresh).count()
    }
}

#[test]
fn a_steady_publisher_counts_after_its_trial() {
    for off_ms in [0, -3_600_000, 3_600_000, 1_700_000_000_000] {
        let mut publisher = Publisher::new(off_ms);
        assert_eq!(publisher.steady(0, 10_000), 98, "clocks off by {off_ms} ms");
        assert_eq!(publisher.sources.counts(), Counts { fresh: 98, on_trial: 2, ..Counts::default() });
    }
}

#[test]
fn a_burst_that_was_held_up_moves_nothing() {
    let mut known = Publisher::new(500_000);
    known.steady(0, 5000);
    // All that was sent for 2 s comes at once, the last of it just made.
    let burst: Vec<_> = (5000..7000).step_by(100).map(|made| known.sample(made, 7000)).collect();
    assert!(!burst.contains(&Freshness::Fresh), "{burst:?}");
    assert_eq!(burst[0], Freshness::Late { ms: 1995 });
    assert_eq!(known.steady(7000, 8000), 8, "and then it goes on as before: trial, then it counts");
}

#[test]
fn nor_does_the_burst_of_one_that_was_never_heard_before() {
    for apart_ms in [5, 20, 50, 100] {
        let mut unknown = Publisher::new(0);
        let burst = (0..2000).step_by(apart_ms).map(|made| unknown.sample(made, 2000));
        assert_eq!(burst.filter(|it| *it == Freshness::Fresh).count(), 0, "each {apart_ms} ms");
        // It trickles in at ten times its pace.
        let mut unknown = Publisher::new(0);
        let trickle = (0..2000).step_by(apart_ms).map(|made| unknown.sample(made, 2000 + made / 10));
        assert_eq!(trickle.filter(|it| *it == Freshness::Fresh).count(), 0, "each {apart_ms} ms");
    }
}

#[test]
fn a_little_jitter_is_nothing_and_a_hold_up_is_named() {
    let mut publisher = Publisher::new(77);
    let jitter = (0..200).map(|i| publisher.sample(i * 100, i * 100 + [5, 60, 20, 100, 5][i as usize % 5]));
    assert_eq!(jitter.filter(|it| *it != Freshness::Fresh).count(), 2, "only the trial");
    assert_eq!(publisher.sample(20_000, 20_200), Freshness::Uneven { ms: 195 });
    assert_eq!(publisher.sample(20_100, 20_205), Freshness::OnTrial);
    assert_eq!(publisher.sample(20_050, 20_210), Freshness::Old);
}

#[test]
fn a_way_that_stays_longer_is_got_used_to() {
    let mut publisher = Publisher::new(0);
    publisher.steady(0, 1000);
    let longer = (10..20).map(|i| publisher.sample(i * 100, i * 100 + 250)).collect::<Vec<_>>();
    assert_eq!(longer[0], Freshness::Uneven { ms: 245 });
    assert_eq!(longer.iter().filter(|it| **it == Freshness::Fresh).count(), 8);
}

#[test]
fn a_clock_that_is_set_counts_again_at_once_or_after_a_minute() {
    let mut publisher = Publisher::new(0);
    publisher.steady(0, 1000);
    publisher.off_ms = 5000;
    assert_eq!(publisher.steady(1000, 2000), 8, "forward: one is uneven, then the trial");
    publisher.off_ms = 0;
    assert_eq!(publisher.steady(2000, 61_000), 0, "back: late");
    assert!(publisher.steady(61_000, 64_000) > 8, "until the old offset is forgotten");
}

#[test]
fn who_has_been_silent_longest_is_forgotten_first() {
    let mut sources = Sources::default();
    let gid = |i: u8| Gid([i; 16]);
    for i in 0..MOST as u8 + 1 {
        sources.judge(gid(i), i64::from(i) * MS, 0);
    }
    assert_eq!((sources.sources.len(), sources.counts().forgotten), (MOST, 1));
    assert!(!sources.sources.contains_key(&gid(0)) && sources.sources.contains_key(&gid(1)));
    sources.forget(&gid(1));
    assert_eq!(sources.sources.len(), MOST - 1);
}

proptest! {
    #[test]
    fn clocks_do_not_matter(off_ms in -1_000_000_000_000..1_000_000_000_000_i64, ways in prop::collection::vec(0..600_i64, 1..100)) {
        let mut here = Publisher::new(0);
        let mut there = Publisher::new(off_ms);
        let mut came_ms = 0;
        for (i, way_ms) in ways.into_iter().enumerate() {
            let made_ms = i as i64 * 50;
            came_ms = came_ms.max(made_ms + way_ms);
            prop_assert_eq!(here.sample(made_ms, came_ms), there.sample(made_ms, came_ms));
        }
    }

    #[test]
    fn no_times_panic(samples in prop::collection::vec((any::<u8>(), any::<i64>(), any::<i64>()), 0..100)) {
        let mut sources = Sources::default();
        for (gid, arrival_ns, source_ns) in samples {
            sources.judge(Gid([gid % 3; 16]), arrival_ns, source_ns);
        }
    }
}
