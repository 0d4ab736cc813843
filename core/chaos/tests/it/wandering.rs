//! Robots that wander among robots that are led. `XTB_WANDERING=50` tries 50 seeds instead of 4.

use crate::lifelong::Fleet;

const ROOM: &str = "[room]\nwidth_m = 10.0\ndepth_m = 10.0\n";
const ROBOTS: usize = 12;

/// Who touched another robot in 5 minutes in which every other robot wanders and the rest always has a goal. A wall
/// beside a wandering robot is the memorandum's: it looks ahead and astern only.
fn touched(seed: u64) -> Vec<String> {
    let mut fleet = Fleet::new(ROOM, ROBOTS, seed, true);
    (0..ROBOTS).step_by(2).for_each(|index| fleet.drive.wander(index));
    fleet.run(300.0, true, &mut |_, _| {});
    assert!(fleet.life.reached > 5, "{} goals reached", fleet.life.reached);
    let at = |line: &String| line.split(" s ").next().map(str::to_owned);
    let touched = &fleet.life.touched;
    let is_of_two = |line: &&String| touched.iter().filter(|other| at(other) == at(line)).count() > 1;
    touched.iter().filter(is_of_two).cloned().collect()
}

#[test]
fn robots_that_wander_touch_nobody_who_is_led() {
    let seeds = std::env::var("XTB_WANDERING").ok().and_then(|count| count.parse().ok()).unwrap_or(4);
    for seed in 201..201 + seeds {
        assert_eq!(touched(seed), Vec::<String>::new(), "seed {seed}");
    }
}
