//! The terminal as a live screen: raw mode, keys, repainting, and everything put back at the end.

use crate::output::safe;
use crossterm::event::{
    self, DisableFocusChange, EnableFocusChange, Event, KeyCode, KeyEvent, KeyModifiers,
    KeyboardEnhancementFlags, PopKeyboardEnhancementFlags, PushKeyboardEnhancementFlags,
};
use crossterm::{cursor, execute, queue, style, terminal};
use std::io::{Stdout, Write, stdout};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use tokio::sync::mpsc;
use xtb_client::Result;

/// Keys that wait for the command; a person does not type faster than it reads.
const KEY_QUEUE: usize = 64;
/// How soon the reading thread notices that it is no longer wanted.
const LOOK_EVERY: Duration = Duration::from_millis(50);

/// What the person at the terminal did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Input {
    /// A key was pressed, repeats, or was released.
    Key(KeyEvent),
    /// The window is no longer the one that gets keys: no release will be heard.
    FocusLost,
}

impl Input {
    /// Whether a key means "leave" everywhere: Esc and Ctrl-C.
    #[must_use]
    pub fn leaves(key: &KeyEvent) -> bool {
        let ctrl_c = key.code == KeyCode::Char('c') && key.modifiers.contains(KeyModifiers::CONTROL);
        key.code == KeyCode::Esc || ctrl_c
    }
}

/// The open screen. Dropping it, on a panic too, puts the terminal back as it was.
pub struct Terminal {
    out: Stdout,
    keys: Option<Keys>,
    reports_release: bool,
}

impl Terminal {
    /// Takes the terminal over.
    ///
    /// # Errors
    /// It is none, or does not obey.
    pub fn open() -> Result<Self> {
        terminal::enable_raw_mode()?;
        // From here on a failure drops it, which undoes what was done.
        let mut this = Self { out: stdout(), keys: None, reports_release: false };
        execute!(this.out, terminal::EnterAlternateScreen, cursor::Hide, terminal::DisableLineWrap)?;
        execute!(this.out, EnableFocusChange)?;
        if terminal::supports_keyboard_enhancement().unwrap_or(false) {
            let flags = KeyboardEnhancementFlags::DISAMBIGUATE_ESCAPE_CODES
                | KeyboardEnhancementFlags::REPORT_EVENT_TYPES
                | KeyboardEnhancementFlags::REPORT_ALL_KEYS_AS_ESCAPE_CODES
                | KeyboardEnhancementFlags::REPORT_ALTERNATE_KEYS;
            execute!(this.out, PushKeyboardEnhancementFlags(flags))?;
            this.reports_release = true;
        }
        this.keys = Some(Keys::open()?);
        Ok(this)
    }

    /// Whether this terminal tells when a key is released (the kitty keyboard protocol).
    #[must_use]
    pub fn reports_release(&self) -> bool {
        self.reports_release
    }

    /// The next input; `None` = the terminal is gone.
    pub async fn next(&mut self) -> Option<Input> {
        match &mut self.keys {
            Some(keys) => keys.inputs.recv().await,
            None => None,
        }
    }

    /// Resolves once the person leaves (q, Esc, Ctrl-C) or the terminal is gone; what else is typed says nothing.
    pub(crate) async fn left(&mut self) {
        while let Some(input) = self.next().await {
            if let Input::Key(key) = input
                && (key.code == KeyCode::Char('q') || Input::leaves(&key))
            {
                return;
            }
        }
    }

    /// Shows these lines from the top, as many as there is room for.
    ///
    /// # Errors
    /// The terminal is gone.
    pub fn paint(&mut self, lines: &[String]) -> Result<()> {
        let (_, height) = terminal::size()?;
        for (row, line) in (0..height).zip(lines) {
            queue!(
                self.out,
                cursor::MoveTo(0, row),
                style::Print(safe(line)),
                terminal::Clear(terminal::ClearType::UntilNewLine)
            )?;
        }
        if let Ok(end) = u16::try_from(lines.len())
            && end < height
        {
            queue!(self.out, cursor::MoveTo(0, end), terminal::Clear(terminal::ClearType::FromCursorDown))?;
        }
        Ok(self.out.flush()?)
    }
}

/// Rings the terminal's bell. One that is gone is noticed elsewhere.
pub(crate) fn ring() {
    let _ = execute!(stdout(), style::Print('\x07'));
}

impl Drop for Terminal {
    fn drop(&mut self) {
        self.keys = None;
        // Each step on its own: one that fails must not keep the others from being tried, and there
        // is nobody left to tell.
        if self.reports_release {
            let _ = execute!(self.out, PopKeyboardEnhancementFlags);
        }
        let _ = execute!(self.out, DisableFocusChange);
        let _ = execute!(self.out, terminal::EnableLineWrap, cursor::Show, terminal::LeaveAlternateScreen);
        let _ = terminal::disable_raw_mode();
    }
}

/// What is typed, read on a thread of its own until this is dropped: crossterm's reader blocks, and for
/// ever where the terminal is gone.
pub(crate) struct Keys {
    inputs: mpsc::Receiver<Input>,
    wanted: Arc<AtomicBool>,
}

impl Keys {
    pub(crate) fn open() -> Result<Self> {
        let (sender, inputs) = mpsc::channel(KEY_QUEUE);
        let wanted = Arc::new(AtomicBool::new(true));
        let reads = Arc::clone(&wanted);
        std::thread::Builder::new().name("keys".into()).spawn(move || read_keys(&reads, &sender))?;
        Ok(Self { inputs, wanted })
    }

    /// What has been typed since the last time.
    pub(crate) fn typed(&mut self) -> impl Iterator<Item = Input> + '_ {
        std::iter::from_fn(|| self.inputs.try_recv().ok())
    }
}

impl Drop for Keys {
    fn drop(&mut self) {
        self.wanted.store(false, Ordering::Relaxed);
    }
}

fn read_keys(wanted: &AtomicBool, sender: &mpsc::Sender<Input>) {
    while wanted.load(Ordering::Relaxed) {
        let input = match event::poll(LOOK_EVERY).and_then(|ready| ready.then(event::read).transpose()) {
            Ok(None) => continue,
            Ok(Some(Event::Key(key))) => Input::Key(key),
            Ok(Some(Event::FocusLost)) => Input::FocusLost,
            Ok(Some(_)) => continue,
            Err(error) => return tracing::debug!("lost the terminal: {error}"),
        };
        if sender.blocking_send(input).is_err() {
            return;
        }
    }
}
