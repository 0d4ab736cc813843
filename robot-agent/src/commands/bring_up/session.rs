//! A bring-up as a state machine: events in, what to say and to do next out. No clock, no lines, no files.
//!
//! ```text
//!   step ─► stage ─► stage ─► … ─► passed ──────────────────────────────┐
//!             │ wrong, not seen, line lost ─► failed ─ again? ─► the step │
//!             │ skip                            └─ skip, quit            ▼
//!             └──────────────────────────────────────────────────► next step … end
//! ```
//! What a step has come to is noted at once, so that a bring-up that is broken off goes on there.

use super::detect::{
    Centred, Clear, Detector, Held, Level, Measured, Pushed, Seen, Stop, Switched, Tilted, Turned,
    TurnedRight, Up, View,
};
use super::dialogue::{Chore, Motion, Question, Reply, Verdict, Wrong};
use super::plan::{Place, Step};
use super::report::{Outcome, Report};
use std::collections::VecDeque;
use xtb_control::VehicleConfig;
use xtb_control::calibration::{Actuator, ActuatorKind};

/// The board has so long to come up.
const COMES_UP_S: f64 = 8.0;
/// A line that is broken for longer ends the step.
const LOST_S: f64 = 1.0;

/// What has happened.
#[derive(Debug)]
pub(super) enum Event {
    Begin,
    /// A turn of the lines.
    Look(Box<View>),
    /// A line was typed.
    Typed(String),
    /// Nobody can type any more.
    InputEnded,
    /// What [`Then::Check`], [`Then::Move`], [`Then::Calibrate`] or [`Then::Write`] has come to.
    Did(Verdict),
}

/// What comes next.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Then {
    /// Look at the lines, and hear what is typed; hands shall do this.
    Look(Chore),
    /// The same as before.
    GoOn,
    /// Wait for a line.
    Answer(Question),
    /// Wait for again, skip or quit.
    Decide,
    /// Look at everything at rest.
    Check,
    Move(Motion),
    Calibrate(Actuator),
    /// Write these settings of the geometry, in m.
    Write(Vec<(&'static str, f64)>),
    End,
}

/// What to say, and what to do then.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Next {
    pub(super) say: String,
    /// The report has changed.
    pub(super) note: bool,
    pub(super) then: Then,
}

/// A part of a step.
enum Stage {
    Look(Chore, Box<dyn Detector>, f64),
    /// The voltage has to be known first.
    Voltmeter,
    Ask(Question),
    Check,
    Move(Motion),
    Calibrate(Actuator),
    /// What has been answered so far.
    Write,
}

/// What the machine waits for.
enum Waits {
    /// A stage to end.
    Stage {
        began_s: Option<f64>,
        lost_s: Option<f64>,
    },
    /// A person to decide after a failure.
    Decision,
    Nothing,
}

/// A bring-up under way.
pub(super) struct Session {
    vehicle: VehicleConfig,
    report: Report,
    patience_s: f64,
    /// Still to be done, in their order.
    open: VecDeque<Step>,
    current: Option<Step>,
    stages: VecDeque<Stage>,
    waits: Waits,
    /// What the stages of this step have found.
    found: Vec<String>,
    lengths: Vec<(&'static str, f64)>,
    battery_v: f64,
    input_ended: bool,
}

impl Session {
    /// These steps one after the other; what they come to goes into the report.
    ///
    /// Hands have `patience_s` for what they are asked for.
    pub(super) fn new(
        vehicle: VehicleConfig,
        report: Report,
        steps: impl IntoIterator<Item = Step>,
        patience_s: f64,
    ) -> Self {
        Self {
            vehicle,
            report,
            patience_s,
            open: steps.into_iter().collect(),
            current: None,
            stages: Default::default(),
            waits: Waits::Nothing,
            found: Vec::new(),
            lengths: Vec::new(),
            battery_v: 0.0,
            input_ended: false,
        }
    }

    pub(super) fn report(&self) -> &Report {
        &self.report
    }

