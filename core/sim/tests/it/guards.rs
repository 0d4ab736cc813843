//! Every guard of sensors, drive and battery sees its fault in time on a truck that drives, and none
//! sees one where there is none. The example `guard_table` prints the figures.

use crate::hazards::HAZARDS;

#[test]
fn each_hazard_has_its_name_and_a_neutral_motor_within_its_time() {
    for hazard in &HAZARDS {
        for (seed, outcome) in hazard.measure(100).into_iter().enumerate() {
            for (what, ms) in [("named", outcome.named_ms), ("neutral", outcome.neutral_ms)] {
                let in_time = ms.is_some_and(|ms| ms <= hazard.limit_ms);
                assert!(in_time, "{}, seed {seed}: {what} after {ms:?} ms", hazard.name);
            }
        }
    }
}
