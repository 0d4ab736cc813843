//! The terminal cockpit as a state machine: keys and the fleet's [`Scene`] in, a picture and
//! [`Action`]s out. It does no I/O; `commands/top.rs` carries the actions out.
//!
//! ```text
//!   keys ──► Cockpit ──Action──► commands/top.rs ──► client, lease, operator ──► robots
//!              ▲  │                     │
//!      Scene ──┘  └──► picture          └── outcomes come back as notices
//! ```
//! Stops come first: `s`, `S`, `e` and `E` mean the same in every overlay and while driving, and need
//! no second key.

mod alerts;
mod commands;
mod detail;
mod events;
mod filter;
mod floor;
mod frame;
mod keys;
mod labels;
mod layout;
mod map;
mod overlay;
mod robot_view;
mod table;
mod theme;
mod view;

pub(crate) use commands::{Command, Outcome, Target};
pub(crate) use theme::Theme;

use crate::commands::teleop::keys::{Action as Touch, Key as TeleopKey, Keyboard, Reporting};
use crate::output::Tone;
use crate::terminal::Input;
use commands::{Begun, Commands};
use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use filter::Filter;
use floor::Floor;
use keys::Press;
use robot_view::{ShownRobot, sights};
use view::View;
use xtb_client::scene::{AtMs, Scene};
use xtb_client::teleop::StickPosition;
use xtb_control::Stamp;
use xtb_nav::geometry::path::wrap_rad;
use xtb_protocol::Name;

/// One turn of the goal's yaw.
const TURN_RAD: f64 = std::f64::consts::PI / 12.0;
/// With shift the cursor goes so many cells.
const MANY_CELLS: i8 = 5;
/// With an arrow, and with shift, a recording is wound so far.
const SEEK_S: (f64, f64) = (5.0, 60.0);
const LET_GO_FIRST: &str = "end driving first: t or Esc";

/// What does not change while the cockpit is open.
#[derive(Debug, Clone)]
pub(crate) struct Setup {
    /// Robots to show; empty = all.
    pub(crate) robots: Vec<Name>,
    /// What the terminal can show.
    pub(crate) look: Theme,
    /// What the terminal tells of keys.
    pub(crate) reporting: Reporting,
    /// Why nothing may be asked of robots; `None` = it may.
    pub(crate) read_only: Option<&'static str>,
}

/// What the shell has to do.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Action {
    /// Carry this out beside the screen, then say [`Cockpit::done`].
    Do {
        /// Its number.
        number: u64,
        /// What.
        command: Command,
        /// Give this one up: it is asked anew.
        instead: Option<u64>,
    },
    /// Take the wheel of a robot.
    Grip {
        /// Whose.
        robot: Name,
        /// Take control from whoever has it.
        take: bool,
    },
    /// Zero, stop, and give the lease back.
    LetGo,
    /// The recording runs or rests.
    Pause,
    /// The recording goes on so many s later.
    Seek(f64),
}

/// What the shell says of the wheel.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum TeleopStatus {
    /// It is held.
    Held {
        /// Full throttle, in rpm.
        max_rpm: f64,
    },
    /// It is not given; `held`: somebody else has it.
    Refused {
        /// Why.
        text: String,
        /// Whether somebody else has control.
        held: bool,
    },
    /// Somebody else has it now, or it broke.
    Lost(String),
    /// It was let go. Whether the robot has confirmed the stop; `None` = it was not driven.
    Ended(Option<bool>),
}

/// How a recording stands.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Playing {
    /// Since its beginning.
    pub(crate) at_s: f64,
    /// Its length.
    pub(crate) length_s: f64,
    /// Times real time.
    pub(crate) speed: f64,
    /// Why it does not go on; `None` = it does.
    pub(crate) stands: Option<String>,
}

/// The hand at a robot's wheel.
#[derive(Debug, Clone)]
enum Grip {
    Asking(Name),
    Driving { robot: Name, max_rpm: f64, keyboard: Box<Keyboard> },
    Ending(Name),
}

impl Grip {
    fn robot(&self) -> &Name {
        match self {
            Self::Asking(robot) | Self::Driving { robot, .. } | Self::Ending(robot) => robot,
        }
    }
}

/// A point of the floor.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Cursor {
    x_m: f64,
    y_m: f64,
    yaw_rad: Option<f64>,
}

/// Something that waits for a yes.
#[derive(Debug, Clone, PartialEq)]
struct Question {
    text: String,
    yes: Wish,
}

#[derive(Debug, Clone, PartialEq)]
enum Wish {
    Command(Command),
    Grip { robot: Name, take: bool },
}

/// What lies over the picture.
#[derive(Debug, Clone, PartialEq)]
enum Modal {
    Help,
    Why,
    Question(Question),
}

/// Below the robots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Pane {
    Events,
    Tasks,
    Alerts,
}

/// The whole state of the screen.
#[derive(Debug, Clone)]
pub(crate) struct Cockpit {
    setup: Setup,
    selected: Option<Name>,
    filter: Filter,
    cursor: Option<Cursor>,
    view: View,
    floor: Option<Floor>,
    pane: Pane,
    /// Each event below the line of its drive.
    details: bool,
    /// Number of the newest alert that was told of.
    alerts_seen: u64,
    /// The bell is to ring.
    rings: bool,
    over: Option<Modal>,
    commands: Commands,
    grip: Option<Grip>,
    /// Whether the link stands, and since when.
    link: (bool, AtMs),
    unreadable: u64,
    playing: Option<Playing>,
    /// How often somebody has asked to leave.
    leaving: u32,
}

