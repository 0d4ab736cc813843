//! A recording as a scene: a thread reads it and keeps the scene where the [`Player`] is, so cockpit and
//! dashboard show it as they show what is live.

pub use xtb_recording::fleet::player::PlaySettings;

use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use xtb_client::scene::Scene;
use xtb_client::scene::live::SharedScene;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dashboard::{Playback, PlaybackPosition};
use xtb_protocol::Name;
use xtb_protocol::keys::{Channel, Key};
use xtb_recording::Error as RecordingError;
use xtb_recording::fleet::player::{Move, Player};
use xtb_recording::fleet::reader::{self, Recorded, RecordingReader};

/// Between two looks at what is due.
const TICK: Duration = Duration::from_millis(20);
/// Messages between two looks at what the viewer wants.
const AT_ONCE: usize = 1000;

/// How the playing stands.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PlayStatus {
    /// When the first message came, in ms since 1970.
    pub began_ms: u64,
    /// Played so far.
    pub position_ms: u64,
    /// How long the recording is.
    pub duration_ms: u64,
    /// Times as fast as it was.
    pub speed: f64,
    /// Whether it stands because somebody wants that.
    pub paused: bool,
    /// Whether the scene holds everything up to there.
    pub caught_up: bool,
    /// Whether it is at its end, and the scene too.
    pub ended: bool,
    /// Messages that could not be read.
    pub unreadable: u64,
    /// Why it goes no further, if it cannot.
    pub failed: Option<String>,
}

#[derive(Debug)]
struct Control {
    player: Player,
    /// The player as it stood when the scene held everything up to its place.
    shown: Option<Player>,
    failed: Option<String>,
    stop: bool,
}

#[derive(Debug)]
struct Controls {
    control: Mutex<Control>,
    changed: Condvar,
}

impl Controls {
    fn lock(&self) -> MutexGuard<'_, Control> {
        self.control.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A recording that is being played, until this is dropped.
#[derive(Debug)]
pub struct PlaybackWorker {
    scene: Arc<SharedScene>,
    controls: Arc<Controls>,
    thread: Option<JoinHandle<()>>,
}

impl PlaybackWorker {
    /// Opens a recording and begins to play it.
    ///
    /// # Errors
    /// [`ErrorKind::Failed`]: it cannot be read, or is none; [`ErrorKind::Invalid`]: it begins after its end.
    pub fn open(path: &Path, settings: PlaySettings) -> Result<Self> {
        let wrong = |error: RecordingError| not_readable(path, &error);
        let span = reader::span(path).map_err(wrong)?;
        let (reader, fleet) = reader::begin(path).map_err(wrong)?;
        let player = Player::new(span, settings);
        if settings.from_ms > player.duration_ms() {
            let length = Duration::from_millis(player.duration_ms()).as_secs_f64();
            let message = format!("{} is {length:.1} s long: --from is beyond its end", path.display());
            return Err(
                Error::new(ErrorKind::Invalid, message).hint("--from is the time after the first message")
            );
        }
        let scene = Arc::new(SharedScene::played(Scene::new(fleet.clone())));
        let controls = Arc::new(Controls {
            control: Mutex::new(Control { player, shown: None, failed: None, stop: false }),
            changed: Condvar::new(),
        });
        let mut projector = Projector {
            reader,
            next: None,
            fleet,
            scene: Arc::clone(&scene),
            controls: Arc::clone(&controls),
        };
        let thread = std::thread::Builder::new().name("play".into()).spawn(move || projector.run())?;
        Ok(Self { scene, controls, thread: Some(thread) })
    }

    /// What is shown.
    #[must_use]
    pub fn scene(&self) -> Arc<SharedScene> {
        Arc::clone(&self.scene)
    }

    /// How it stands.
    #[must_use]
    pub fn status(&self) -> PlayStatus {
        let control = self.controls.lock();
        let player = &control.player;
        let caught_up = control.shown.as_ref() == Some(player);
        PlayStatus {
            began_ms: player.began_ms(),
            position_ms: player.position_ms(),
            duration_ms: player.duration_ms(),
            speed: player.speed(),
            paused: player.paused(),
            caught_up,
            ended: player.ended() && caught_up,
            unreadable: self.scene.unreadable(),
            failed: control.failed.clone(),
        }
    }

    /// Stands, or goes on.
    pub fn pause(&self, paused: bool) {
        self.wish(|control| control.player.pause(paused));
    }

    /// Goes to another place, from the first message, at most to the end.
    pub fn seek(&self, position_ms: u64) {
        self.wish(|control| control.player.seek(position_ms));
    }

