//! A converter that hangs, and range finders that hang, have lost their wire or have a short circuit.
//!
//! A frozen range finder is looked for only while the wheels turn. The chance that a good one stays the
//! same for 50 scans: those are at least 39 measurements of its own; with noise of σ = 15 mV, 3 counts,
//! one equals a given count with p ≤ 0.13, so p^39 < 10⁻³⁴.

use super::alarm::{Alarm, Still};
use xtb_control::controller::AdcSample;
use xtb_control::vehicle::{GuardLimits, RangeFinders, SLOTS};
use xtb_control::{AdcCount, Stamp};

/// Channels for the range finders of both bumpers.
const FINDERS: usize = 2 * SLOTS;

#[derive(Debug, Clone, Copy, Default)]
struct Finder {
    /// Scans in a row without a change while the wheels turned.
    same: u32,
    /// Readings in a row that cannot be.
    out_of_range: u32,
}

/// Watches the converter and the range finders on it.
#[derive(Debug, Clone, Default)]
pub(super) struct ConverterMonitor {
    last: Option<AdcSample>,
    still: Still,
    finders: [Finder; FINDERS],
    pub(super) frozen: Alarm,
    pub(super) finder_frozen: Alarm,
    pub(super) finder_out_of_range: Alarm,
}

impl ConverterMonitor {
    /// A scan; `turning` = the wheels turn. Channels without a range finder are not looked at.
    pub(super) fn scan(
        &mut self,
        (limits, fitted): (&GuardLimits, &RangeFinders),
        now: Stamp,
        scan: &AdcSample,
        turning: bool,
    ) {
        let before = self.last.replace(*scan);
        let frozen = self.still.too_long(now, before == Some(*scan), limits.frozen_s);
        self.frozen.set(now, frozen, || "no channel changes".to_owned());
        let old = before.map(|before| readings(&before));
        for (i, reading) in readings(scan).into_iter().enumerate() {
            let bumper = if i < SLOTS { &fitted.front } else { &fitted.rear };
            if bumper.get(i % SLOTS).is_none() {
                continue;
            }
            let same = old.is_some_and(|old| old[i] == reading);
            let possible = (limits.infrared_min_v..=limits.infrared_max_v).contains(&reading.volts());
            let finder = &mut self.finders[i];
            finder.same = if same { finder.same.saturating_add(u32::from(turning)) } else { 0 };
            finder.out_of_range = if possible { 0 } else { finder.out_of_range.saturating_add(1) };
        }
        let Self { finders, finder_frozen, finder_out_of_range, .. } = self;
        let stuck = |finder: &Finder| finder.same >= limits.frozen_scans;
        let impossible = |finder: &Finder| finder.out_of_range >= limits.infrared_scans;
        // While the whole converter hangs, its range finders are not to blame.
        let one_stuck = !frozen && finders.iter().any(stuck);
        finder_frozen.set(now, one_stuck, || names(finders, stuck));
        finder_out_of_range.set(now, finders.iter().any(impossible), || names(finders, impossible));
    }

    pub(super) fn forget(&mut self) {
        (self.last, self.still, self.finders) = (None, Still::default(), [Finder::default(); FINDERS]);
    }
}

fn readings(scan: &AdcSample) -> [AdcCount; FINDERS] {
    std::array::from_fn(|i| if i < SLOTS { scan.ir_front[i] } else { scan.ir_rear[i - SLOTS] })
}

/// Which of them, left to right: "front 3, rear 1".
fn names(finders: &[Finder; FINDERS], which: impl Fn(&Finder) -> bool) -> String {
    let name = |i: usize| format!("{} {}", if i < SLOTS { "front" } else { "rear" }, i % SLOTS + 1);
    let named = finders.iter().enumerate().filter(|(_, finder)| which(finder)).map(|(i, _)| name(i));
    named.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(counts: u16) -> AdcCount {
        AdcCount::try_from(counts).unwrap()
    }

    /// Scan number `i` of range finders that are never the same twice.
    fn lively(i: u16) -> AdcSample {
        let side = [count(60 + i % 7); SLOTS];
        AdcSample { ir_front: side, ir_rear: side, tilt: [count(517); 2], pistons: [count(512); 4] }
    }

    /// The monitor after so many scans, 38 ms apart.
    fn after(scans: u16, turning: bool, scan: impl Fn(u16) -> AdcSample) -> ConverterMonitor {
        let mut monitor = ConverterMonitor::default();
        for i in 0..scans {
            let now = Stamp::from_ms(38 * u64::from(i));
            let (limits, fitted) = (GuardLimits::default(), RangeFinders::default());
            monitor.scan((&limits, &fitted), now, &scan(i), turning);
        }
        monitor
    }

    #[test]
    fn a_converter_whose_channels_all_stand_still_is_frozen_after_a_quarter_of_a_second() {
        assert!(!after(7, false, |_| lively(0)).frozen.is_present());
        let monitor = after(8, false, |_| lively(0));
        assert!(monitor.frozen.is_present());
        let one_moves = |i| AdcSample { tilt: [count(517), count(500 + i)], ..lively(0) };
        assert!(!after(40, false, one_moves).frozen.is_present(), "one channel is enough");
    }

    #[test]
    fn a_range_finder_that_stands_still_while_the_wheels_turn_is_named() {
        let stuck = |i| {
            let mut scan = lively(i);
            scan.ir_front[2] = count(60);
            scan
        };
        assert!(!after(50, true, stuck).finder_frozen.is_present());
        let monitor = after(51, true, stuck);
        assert_eq!(monitor.finder_frozen.words().as_deref(), Some("front 3"));
        assert!(!monitor.frozen.is_present());
        assert!(!after(500, false, stuck).finder_frozen.is_present(), "a truck that stands");
    }

    #[test]
    fn a_broken_wire_and_a_short_circuit_are_named_after_five_scans() {
        let broken = |i| {
            let mut scan = lively(i);
            (scan.ir_front[0], scan.ir_rear[5]) = (count(0), count(1023));
            scan
        };
        assert!(!after(4, false, broken).finder_out_of_range.is_present());
        let monitor = after(5, false, broken);
        assert_eq!(monitor.finder_out_of_range.words().as_deref(), Some("front 1, rear 6"));
    }

    #[test]
    fn a_channel_on_which_no_range_finder_is_fitted_may_show_anything() {
        let mut fitted = RangeFinders::default();
        fitted.front.0.truncate(4);
        let mut monitor = ConverterMonitor::default();
        for i in 0..200_u16 {
            let mut scan = lively(i);
            (scan.ir_front[4], scan.ir_front[5]) = (count(0), count(1023));
            monitor.scan((&GuardLimits::default(), &fitted), Stamp::from_ms(38 * u64::from(i)), &scan, true);
        }
        assert!(!monitor.finder_out_of_range.is_present() && !monitor.finder_frozen.is_present());
    }

    #[test]
    fn whatever_a_range_finder_can_read_is_in_range() {
        // 0.2 V: nothing in sight, with all the noise there is; 2.8 V: the peak at 8 cm with as much.
        let edges = |i: u16| {
            let mut scan = lively(i);
            (scan.ir_front[0], scan.ir_front[1]) = (count(40), count(574));
            scan
        };
        assert!(!after(100, true, edges).finder_out_of_range.is_present());
    }
}
