//! `top`: the fleet on the whole terminal. The shell around the cockpit: keys in, pictures out, and
//! what it wants of robots carried out beside the screen, as the verbs do it.
//!
//! Nothing here waits for a robot: each command is a task of its own, and the screen goes on meanwhile.

mod execute;
mod teleop_session;

use crate::commands::teleop::keys::Reporting;
use crate::commands::teleop::ticks;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::output::Tone;
use crate::recording::playback_worker::{PlayStatus, PlaybackWorker};
use crate::terminal::{Terminal, ring};
use crate::tui::top::{Action, Cockpit, Outcome, Playing, Setup, Theme};
use clap::Args;
use ratatui::backend::CrosstermBackend;
use std::collections::BTreeMap;
use std::io::{IsTerminal, Stdout, stdout};
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;
use teleop_session::Hand;
use tokio::sync::watch;
use tokio::task::{Id, JoinSet};
use xtb_client::client::Client;
use xtb_client::scene::live::{Live, SharedScene, Wanted};
use xtb_client::teleop::SEND_EVERY;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;

const TOP_HELP: &str = "\
? shows the keys. s stops the selected robot, S all robots; e and E trigger the emergency stop for one or \
all. None of them asks for confirmation, and S and E act on all robots of the fleet, shown or not. Quitting \
stops the robot that is being driven.

Without UTF-8 in the locale the screen is drawn in ASCII; NO_COLOR, --color never and a monochrome TERM \
switch colours off.

Example: fleet-cli top xtb-1 xtb-2";

/// Arguments of `top`.
#[derive(Debug, Clone, Args)]
#[command(after_help = TOP_HELP)]
pub struct TopArgs {
    /// Robots to show [default: all].
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robots: Vec<Name>,
    /// View only: nothing is sent to robots.
    #[arg(long)]
    pub read_only: bool,
    /// Draw in ASCII, regardless of the locale.
    #[arg(long)]
    pub ascii: bool,
}

/// 10 pictures a second at most; what did not change is not painted.
const PAINT_EVERY: Duration = Duration::from_millis(100);

/// Shows the fleet until the person leaves.
///
/// # Errors
/// No terminal, no router, or the terminal is gone.
pub async fn run(ctx: &Context, args: &TopArgs) -> Result<Exit> {
    refuse(ctx)?;
    let opening = async {
        let client = Client::open(&ctx.settings).await?;
        let live = Live::open(&client, Wanted { sensors: true, truth: false }).await?;
        let link = client.bus().watch_link().await?;
        Ok::<_, Error>((client, live, link))
    };
    let (client, live, link) = tokio::select! {
        opened = opening => opened?,
        () = interrupted() => return Ok(Exit::Interrupted),
    };
    let read_only = args.read_only.then_some("--read-only; `fleet-cli estop --all` stops the fleet");
    let source = Source { scene: Arc::clone(&live.scene), client: Some(&client), played: None };
    let shown = tokio::select! {
        shown = show(ctx, source, link.up.clone(), args, read_only) => shown,
        error = client.refused() => Err(error),
    };
    client.close().await;
    shown
}

/// Shows a recording until the person leaves.
///
/// # Errors
/// No terminal, or it is gone.
pub async fn run_played(ctx: &Context, played: Arc<PlaybackWorker>) -> Result<Exit> {
    refuse(ctx)?;
    let args = TopArgs { robots: Vec::new(), read_only: true, ascii: false };
    let (_keep, link) = watch::channel(true);
    let source = Source { scene: played.scene(), client: None, played: Some(played) };
    show(ctx, source, link, &args, Some("playing a recording")).await
}

fn refuse(ctx: &Context) -> Result<()> {
    let hint = "use `fleet-cli list` for one look or `fleet-cli watch` for messages; both have --json";
    if ctx.out.json {
        return Err(
            Error::new(ErrorKind::Invalid, "top is an interactive screen: it has no --json").hint(hint)
        );
    }
    let dumb = std::env::var("TERM").is_ok_and(|term| term == "dumb");
    if dumb || !std::io::stdin().is_terminal() || !stdout().is_terminal() {
        return Err(
            Error::new(ErrorKind::Invalid, "top needs a terminal for its keys and its screen").hint(hint)
        );
    }
    Ok(())
}

/// Where the fleet comes from, and who can be asked for something.
struct Source<'a> {
    scene: Arc<SharedScene>,
    client: Option<&'a Client>,
    played: Option<Arc<PlaybackWorker>>,
}

async fn show(
    ctx: &Context,
    source: Source<'_>,
    link: watch::Receiver<bool>,
    args: &TopArgs,
    read_only: Option<&'static str>,
) -> Result<Exit> {
    let terminal = Terminal::open()?;
    let reporting = if terminal.reports_release() { Reporting::Releases } else { Reporting::Presses };
    let look = Theme::of(ctx.out.colors, args.ascii, |name| std::env::var(name).ok());
    let setup = Setup { robots: args.robots.clone(), look, reporting, read_only };
    let mut shell = Shell {
        ctx,
        source,
        cockpit: Cockpit::new(setup),
        picture: ratatui::Terminal::new(CrosstermBackend::new(stdout()))?,
        commands: JoinSet::new(),
        numbers: BTreeMap::new(),
        stops: watch::channel(0).0,
        hand: None,
    };
    let shown = shell.run(terminal, link).await;
    // The terminal is as it was from here on.
    if let Some(words) = shell.cockpit.last_words() {
        ctx.out.note(&words);
    }
    shown.map(|()| Exit::Done)
}