    /// Plays this many times as fast as it was; what is not above 0 changes nothing.
    pub fn set_speed(&self, speed: f64) {
        self.wish(|control| control.player.set_speed(speed));
    }

    fn wish(&self, change: impl FnOnce(&mut Control)) {
        change(&mut self.controls.lock());
        self.controls.changed.notify_one();
    }
}

impl Playback for PlaybackWorker {
    fn position(&self) -> PlaybackPosition {
        let PlayStatus { began_ms, position_ms, duration_ms, speed, paused, ended, .. } = self.status();
        PlaybackPosition { began_ms, position_ms, duration_ms, speed, paused, ended }
    }

    fn seek(&self, position_ms: u64) {
        self.seek(position_ms);
    }

    fn pause(&self, paused: bool) {
        self.pause(paused);
    }
}

impl Drop for PlaybackWorker {
    fn drop(&mut self) {
        self.wish(|control| control.stop = true);
        if let Some(thread) = self.thread.take() {
            // It ends by itself, and has said why if it could not go on.
            let _ = thread.join();
        }
    }
}

/// What a file's error says to people.
pub(crate) fn not_readable(path: &Path, error: &RecordingError) -> Error {
    Error::new(ErrorKind::Failed, format!("cannot read {} as a recording: {error}", path.display())).hint(
        "record one with `fleet-cli record --out FILE.mcap`; for recordings of robots use `robot-agent \
               replay`",
    )
}

/// The thread's own.
struct Projector {
    reader: RecordingReader,
    next: Option<Recorded>,
    fleet: Name,
    scene: Arc<SharedScene>,
    controls: Arc<Controls>,
}

impl Projector {
    fn run(&mut self) {
        let mut looked = Instant::now();
        loop {
            let mut control = self.controls.lock();
            if control.stop {
                return;
            }
            let now = Instant::now();
            let next = control.player.advance(now - looked);
            looked = now;
            let player = control.player.clone();
            drop(control);
            let played = match next {
                Move::On => self.play(&player),
                Move::Again => self.begin_anew(&player),
            };
            self.scene.set_now_ms(player.position_ms());
            let mut control = self.controls.lock();
            if matches!(played, Ok(false)) {
                control.shown = Some(player);
            }
            match played {
                Ok(true) => continue,
                Ok(false) => {}
                Err(error) => {
                    let failed = error.to_string();
                    tracing::warn!("playback stopped: {failed}");
                    control.failed = Some(failed);
                    control.player.pause(true);
                }
            }
            // A wish or the next tick, whichever comes first.
            drop(self.controls.changed.wait_timeout(control, TICK));
        }
    }

    /// Takes in what is due, at most [`AT_ONCE`]; whether there is more.
    fn play(&mut self, player: &Player) -> std::result::Result<bool, RecordingError> {
        for _ in 0..AT_ONCE {
            let Some(message) = self.due(player)? else { return Ok(false) };
            self.show(player, &message);
        }
        Ok(true)
    }

    /// A new scene at the player's place, from what it needs of all that is before.
    fn begin_anew(&mut self, player: &Player) -> std::result::Result<bool, RecordingError> {
        self.reader = RecordingReader::open(self.reader.path())?;
        self.next = None;
        self.scene.rewind(Scene::new(self.fleet.clone()), player.position_ms());
        let (mut tasks, mut alerts, mut map, mut places) = (None, None, None, None);
        while let Some(message) = self.due(player)? {
            match Key::parse(&message.topic).map(|key| key.channel) {
                // Long ones, of which the last holds.
                Some(Channel::DispatchTasks) => tasks = Some(message),
                Some(Channel::DispatchAlerts) => alerts = Some(message),
                Some(Channel::Map) => map = Some(message),
                Some(Channel::Places) => places = Some(message),
                Some(channel) if !player.is_needed(message.log_ns, &channel) => {}
                _ => self.show(player, &message),
            }
        }
        let last = [map, places, tasks, alerts].into_iter().flatten();
        last.for_each(|message| self.show(player, &message));
        Ok(false)
    }

    fn due(&mut self, player: &Player) -> std::result::Result<Option<Recorded>, RecordingError> {
        if self.next.is_none() {
            self.next = self.reader.next_message()?;
        }
        Ok(self.next.take_if(|next| player.is_due(next.log_ns)))
    }

    fn show(&self, player: &Player, message: &Recorded) {
        match reader::read(message) {
            Some(Ok((key, news))) => self.scene.lock().take(player.at_ms(message.log_ns), &key, news),
            Some(Err(error)) => self.scene.note_unreadable(&error),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests;
