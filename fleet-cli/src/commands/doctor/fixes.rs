//! Whose pose the fixes of each robot are. Pure: fixes and states in.

use super::finding::Finding;
use std::collections::BTreeMap;
use xtb_protocol::Name;
use xtb_protocol::messages::{Fix, RobotState};

/// A fix farther than this from its robot, in m beside three standard deviations of both, is not its own.
const ELSEWHERE_M: f64 = 0.5;
/// A fix as near as this to another robot, in m beside its three standard deviations, is that one's: less
/// than two robots that touch are apart.
const THERE_M: f64 = 0.3;
/// A robot that is less sure of its pose is taken to be as sure as this, in m.
const MOST_SIGMA_M: f64 = 0.3;
/// So many fixes are needed to say anything.
const ENOUGH: u32 = 2;

/// What the fixes of one robot said.
#[derive(Debug, Clone, PartialEq, Default)]
struct Heard {
    fixes: u32,
    /// Of these not where the robot believes itself to be, and how far off the last one was, in m.
    elsewhere: u32,
    off_m: f64,
    /// And where which other robot is.
    at: BTreeMap<Name, u32>,
}

/// The fixes that were heard.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct FixBook(BTreeMap<Name, Heard>);

fn off_m(fix: &Fix, state: &RobotState) -> f64 {
    (fix.x_m - state.pose.x_m).hypot(fix.y_m - state.pose.y_m)
}

impl FixBook {
    /// A fix for `robot` came in while the robots said this of themselves; one that says nothing is left out.
    pub(super) fn hear(&mut self, robot: &Name, fix: &Fix, states: &BTreeMap<Name, RobotState>) {
        let Some(own) = states.get(robot) else { return };
        let heard = self.0.entry(robot.clone()).or_default();
        heard.fixes = heard.fixes.saturating_add(1);
        // While fixes contradict a pose its standard deviation reaches as far as they are off.
        let sigma_m = own.pose.sigma_m.min(MOST_SIGMA_M);
        heard.off_m = off_m(fix, own);
        if heard.off_m <= ELSEWHERE_M + 3.0 * sigma_m.hypot(fix.sigma_m) {
            return;
        }
        heard.elsewhere += 1;
        let others = states.iter().filter(|(name, _)| *name != robot);
        let nearest =
            others.map(|(name, state)| (name, off_m(fix, state))).min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((other, _)) = nearest.filter(|(_, off_m)| *off_m <= THERE_M + 3.0 * fix.sigma_m) {
            *heard.at.entry(other.clone()).or_default() += 1;
        }
    }

    /// Whose pose the fixes of this robot are, if not its own.
    fn follows(&self, robot: &Name) -> Option<&Name> {
        let heard = self.0.get(robot).filter(|heard| heard.fixes >= ENOUGH)?;
        heard.at.iter().find(|(_, fixes)| 2 * **fixes > heard.fixes).map(|(other, _)| other)
    }

    /// What is wrong with them.
    pub(super) fn findings(&self) -> Vec<Finding> {
        let finding = |(robot, heard): (&Name, &Heard)| {
            if let Some(other) = self.follows(robot) {
                let crossed = self.follows(other) == Some(robot);
                let text = match crossed {
                    true => format!("its fixes and those of {other} are swapped: each gets the other's pose"),
                    false => format!("its fixes show the pose of {other}"),
                };
                let hint = "correct the names of the tracker's bodies or tags, or the keys it sends to";
                return Some(Finding::problem("fixes", text, hint.to_owned()).of(robot));
            }
            (heard.fixes >= ENOUGH && 2 * heard.elsewhere > heard.fixes).then(|| {
                let text = format!("its fixes are {:.1} m from its own pose", heard.off_m);
                let hint =
                    format!("check which is right; set its pose with `fleet-cli set-pose {robot} X Y`");
                Finding::problem("fixes", text, hint).of(robot)
            })
        };
        self.0.iter().filter_map(finding).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::{self, name};
    use xtb_protocol::messages::FixSource;

    fn states() -> BTreeMap<Name, RobotState> {
        let at = |(robot, x_m): (&str, f64)| {
            let mut state = fake::state(robot);
            state.pose.x_m = x_m;
            (name(robot), state)
        };
        [("xtb-1", 0.0), ("xtb-2", 3.0), ("xtb-3", 6.0)].map(at).into_iter().collect()
    }

    fn heard(fixes: &[(&str, f64)]) -> Vec<(String, String)> {
        let mut book = FixBook::default();
        for (robot, x_m) in fixes {
            let fix = Fix {
                x_m: *x_m,
                y_m: 0.05,
                yaw_rad: None,
                sigma_m: 0.05,
                sigma_yaw_rad: 0.05,
                source: FixSource::Tags,
                age_ms: 0,
            };
            book.hear(&name(robot), &fix, &states());
        }
        let words = |finding: Finding| (finding.robot.unwrap().to_string(), finding.text);
        book.findings().into_iter().map(words).collect()
    }

    #[test]
    fn two_robots_whose_fixes_are_crossed_are_both_named() {
        let found = heard(&[("xtb-1", 3.0), ("xtb-2", 0.1), ("xtb-1", 2.9), ("xtb-2", 0.0), ("xtb-3", 6.0)]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].0 == "xtb-1" && found[0].1.contains("those of xtb-2 are swapped"), "{found:?}");
        assert!(found[1].0 == "xtb-2" && found[1].1.contains("those of xtb-1 are swapped"), "{found:?}");
    }

    #[test]
    fn fixes_of_one_other_robot_and_of_nobody_are_told_apart() {
        let found = heard(&[("xtb-1", 6.1), ("xtb-1", 6.0), ("xtb-2", -4.0), ("xtb-2", -4.0)]);
        assert_eq!(found[0].1, "its fixes show the pose of xtb-3");
        assert!(found[1].1.starts_with("its fixes are 7.0 m from"), "{found:?}");
    }

    #[test]
    fn good_fixes_and_a_single_outlier_are_no_finding() {
        assert_eq!(heard(&[("xtb-1", 0.1), ("xtb-1", 3.0), ("xtb-1", -0.1), ("xtb-2", 0.0)]), []);
    }
}
