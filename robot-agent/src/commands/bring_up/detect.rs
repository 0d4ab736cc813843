//! Has the sensor seen what the hands did? One look each turn; no clock, no lines.
//!
//! Each of these decides by itself when it has seen enough, and names what was seen instead: a neighbour that
//! answers, an axis that turns the wrong way. What sees nothing is given up by the session.

mod moved;

pub(super) use moved::{Centred, Level, Pushed, Stop, Switched, Tilted, Turned, TurnedRight};

use super::dialogue::{Verdict, Wrong};
use super::plan::Place;
use xtb_control::vehicle::SLOTS;

/// What one turn of the lines has shown; `None` = not heard lately.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct View {
    pub(super) now_s: f64,
    /// The board speaks and has confirmed its set-up.
    pub(super) is_up: bool,
    /// What is wrong with the board's line, and with the gyro.
    pub(super) fault: Option<Wrong>,
    pub(super) gyro_fault: Option<Wrong>,
    /// Version of the board's firmware.
    pub(super) firmware: Option<String>,
    pub(super) stop_pressed: Option<bool>,
    /// Front and rear, from the left; `None` inside = nothing in range.
    pub(super) ranges_cm: Option<[[Option<f64>; SLOTS]; 2]>,
    /// Of the newest encoder window.
    pub(super) pulses: Option<u16>,
    pub(super) tilt_deg: Option<[f64; 2]>,
    /// Clockwise.
    pub(super) yaw_deg: Option<f64>,
    /// Pulses of the receiver's sticks, in ms; `None` inside = no usable pulse.
    pub(super) sticks_ms: Option<[Option<f64>; 2]>,
    /// The selector is on manual.
    pub(super) manual: Option<bool>,
    pub(super) battery_v: Option<f64>,
}

/// What a look has brought.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Seen {
    Nothing,
    /// Worth saying.
    Note(String),
    Done(Verdict),
    /// The truck does without.
    NotFitted(&'static str),
}

fn done(what: String) -> Seen {
    Seen::Done(Ok(what))
}

fn wrong(what: String, hint: &str) -> Seen {
    Seen::Done(Err(Wrong::new(what, hint)))
}

/// How long something has been so.
#[derive(Debug, Default)]
struct Since(Option<f64>);

impl Since {
    /// For so many s by now; 0 if it is not so.
    fn lasts_s(&mut self, now_s: f64, is_so: bool) -> f64 {
        if !is_so {
            self.0 = None;
            return 0.0;
        }
        now_s - *self.0.get_or_insert(now_s)
    }
}

/// Looks for one thing.
pub(super) trait Detector {
    fn look(&mut self, view: &View) -> Seen;

    /// Why it has seen nothing, when it is given up.
    fn missing(&self) -> Wrong;
}

/// The board is up.
#[derive(Debug, Default)]
pub(super) struct Up(Since);

impl Detector for Up {
    fn look(&mut self, view: &View) -> Seen {
        match (&view.firmware, self.0.lasts_s(view.now_s, view.is_up && view.fault.is_none()) >= 0.5) {
            (Some(firmware), true) => done(format!("firmware {firmware}, set up")),
            _ => Seen::Nothing,
        }
    }

    fn missing(&self) -> Wrong {
        Wrong::new(
            "the board does not answer",
            "is it flashed and powered? robot-agent check-hardware shows the fault",
        )
    }
}

/// The battery is measured.
#[derive(Debug, Default)]
pub(super) struct Measured {
    heard: Since,
}

impl Detector for Measured {
    fn look(&mut self, view: &View) -> Seen {
        let heard_s = self.heard.lasts_s(view.now_s, view.ranges_cm.is_some());
        match view.battery_v {
            Some(_) => done(String::new()),
            None if heard_s > 0.5 => Seen::NotFitted("not measured by this board"),
            None => Seen::Nothing,
        }
    }

    fn missing(&self) -> Wrong {
        Wrong::new("no scan of the converter", "robot-agent check-hardware shows the fault")
    }
}

