//! How careful a plan is: levels from most to least, tried one after the other.

use crate::navigator::MARGIN_M;
use crate::navigator::visibility::GOES_ON_M;

/// How careful a plan is.
#[derive(Debug, Clone, Copy)]
pub(super) struct CautionLevel {
    /// Room beside the body, in m.
    pub(super) margin_m: f64,
    /// What was seen goes on so far where nobody has looked, in m.
    pub(super) unseen_m: f64,
    /// As much as the search may cost.
    pub(super) expansions: usize,
}

/// As careful as there is room, least last. A search that finds nothing costs most, so only the last ones may
/// take long: 300 000 expansions are about two seconds on a small computer. The last one is for what the map
/// knows exactly, and never taken past anything that is not on it. The steps in between are chosen, not
/// measured.
pub(super) const CAUTION_LEVELS: [CautionLevel; 5] = [
    CautionLevel { margin_m: MARGIN_M, unseen_m: GOES_ON_M, expansions: 50_000 },
    CautionLevel { margin_m: MARGIN_M, unseen_m: GOES_ON_M / 2.0, expansions: 100_000 },
    CautionLevel { margin_m: MARGIN_M, unseen_m: 0.0, expansions: 100_000 },
    CautionLevel { margin_m: 0.03, unseen_m: 0.0, expansions: 100_000 },
    CautionLevel { margin_m: 0.005, unseen_m: 0.0, expansions: 300_000 },
];
/// The first, which keeps off all that was seen and where it may go on.
pub(super) const MOST_CAREFUL: &CautionLevel = &CAUTION_LEVELS[0];
/// The last one with the whole margin: what was seen is as large as it was seen.
pub(super) const AS_SEEN: usize = 2;
const _: () =
    assert!(CAUTION_LEVELS[AS_SEEN].margin_m >= MARGIN_M && CAUTION_LEVELS[AS_SEEN + 1].margin_m < MARGIN_M);
/// The last, for what the map knows exactly.
pub(super) const LEAST_CAREFUL: &CautionLevel = &CAUTION_LEVELS[CAUTION_LEVELS.len() - 1];

impl CautionLevel {
    /// Whether it keeps [`MARGIN_M`] of room beside the body.
    pub(super) fn keeps_margin(&self) -> bool {
        self.margin_m >= MARGIN_M
    }
}