    pub(super) fn report_mut(&mut self) -> &mut Report {
        &mut self.report
    }

    /// The only way in.
    pub(super) fn on(&mut self, event: Event) -> Next {
        match event {
            Event::Begin => self.next_step(String::new()),
            Event::Look(view) => self.look(&view),
            Event::Typed(line) => self.typed(&line),
            Event::InputEnded => self.input_ended(),
            Event::Did(Ok(found)) => self.stage_done(found),
            Event::Did(Err(wrong)) => self.failed(wrong),
        }
    }

    fn next_step(&mut self, said: String) -> Next {
        let Some(step) = self.open.pop_front() else {
            self.current = None;
            self.waits = Waits::Nothing;
            return Next { say: said, note: true, then: Then::End };
        };
        self.current = Some(step);
        let mut next = self.begin_step(step);
        (next.say, next.note) = (said + &next.say, true);
        next
    }

    fn begin_step(&mut self, step: Step) -> Next {
        self.found.clear();
        self.lengths.clear();
        self.stages = stages(step, &self.vehicle, self.patience_s).into();
        let heading = format!("\n[{}] {}\n", step.id(), step.title());
        let mut next = self.begin_stage();
        next.say = heading + &next.say;
        next
    }

    fn begin_stage(&mut self) -> Next {
        self.waits = Waits::Stage { began_s: None, lost_s: None };
        let (say, then) = match self.stages.front() {
            None => return self.passed(),
            Some(Stage::Look(chore, ..)) => {
                let text = chore.text();
                (if text.is_empty() { text } else { text + "\n" }, Then::Look(*chore))
            }
            Some(Stage::Voltmeter) => {
                let question = Question::Voltmeter { board_v: self.battery_v };
                (question.text(), Then::Answer(question))
            }
            Some(Stage::Ask(question)) => (question.text(), Then::Answer(question.clone())),
            Some(Stage::Check) => {
                ("Let it stand still, nothing within 60 cm of the bumpers.\n".into(), Then::Check)
            }
            Some(Stage::Move(motion)) => (String::new(), Then::Move(*motion)),
            Some(Stage::Calibrate(actuator)) => (String::new(), Then::Calibrate(*actuator)),
            Some(Stage::Write) if self.lengths.is_empty() => {
                return self.stage_done("as in the settings".into());
            }
            Some(Stage::Write) => (String::new(), Then::Write(self.lengths.clone())),
        };
        Next { say, note: false, then }
    }

    fn stage_done(&mut self, found: String) -> Next {
        if !found.is_empty() {
            self.found.push(found);
        }
        self.stages.pop_front();
        self.begin_stage()
    }

    fn passed(&mut self) -> Next {
        let found = self.found.join("; ");
        self.note(Outcome::Passed, &found, "");
        self.next_step(format!("  ok: {found}\n"))
    }

    fn ended(&mut self, outcome: Outcome, detail: &str) -> Next {
        self.note(outcome, detail, "");
        self.next_step(format!(
            "  {}{}{detail}\n",
            outcome.words(),
            if detail.is_empty() { "" } else { ": " }
        ))
    }

    fn failed(&mut self, wrong: Wrong) -> Next {
        let Wrong { what, hint } = wrong;
        self.note(Outcome::Failed, &what, &hint);
        let said = format!("  FAILED: {what}\n  {hint}\n");
        if self.input_ended {
            return self.next_step(said);
        }
        self.waits = Waits::Decision;
        Next { say: said + "[again/skip/quit] ", note: true, then: Then::Decide }
    }

    fn note(&mut self, outcome: Outcome, detail: &str, hint: &str) {
        if let Some(step) = self.current {
            self.report.note(step, outcome, detail, hint);
        }
    }