struct Shell<'a> {
    ctx: &'a Context,
    source: Source<'a>,
    cockpit: Cockpit,
    picture: ratatui::Terminal<CrosstermBackend<Stdout>>,
    /// Bounded by the cockpit: it begins no more than it can name.
    commands: JoinSet<Outcome>,
    numbers: BTreeMap<Id, u64>,
    /// Counts the stops that were called.
    stops: watch::Sender<u64>,
    hand: Option<Hand>,
}

impl Shell<'_> {
    async fn run(&mut self, mut terminal: Terminal, mut link: watch::Receiver<bool>) -> Result<()> {
        let mut stop = pin!(interrupted());
        let mut stopping = false;
        let (mut send, mut paint) = (ticks(SEND_EVERY), ticks(PAINT_EVERY));
        self.cockpit.link(*link.borrow_and_update(), self.now_ms());
        loop {
            tokio::select! {
                // What ends or changes motion comes before what repeats it.
                biased;
                () = &mut stop, if !stopping => {
                    stopping = true;
                    let actions = self.cockpit.leave(self.now_ms());
                    self.act(actions);
                }
                input = terminal.next() => {
                    // Without a terminal nobody can insist either.
                    let Some(input) = input else { return Ok(()) };
                    let actions = {
                        let (now_ms, scene) = (self.now_ms(), self.source.scene.lock());
                        self.cockpit.input(&input, &scene, now_ms)
                    };
                    self.act(actions);
                    // Not at the next tick: letting go means zero at once.
                    send.reset_immediately();
                }
                grasp = teleop_session::news(&mut self.hand), if self.hand.is_some() => {
                    self.cockpit.grasp(grasp, self.now_ms());
                }
                _ = send.tick() => {
                    if let (Some(drive), Some(hand)) = (self.cockpit.drive(self.now_ms()), &self.hand) {
                        hand.drive(drive);
                    }
                }
                Some(ended) = self.commands.join_next_with_id() => {
                    let (id, outcome) = match ended {
                        Ok((id, outcome)) => (id, Some(outcome)),
                        Err(error) => (error.id(), error.is_panic().then(broken)),
                    };
                    if let (Some(number), Some(outcome)) = (self.numbers.remove(&id), outcome) {
                        self.cockpit.done(number, &outcome, self.now_ms());
                    }
                }
                Ok(()) = link.changed() => self.cockpit.link(*link.borrow_and_update(), self.now_ms()),
                _ = paint.tick() => self.paint()?,
            }
            if self.cockpit.is_over() {
                return Ok(());
            }
        }
    }

    fn now_ms(&self) -> u64 {
        self.source.scene.now_ms()
    }

    /// The scene is let go before anything is written: a slow terminal holds up nobody.
    fn paint(&mut self) -> Result<()> {
        if let Some(played) = &self.source.played {
            self.cockpit.playing(playing(&played.status()));
        }
        self.cockpit.unreadable(self.source.scene.unreadable());
        let (cockpit, shared) = (&mut self.cockpit, &self.source.scene);
        self.picture.draw(|frame| {
            let (now_ms, scene) = (shared.now_ms(), shared.lock());
            cockpit.draw(frame, &scene, now_ms);
        })?;
        if self.cockpit.take_bell() {
            ring();
        }
        Ok(())
    }

    fn act(&mut self, actions: Vec<Action>) {
        for action in actions {
            match (action, self.source.client) {
                (Action::Do { number, command, instead }, Some(client)) => {
                    let (ctx, client) = (self.ctx.clone(), client.clone());
                    self.give_up(instead);
                    let known: Vec<Name> = self.source.scene.lock().robots().keys().cloned().collect();
                    if command.is_stop() {
                        self.stops.send_modify(|stops| *stops += 1);
                    }
                    let mut stops = self.stops.subscribe();
                    let begun = self.commands.spawn(async move {
                        tokio::select! {
                            biased;
                            Ok(()) = stops.changed(), if command.loosens() => execute::overtaken(),
                            outcome = execute::execute(&ctx, &client, &known, &command) => outcome,
                        }
                    });
                    self.numbers.insert(begun.id(), number);
                }
                (Action::Grip { robot, take }, Some(client)) => self.grip(client.clone(), robot, take),
                (Action::LetGo, _) => self.hand.iter_mut().for_each(Hand::let_go),
                (Action::Pause, _) => {
                    if let Some(played) = &self.source.played {
                        played.pause(!played.status().paused);
                    }
                }
                (Action::Seek(by_s), _) => {
                    if let Some(played) = &self.source.played {
                        let now_ms = played.status().position_ms as f64;
                        played.seek((now_ms + by_s * 1000.0).max(0.0) as u64);
                    }
                }
                // A recording has nobody to ask; the cockpit is read-only then.
                (Action::Do { .. } | Action::Grip { .. }, None) => {}
            }
        }
    }

    fn grip(&mut self, client: Client, robot: Name, take: bool) {
        self.hand = Some(Hand::take(client, robot, take));
    }

    /// Its successor says what came of it.
    fn give_up(&mut self, number: Option<u64>) {
        let ended: Vec<Id> =
            self.numbers.iter().filter(|(_, other)| Some(**other) == number).map(|(id, _)| *id).collect();
        for id in ended {
            self.numbers.remove(&id);
        }
    }
}

fn broken() -> Outcome {
    Outcome { tone: Tone::Bad, text: "outcome unknown: internal error".to_owned(), held: false }
}

fn playing(status: &PlayStatus) -> Playing {
    let seconds = |ms: u64| ms as f64 / 1000.0;
    let stands = match &status.failed {
        Some(why) => Some(format!("FAILED: {why}")),
        None if status.ended => Some("AT END".to_owned()),
        None => status.paused.then(|| "PAUSED".to_owned()),
    };
    Playing {
        at_s: seconds(status.position_ms),
        length_s: seconds(status.duration_ms),
        speed: status.speed,
        stands,
    }
}