impl Cockpit {
    /// Nothing seen yet.
    pub(crate) fn new(setup: Setup) -> Self {
        Self {
            setup,
            selected: None,
            filter: Filter::default(),
            cursor: None,
            view: View::new(),
            floor: None,
            pane: Pane::Events,
            details: false,
            alerts_seen: 0,
            rings: false,
            over: None,
            commands: Commands::default(),
            grip: None,
            link: (true, 0),
            unreadable: 0,
            playing: None,
            leaving: 0,
        }
    }

    /// What the person did.
    pub(crate) fn input(&mut self, input: &Input, scene: &Scene, now_ms: AtMs) -> Vec<Action> {
        match input {
            Input::FocusLost => self.let_go(now_ms, "the window lost keyboard focus"),
            Input::Key(key) if self.steers(key, now_ms) => Vec::new(),
            Input::Key(key) if self.writes(key, scene, now_ms) => Vec::new(),
            Input::Key(key) => match keys::press(key) {
                Some(press) => self.press(press, scene, now_ms),
                None => {
                    // Any key but the yes is a no; shift alone is none.
                    let typed = key.kind == KeyEventKind::Press && !matches!(key.code, KeyCode::Modifier(_));
                    self.over.take_if(|over| typed && matches!(over, Modal::Question(_)));
                    Vec::new()
                }
            },
        }
    }

    /// Somebody wants an end: by signal, or because the terminal is gone.
    pub(crate) fn leave(&mut self, now_ms: AtMs) -> Vec<Action> {
        self.leaving += 1;
        self.let_go(now_ms, "quitting")
    }

    /// Whether the screen may close: everything is answered and let go, or the person insists.
    pub(crate) fn is_over(&self) -> bool {
        let idle = self.commands.under_way().is_empty() && self.grip.is_none();
        self.leaving > 1 || (self.leaving == 1 && idle)
    }

    /// The setpoint that is due now, 20 times a second; `None` = nothing is to be sent.
    pub(crate) fn drive(&mut self, now_ms: AtMs) -> Option<StickPosition> {
        match &mut self.grip {
            Some(Grip::Driving { keyboard, .. }) => keyboard.send(Stamp::from_ms(now_ms)),
            _ => None,
        }
    }

    /// What came of a command.
    pub(crate) fn done(&mut self, number: u64, outcome: &Outcome, now_ms: AtMs) {
        let Some(command) = self.commands.end(now_ms, number, outcome) else { return };
        if let Some(taking) = command.taking().filter(|_| outcome.held) {
            let text = format!("{}. Take control?", outcome.text);
            self.ask(Question { text, yes: Wish::Command(taking) });
        }
    }

    /// What became of the wheel.
    pub(crate) fn grasp(&mut self, grasp: TeleopStatus, now_ms: AtMs) {
        let Some(grip) = self.grip.take() else { return };
        let robot = grip.robot().clone();
        match (grasp, grip) {
            (TeleopStatus::Held { max_rpm }, Grip::Asking(robot)) => {
                let keyboard = Box::new(Keyboard::new(self.setup.reporting));
                self.grip = Some(Grip::Driving { robot, max_rpm, keyboard });
            }
            (TeleopStatus::Held { .. }, grip) => self.grip = Some(grip),
            (TeleopStatus::Refused { text, held }, grip) => {
                self.commands.tell(now_ms, Tone::Bad, format!("drive {robot}: {text}"));
                if held && matches!(grip, Grip::Asking(_)) {
                    let text = format!("{text}. Take control?");
                    self.ask(Question { text, yes: Wish::Grip { robot, take: true } });
                }
            }
            (TeleopStatus::Lost(text), _) => {
                self.commands.tell(now_ms, Tone::Bad, format!("drive {robot}: {text}"))
            }
            (TeleopStatus::Ended(None), _) => {
                self.commands.tell(now_ms, Tone::Plain, format!("{robot} was not driven; control released"));
            }
            (TeleopStatus::Ended(Some(true)), _) => {
                let text = format!("{robot} confirmed the stop; control released");
                self.commands.tell(now_ms, Tone::Good, text);
            }
            (TeleopStatus::Ended(Some(false)), _) => {
                let text =
                    format!("{robot} did not confirm the stop: the last setpoint times out within 250 ms");
                self.commands.tell(now_ms, Tone::Bad, text);
            }
        }
    }

    /// Whether the link to the router stands.
    pub(crate) fn link(&mut self, up: bool, now_ms: AtMs) {
        if self.link.0 != up {
            self.link = (up, now_ms);
        }
    }

    /// How many messages could not be read.
    pub(crate) fn unreadable(&mut self, count: u64) {
        self.unreadable = count;
    }

    /// How the recording stands.
    pub(crate) fn playing(&mut self, playing: Playing) {
        self.playing = Some(playing);
    }

    /// The last words, for the shell's own screen.
    pub(crate) fn last_words(&self) -> Option<String> {
        let open: Vec<String> = self.commands.under_way().iter().map(|open| open.command.words()).collect();
        (!open.is_empty()).then(|| format!("not answered at exit: {}", open.join(", ")))
    }
}

mod input;

#[cfg(test)]
mod tests;