    fn look(&mut self, view: &View) -> Next {
        self.battery_v = view.battery_v.unwrap_or(self.battery_v);
        if let Some(firmware) = &view.firmware {
            self.report.firmware(firmware);
        }
        let go_on = Next { say: String::new(), note: false, then: Then::GoOn };
        let Waits::Stage { began_s, lost_s } = &mut self.waits else { return go_on };
        let Some(Stage::Look(_, detector, patience_s)) = self.stages.front_mut() else { return go_on };
        let waited_s = view.now_s - *began_s.get_or_insert(view.now_s);
        let gyro_fault = view.gyro_fault.as_ref().filter(|_| self.current == Some(Step::Yaw));
        let fault = view.fault.as_ref().or(gyro_fault);
        *lost_s = fault.map(|_| lost_s.unwrap_or(view.now_s));
        // A board that comes up may take its time.
        let most_s = if self.current == Some(Step::Board) { COMES_UP_S } else { LOST_S };
        let lost = lost_s.is_some_and(|since_s| view.now_s - since_s >= most_s);
        match (detector.look(view), fault) {
            (Seen::Done(Ok(found)), _) => self.stage_done(found),
            (Seen::Done(Err(wrong)), _) => self.failed(wrong),
            (Seen::NotFitted(why), _) => self.ended(Outcome::NotFitted, why),
            (_, Some(fault)) if lost || waited_s > *patience_s => {
                let fault = fault.clone();
                self.failed(fault)
            }
            (_, None) if waited_s > *patience_s => {
                let missing = detector.missing();
                self.failed(missing)
            }
            (Seen::Note(note), _) => Next { say: format!("  {note}\n"), ..go_on },
            (Seen::Nothing, _) => go_on,
        }
    }

    fn typed(&mut self, line: &str) -> Next {
        let word = line.trim().to_lowercase();
        let wait = |say: &str, then| Next { say: say.to_owned(), note: false, then };
        if word == "quit" {
            self.open.clear();
            return self.next_step("Broken off. The same command goes on here.\n".into());
        }
        match (&self.waits, self.stages.front(), word.as_str()) {
            (Waits::Nothing, ..) => wait("", Then::GoOn),
            (Waits::Decision, _, "again") => match self.current {
                Some(step) => self.begin_step(step),
                None => wait("", Then::GoOn),
            },
            (Waits::Decision, _, "skip") => self.next_step(String::new()),
            (Waits::Decision, ..) => wait("again, skip or quit: ", Then::Decide),
            (_, Some(Stage::Look(_, detector, _)), "failed") => {
                let missing = detector.missing();
                self.failed(missing)
            }
            (_, Some(Stage::Look(..)), "skip") => self.ended(Outcome::Skipped, ""),
            (_, Some(Stage::Look(..)), _) => {
                wait("  watching; skip, failed (it is not seen), or quit\n", Then::GoOn)
            }
            (_, Some(Stage::Ask(question)), _) => self.answered(question.clone(), line),
            (_, Some(Stage::Voltmeter), _) => {
                self.answered(Question::Voltmeter { board_v: self.battery_v }, line)
            }
            _ => wait("", Then::GoOn),
        }
    }

    fn answered(&mut self, question: Question, line: &str) -> Next {
        match question.judge(line) {
            Reply::Go(found) => self.stage_done(found),
            Reply::Wrong(wrong) => self.failed(wrong),
            Reply::NotFitted => self.ended(Outcome::NotFitted, ""),
            Reply::Skip => self.ended(Outcome::Skipped, ""),
            Reply::Set(key, value) => {
                self.lengths.push((key, value));
                self.stage_done(String::new())
            }
            Reply::Again(what) => {
                Next { say: format!("  {what}: "), note: false, then: Then::Answer(question) }
            }
        }
    }

