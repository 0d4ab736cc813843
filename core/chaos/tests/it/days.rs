//! The simulator of bad days: no rule is broken, every rule of the agent is needed, and a seed is a
//! history. The example `bad_days` runs more of them.

use crate::draw::in_parallel;
use xtb_chaos::{DayReport, ScenarioOptions};
use xtb_robot::{Guard, Guards};

/// Days that a run of the tests goes through, unless `XTB_DAYS` says otherwise (CI: 2,500).
const DAYS: u64 = 500;
/// Days within which a missing rule has to be noticed.
const NOTICED: u64 = 300;

fn days_to_go() -> u64 {
    std::env::var("XTB_DAYS").ok().and_then(|days| days.parse().ok()).unwrap_or(DAYS)
}

fn day(seed: u64) -> DayReport {
    xtb_chaos::run(seed, ScenarioOptions::default()).unwrap()
}

#[test]
fn bad_days_break_no_rule() {
    let wanted = days_to_go();
    let reports = in_parallel(0..wanted, day);
    let broken: Vec<_> = reports.iter().filter(|report| report.violation.is_some()).collect();
    assert!(broken.is_empty(), "{} of {wanted} days, the first:\n{}", broken.len(), broken[0]);
    let mut total = xtb_chaos::DayCounts::default();
    reports.iter().for_each(|report| total += report.counts);
    // The days are bad, but something happens in them.
    assert!(total.goals > wanted && total.obeyed > 10 * wanted && total.boots > wanted, "{total}");
    assert!(total.driven > 1000 * wanted && total.estops > wanted && total.lost > wanted, "{total}");
}

/// What the oracle once took for broken rules: a lease that was granted in the turn in which the clock went back,
/// a reset of nothing while somebody drives, a repeated emergency stop, reset long ago, ahead of a new one, a
/// stick at rest that came over a lossy line, one that was read at rest within the receiver's jitter, one that was
/// pushed in the turn of a reset, a gyro that repeats itself but was not plugged in, one that did so while the loop was
/// held up, a lease that its holder asked for again as it did not know of the grant, a takeover that the board told
/// of only after it was set up again, when the lease had expired, a range finder that repeats itself after another one
/// did, wheels that turn by themselves before an encoder that tells nonsense, and a battery that had not been empty for
/// long enough when the clock went back.
#[test]
fn days_that_the_oracle_misread_break_no_rule() {
    let seeds = [
        100_785, 108_462, 201_615, 208_263, 307_030, 1_202_447, 1_226_497, 1_237_461, 1_238_156, 1_261_099,
        1_267_643, 1_269_138, 1_278_838, 1_295_312, 1_299_630,
    ];
    for seed in seeds {
        let report = day(seed);
        assert!(report.violation.is_none(), "{report}");
    }
}

/// The battery was empty; then the robot's clock went back, and the robot thought no worse of it for two seconds.
#[test]
fn an_empty_battery_stops_a_robot_whose_clock_has_gone_back() {
    let report = day(308_313);
    assert!(report.violation.is_none(), "{report}");
}

/// The loop was held up, and the stick was not where it had been: at rest in frames that waited in the line, pushed since;
/// held all the time, the board away for a while; pushed meanwhile.
#[test]
fn a_stick_that_is_pushed_after_a_stalled_loop_does_not_drive() {
    for seed in [1_251_951, 1_271_804, 1_272_623] {
        let report = day(seed);
        assert!(report.violation.is_none(), "{report}");
    }
}

#[test]
fn a_joystick_of_which_only_a_late_setpoint_tells_that_it_is_held_does_not_drive() {
    let report = day(1_400_087);
    assert!(report.violation.is_none(), "{report}");
}

#[test]
fn a_seed_is_one_history_whatever_else_runs() {
    let alone: Vec<DayReport> = (0..8).map(day).collect();
    assert_eq!(in_parallel(0..8, day), alone);
    let mut side_by_side = Vec::new();
    xtb_chaos::run_all(0..8, ScenarioOptions::default(), |_, day| side_by_side.push(day.unwrap()));
    side_by_side.sort_by_key(|report| report.seed);
    assert_eq!(side_by_side, alone);
    let mut hashes: Vec<u64> = alone.iter().map(|report| report.hash).collect();
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 8);
}

#[test]
fn every_rule_that_is_switched_off_is_found_out() {
    let find = |i: u64| {
        let guard = Guard::ALL[i as usize];
        let options = ScenarioOptions { guards: Guards::without(guard) };
        let broken = |seed: &u64| xtb_chaos::run(*seed, options).unwrap().violation.is_some();
        (guard, (0..NOTICED).find(broken))
    };
    let found = in_parallel(0..Guard::ALL.len() as u64, find);
    let missed: Vec<_> = found.iter().filter(|(_, seed)| seed.is_none()).collect();
    assert!(missed.is_empty(), "no day of {NOTICED} notices that these are missing: {missed:?}");
}