/// One range finder sees something, and it alone.
#[derive(Debug)]
pub(super) struct Held {
    place: Place,
    /// Nearer than this counts.
    near_cm: f64,
    alone: Since,
    elsewhere: Since,
    together: Since,
    told: bool,
}

impl Held {
    pub(super) fn new(place: Place, near_cm: f64) -> Self {
        let [alone, elsewhere, together] = [(); 3].map(|()| Since::default());
        Self { place, near_cm, alone, elsewhere, together, told: false }
    }
}

/// Those that see something nearer than this.
fn seeing(view: &View, near_cm: f64) -> Option<Vec<Place>> {
    let ranges_cm = view.ranges_cm?;
    let sees = |place: &Place| {
        let cm: Option<f64> = ranges_cm[usize::from(place.is_rear)][place.slot];
        cm.is_some_and(|cm| cm <= near_cm)
    };
    let all =
        [false, true].into_iter().flat_map(|is_rear| (0..SLOTS).map(move |slot| Place { is_rear, slot }));
    Some(all.filter(sees).collect())
}

fn names(places: &[Place]) -> String {
    places.iter().map(|place| place.name()).collect::<Vec<_>>().join(", ")
}

impl Detector for Held {
    fn look(&mut self, view: &View) -> Seen {
        let Some(seeing) = seeing(view, self.near_cm) else { return Seen::Nothing };
        let (mine, others): (Vec<_>, Vec<_>) = seeing.into_iter().partition(|place| *place == self.place);
        // The other bumper may look at a wall.
        let others: Vec<_> = others.into_iter().filter(|other| other.is_rear == self.place.is_rear).collect();
        let now_s = view.now_s;
        let alone_s = self.alone.lasts_s(now_s, !mine.is_empty() && others.is_empty());
        let together_s = self.together.lasts_s(now_s, !mine.is_empty() && !others.is_empty());
        let elsewhere_s = self.elsewhere.lasts_s(now_s, mine.is_empty() && !others.is_empty());
        let name = self.place.name();
        if alone_s >= 0.4 {
            let cm = view.ranges_cm.and_then(|cm| cm[usize::from(self.place.is_rear)][self.place.slot]);
            return done(format!("seen at {:.0} cm", cm.unwrap_or_default()));
        }
        if elsewhere_s >= 3.0 {
            let what = format!("{} sees it, {name} does not", names(&others));
            return wrong(what, "was it held before the right one? Then two leads are swapped");
        }
        if together_s >= 2.0 && !self.told {
            self.told = true;
            return Seen::Note(format!("{} sees it too: take something narrower", names(&others)));
        }
        Seen::Nothing
    }

    fn missing(&self) -> Wrong {
        let hint = "check its lead, its 5 V and its channel of the multiplexer; is the lens free?";
        Wrong::new(format!("range finder {} has not seen it alone", self.place.name()), hint)
    }
}

/// No range finder of this bumper sees anything near.
#[derive(Debug)]
pub(super) struct Clear {
    is_rear: bool,
    near_cm: f64,
    clear: Since,
    covered: Since,
    told: bool,
}

impl Clear {
    pub(super) fn new(place: Place, near_cm: f64) -> Self {
        let (clear, covered) = (Since::default(), Since::default());
        Self { is_rear: place.is_rear, near_cm, clear, covered, told: false }
    }
}

impl Detector for Clear {
    fn look(&mut self, view: &View) -> Seen {
        let Some(mut seeing) = seeing(view, self.near_cm) else { return Seen::Nothing };
        seeing.retain(|place| place.is_rear == self.is_rear);
        if self.clear.lasts_s(view.now_s, seeing.is_empty()) >= 0.3 {
            return done(String::new());
        }
        if self.covered.lasts_s(view.now_s, !seeing.is_empty()) >= 2.0 && !self.told {
            self.told = true;
            let (all, cm) = (names(&seeing), self.near_cm);
            return Seen::Note(format!("{all} sees something nearer than {cm:.0} cm: take it away"));
        }
        Seen::Nothing
    }

    fn missing(&self) -> Wrong {
        let hint = "make room before the bumper; if there is room, check the lead of whoever sees something";
        Wrong::new("something stays in sight of the bumper", hint)
    }
}
