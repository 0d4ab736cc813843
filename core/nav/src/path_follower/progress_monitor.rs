//! Whether it gets anywhere: wheels that do not turn although they are asked to, and wheels that turn in
//! vain.

use super::{FollowerSettings, Stuck};
use xtb_control::Stamp;

/// Since when nothing has happened.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct ProgressMonitor {
    still_since: Option<Stamp>,
    /// When the last progress was made, and how far it was then.
    progress: Option<(Stamp, f64)>,
}

impl ProgressMonitor {
    /// Asked to drive (or not), at this speed, so far along the path.
    pub(super) fn step(
        &mut self,
        settings: &FollowerSettings,
        now: Stamp,
        asked: bool,
        speed_mps: f64,
        way_m: f64,
    ) -> Option<Stuck> {
        if !asked {
            *self = Self::default();
            return None;
        }
        if speed_mps.abs() >= settings.standing_mps {
            self.still_since = None;
        } else if now.since_s(*self.still_since.get_or_insert(now)) >= settings.no_motion_s {
            return Some(Stuck::NoMotion);
        }
        let (at, far_m) = *self.progress.get_or_insert((now, way_m));
        if way_m - far_m >= settings.progress_m {
            self.progress = Some((now, way_m));
        } else if now.since_s(at) >= settings.no_progress_s {
            return Some(Stuck::NoProgress);
        }
        None
    }
}

/// How long it has stood.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StandstillDetector {
    since: Option<Stamp>,
}

impl StandstillDetector {
    /// Whether it stands for good.
    pub(super) fn step(&mut self, settings: &FollowerSettings, now: Stamp, speed_mps: f64) -> bool {
        if speed_mps.abs() >= settings.standing_mps {
            self.since = None;
            return false;
        }
        now.since_s(*self.since.get_or_insert(now)) >= settings.standing_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_that_do_not_turn_are_no_motion_and_wheels_that_turn_in_vain_no_progress() {
        let (settings, mut watch) = (FollowerSettings::default(), ProgressMonitor::default());
        let mut at = |s: f64, asked, speed_mps, way_m| {
            watch.step(&settings, Stamp::from_s(s), asked, speed_mps, way_m)
        };
        assert_eq!(at(0.0, true, 0.0, 1.0), None);
        assert_eq!(at(1.9, true, 0.0, 1.0), None);
        assert_eq!(at(2.1, true, 0.0, 1.0), Some(Stuck::NoMotion));
        assert_eq!(at(2.2, true, 0.1, 1.01), None);
        assert_eq!(at(6.1, true, 0.1, 1.01), Some(Stuck::NoProgress));
        assert_eq!(at(6.2, false, 0.1, 1.01), None);
        assert_eq!(at(6.3, true, 0.1, 1.01), None, "begins anew");
    }

    #[test]
    fn standing_takes_two_windows_of_the_encoder() {
        let (settings, mut standing) = (FollowerSettings::default(), StandstillDetector::default());
        let mut at = |ms, speed_mps| standing.step(&settings, Stamp::from_ms(ms), speed_mps);
        assert!(!at(0, 0.1) && !at(10, 0.0) && !at(100, 0.005) && at(140, 0.0));
        assert!(!at(150, -0.02) && !at(160, 0.0));
    }
}
