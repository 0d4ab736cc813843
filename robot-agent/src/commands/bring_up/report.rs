//! What the steps have come to: the progress that a later run goes on from, and the report that can be sent to others.
//!
//! One file for both, `robot.bring-up.json` beside `robot.toml`, and the same in words, `robot.bring-up.txt`. Neither
//! ports nor paths of this computer stand in it.

use super::plan::Step;
use crate::commands::columns;
use serde::{Deserialize, Serialize};
use xtb_control::VehicleConfig;

/// Version of the file.
const FORMAT: u32 = 1;

/// How a step ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Outcome {
    Passed,
    Failed,
    /// Left out, to be done later.
    Skipped,
    /// The truck does without.
    NotFitted,
}

impl Outcome {
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::Passed => "ok",
            Self::Failed => "FAILED",
            Self::Skipped => "skipped",
            Self::NotFitted => "not fitted",
        }
    }

    /// Nothing is left to do.
    fn is_well(self) -> bool {
        matches!(self, Self::Passed | Self::NotFitted)
    }
}

/// A step that has been tried.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Entry {
    step: String,
    title: String,
    outcome: Outcome,
    /// What was seen, or what is wrong.
    detail: String,
    /// What to do about it.
    hint: String,
    /// When, in UTC.
    at: String,
    /// How often it has been tried.
    tries: u32,
}

/// A bring-up so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct Report {
    format: u32,
    robot: String,
    /// Of robot-agent.
    version: String,
    /// The board's.
    firmware: Option<String>,
    /// Every step of this vehicle has passed, or is not fitted.
    complete: bool,
    /// Settings of the vehicle that are not the default.
    vehicle: Vec<String>,
    steps: Vec<Entry>,
    /// Names of all steps of this vehicle, in their order.
    plan: Vec<String>,
    /// Not for others: ports and folders, which are replaced by their names.
    #[serde(skip)]
    private: Vec<(String, &'static str)>,
    #[serde(skip)]
    now: String,
}

impl Report {
    /// Nothing has been done.
    pub(super) fn new(robot: &str, version: &str) -> Self {
        Self {
            format: FORMAT,
            robot: robot.into(),
            version: version.into(),
            firmware: None,
            complete: false,
            vehicle: Vec::new(),
            steps: Vec::new(),
            plan: Vec::new(),
            private: Vec::new(),
            now: String::new(),
        }
    }

    /// As it was written.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub(super) fn read(text: &str) -> Result<Self, String> {
        let report: Self = serde_json::from_str(text).map_err(|error| error.to_string())?;
        if report.format != FORMAT {
            return Err(format!("its format is {}, this program knows {FORMAT}", report.format));
        }
        Ok(report)
    }

    /// What this run is about.
    pub(super) fn begin(&mut self, version: &str, vehicle: &VehicleConfig, plan: &[Step]) {
        self.version = version.into();
        self.plan = plan.iter().map(|step| step.id()).collect();
        let usual = VehicleConfig::default().parameters();
        let differs = |(own, usual): &(_, xtb_control::config::Parameter)| {
            let own: &xtb_control::config::Parameter = own;
            own.value != usual.value
        };
        let own = vehicle.parameters().into_iter().zip(usual).filter(differs);
        self.vehicle = own.map(|(own, _)| format!("{} = {}", own.name, own.value)).collect();
        self.complete = self.is_complete();
    }

    /// This text is called so in the report.
    pub(super) fn keep_private(&mut self, text: &str, name: &'static str) {
        if !text.is_empty() {
            self.private.push((text.into(), name));
            self.private.sort_by_key(|(text, _)| std::cmp::Reverse(text.len()));
        }
    }

    /// The moment of what is noted next.
    pub(super) fn at(&mut self, now: &str) {
        now.clone_into(&mut self.now);
    }

    pub(super) fn firmware(&mut self, firmware: &str) {
        if self.firmware.as_deref() != Some(firmware) {
            self.firmware = Some(firmware.to_owned());
        }
    }

    /// A step has come to this; in the place of what it came to before.
    pub(super) fn note(&mut self, step: Step, outcome: Outcome, detail: &str, hint: &str) {
        let public = |text: &str| {
            self.private
                .iter()
                .fold(text.to_owned(), |text, (private, name)| text.replace(private.as_str(), name))
        };
        let (id, detail, hint) = (step.id(), public(detail), public(hint));
        let before = self.steps.iter().position(|entry| entry.step == id).map(|at| self.steps.remove(at));
        let tries = before.map_or(0, |before| before.tries) + 1;
        let (title, at) = (step.title(), self.now.clone());
        self.steps.push(Entry { step: id, title, outcome, detail, hint, at, tries });
        let place = |entry: &Entry| self.plan.iter().position(|id| *id == entry.step).unwrap_or(usize::MAX);
        self.steps.sort_by_key(place);
        self.complete = self.is_complete();
    }

    /// Nothing is left to do for this step.
    pub(super) fn is_well(&self, id: &str) -> bool {
        self.steps.iter().any(|entry| entry.step == id && entry.outcome.is_well())
    }

    /// Nothing is left to do.
    pub(super) fn is_complete(&self) -> bool {
        self.plan.iter().all(|id| self.is_well(id))
    }

    /// For a file.
    pub(super) fn json(&self) -> String {
        serde_json::to_string_pretty(self).unwrap_or_default() + "\n"
    }

    /// For people.
    pub(super) fn text(&self) -> String {
        let firmware = self.firmware.as_deref().unwrap_or("not seen");
        let mut text = format!(
            "Bring-up of {}: robot-agent {}, board firmware {firmware}\n\n",
            self.robot, self.version
        );
        let heading = ["STEP", "RESULT", "WHAT WAS SEEN", "WHEN (UTC)"].map(str::to_owned).to_vec();
        let row = |id: &String| match self.steps.iter().find(|entry| entry.step == *id) {
            Some(entry) => {
                let Entry { outcome, detail, at, .. } = entry;
                vec![id.clone(), outcome.words().into(), detail.replace('\n', ";"), at.clone()]
            }
            None => vec![id.clone(), "open".into(), String::new(), String::new()],
        };
        text += &columns(&[heading].into_iter().chain(self.plan.iter().map(row)).collect::<Vec<_>>());
        for entry in self.steps.iter().filter(|entry| entry.outcome == Outcome::Failed) {
            text += &format!("\n{}: {}\n  {}\n", entry.step, entry.detail, entry.hint);
        }
        if !self.vehicle.is_empty() {
            text += &format!("\nSettings that are not the default:\n  {}\n", self.vehicle.join("\n  "));
        }
        let open = self.plan.iter().filter(|id| !self.is_well(id)).count();
        text + &match open {
            0 => "\nall steps passed\n".to_owned(),
            open => format!("\n{open} of {} steps are open\n", self.plan.len()),
        }
    }
}