    /// Watching goes on; what needs an answer is over.
    fn input_ended(&mut self) -> Next {
        self.input_ended = true;
        match (&self.waits, self.stages.front()) {
            (Waits::Stage { .. }, Some(Stage::Look(..))) => {
                Next { say: String::new(), note: false, then: Then::GoOn }
            }
            _ => {
                self.open.clear();
                self.next_step("\nThe input ended. The same command goes on here.\n".into())
            }
        }
    }
}

/// Range finders that fold back beyond 20 cm are tried farther off.
fn hold_cm(place: Place, vehicle: &VehicleConfig) -> f64 {
    let finder = place.finders(vehicle).get(place.slot);
    let folds_cm = finder.map_or(0.0, |finder| finder.curve.folds_cm(&vehicle.obstacle));
    if folds_cm > 18.0 { 35.0 } else { 20.0 }
}

fn stages(step: Step, vehicle: &VehicleConfig, patience_s: f64) -> Vec<Stage> {
    let look = |chore, detector: Box<dyn Detector>| Stage::Look(chore, detector, patience_s);
    match step {
        Step::Board => vec![Stage::Look(Chore::Wait, Box::<Up>::default(), COMES_UP_S)],
        Step::Check => vec![Stage::Check],
        Step::Measures => lengths(vehicle).map(Stage::Ask).into_iter().chain([Stage::Write]).collect(),
        Step::Battery => {
            vec![Stage::Look(Chore::Wait, Box::<Measured>::default(), COMES_UP_S), Stage::Voltmeter]
        }
        Step::Range(place) => {
            let cm = hold_cm(place, vehicle);
            let clear = || Box::new(Clear::new(place, 1.75 * cm));
            let held = Box::new(Held::new(place, 1.75 * cm));
            vec![
                look(Chore::Wait, clear()),
                look(Chore::HoldBefore { place, cm }, held),
                look(Chore::TakeAway, clear()),
            ]
        }
        Step::Encoder => vec![look(Chore::TurnWheels, Box::new(Turned::new(vehicle)))],
        Step::Pitch | Step::Roll => {
            let (axis, chore) = if step == Step::Pitch { (0, Chore::LiftNose) } else { (1, Chore::LiftLeft) };
            vec![
                look(Chore::Wait, Box::<Level>::default()),
                look(chore, Box::new(Tilted::new(axis))),
                look(Chore::PutDown, Box::<Level>::default()),
            ]
        }
        Step::Yaw => vec![look(Chore::TurnRight, Box::new(TurnedRight::new(vehicle)))],
        Step::Stick(stick) => vec![
            look(Chore::LetGo, Box::<Centred>::default()),
            look(Chore::Push(stick), Box::new(Pushed::new(stick, vehicle))),
        ],
        Step::Selector => vec![look(Chore::Selector, Box::<Switched>::default())],
        Step::EmergencyStop => vec![
            look(Chore::PressStop, Box::new(Stop::new(true))),
            look(Chore::ReleaseStop, Box::new(Stop::new(false))),
        ],
        Step::Servo(actuator) => {
            let motion = Motion::Servo(actuator);
            let mut stages = vec![Stage::Ask(Question::Ready(actuator)), Stage::Move(motion)];
            // A piston has a sensor of its own.
            if !matches!(actuator.kind(), ActuatorKind::Piston(_)) {
                stages.push(Stage::Ask(Question::Direction(motion)));
            }
            stages
        }
        Step::Motor { astern } => {
            let motion = Motion::Motor { astern };
            let ask = |question| Stage::Ask(question);
            vec![ask(Question::WheelsUp { astern }), Stage::Move(motion), ask(Question::Direction(motion))]
        }
        Step::Calibrate(actuator) => {
            vec![Stage::Ask(Question::Calibrate(actuator)), Stage::Calibrate(actuator)]
        }
    }
}

fn lengths(vehicle: &VehicleConfig) -> [Question; 5] {
    let geometry = &vehicle.geometry;
    [
        ("wheelbase (hub to hub)", "wheelbase_m", geometry.wheelbase_m),
        ("track (middle of tyre to middle of tyre)", "track_m", geometry.track_m),
        ("body length, bumper to bumper", "body_length_m", geometry.body_length_m),
        ("body width, the widest of tyres and body", "body_width_m", geometry.body_width_m),
        ("wheel diameter, loaded", "wheel_diameter_m", geometry.wheel_diameter_m),
    ]
    .map(|(name, key, now_m)| Question::Length { name, key, now_m })
}
