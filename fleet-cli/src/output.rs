//! The only place that prints: results to standard output, progress and errors to standard error.
//!
//! Nothing leaves it that could do more to a terminal than stand there: only our own colours and line feeds
//! get through. Texts of messages were escaped where they were read
//! ([`xtb_protocol::text`]); this holds for the system's words and whatever else ends up here.

use crate::args::ColorChoice;
use crate::text::width::shortened;
use schemars::JsonSchema;
use serde::Serialize;
use std::borrow::Cow;
use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::Name;
use xtb_protocol::text;

/// Between two lines of progress where they cannot be painted over.
const PROGRESS_EVERY: Duration = Duration::from_secs(2);

/// How a piece of text is meant; becomes a colour where colours are on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Tone {
    /// As it is.
    #[default]
    Plain,
    /// Names and headings.
    Strong,
    /// Less important.
    Dim,
    /// As wished.
    Good,
    /// Worth a look.
    Warning,
    /// Wrong, missing, stale.
    Bad,
}

const RESET: &str = "\x1b[0m";

impl Tone {
    /// All that colour anything.
    const COLORS: [Self; 5] = [Self::Strong, Self::Dim, Self::Good, Self::Warning, Self::Bad];

    fn sgr(self) -> &'static str {
        match self {
            Self::Plain => "",
            Self::Strong => "\x1b[1m",
            Self::Dim => "\x1b[2m",
            Self::Good => "\x1b[32m",
            Self::Warning => "\x1b[33m",
            Self::Bad => "\x1b[31m",
        }
    }
}

/// The text as a terminal may have it: [`Output::paint`]'s colours and line feeds stay, every other control
/// character becomes its escape.
pub(crate) fn safe(text: &str) -> Cow<'_, str> {
    let mut parts = text.split('\x1b');
    let first = text::escaped_lines(parts.next().unwrap_or_default());
    if let Cow::Borrowed(whole) = first
        && whole.len() == text.len()
    {
        return Cow::Borrowed(whole);
    }
    let mut out = first.into_owned();
    for part in parts {
        let colors = Tone::COLORS.map(Tone::sgr).into_iter().chain([RESET]);
        let own = colors.filter_map(|sgr| sgr.strip_prefix('\x1b')).find(|sgr| part.starts_with(sgr));
        out.push_str(if own.is_some() { "\x1b" } else { "\\u{1b}" });
        out.push_str(&text::escaped_lines(part));
    }
    Cow::Owned(out)
}

/// A line of JSON without any control character, inside its strings either.
pub(crate) fn json_line(value: &impl Serialize) -> Result<String> {
    let line = serde_json::to_string(value)
        .map_err(|error| Error::new(ErrorKind::Failed, format!("cannot write JSON: {error}")))?;
    Ok(text::escaped_json(&line).into_owned())
}

/// The width of the terminal to which results go; `None` = they go elsewhere, or the width is unknown.
pub(crate) fn terminal_columns() -> Option<usize> {
    let (columns, _) = std::io::stdout().is_terminal().then(crossterm::terminal::size)?.ok()?;
    (columns > 0).then_some(usize::from(columns))
}

/// Where and how results are printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Output {
    /// JSON instead of text.
    pub json: bool,
    /// Colours on standard output.
    pub colors: bool,
}

/// What went wrong, as `--json` prints it.
#[derive(Serialize, JsonSchema)]
pub(crate) struct ErrorLine<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    robot: Option<&'a Name>,
    error: ErrorFields<'a>,
}

#[derive(Serialize, JsonSchema)]
struct ErrorFields<'a> {
    /// Such as `no_router`.
    code: String,
    message: &'a str,
    /// What to do about it.
    hint: &'a str,
}

impl Output {
    /// As the options, the terminal and `NO_COLOR` say.
    #[must_use]
    pub fn new(json: bool, color: ColorChoice) -> Self {
        let colors = match color {
            ColorChoice::Always => true,
            ColorChoice::Never => false,
            ColorChoice::Auto => {
                let refused = std::env::var_os("NO_COLOR").is_some_and(|value| !value.is_empty());
                !refused && std::io::stdout().is_terminal()
            }
        };
        Self { json, colors }
    }

    /// `text` in a tone.
    #[must_use]
    pub fn paint(&self, tone: Tone, text: &str) -> String {
        if self.colors && tone != Tone::Plain && !text.is_empty() {
            format!("{}{text}{RESET}", tone.sgr())
        } else {
            text.to_owned()
        }
    }

    /// One or more lines of text on standard output.
    ///
    /// # Errors
    /// [`ErrorKind::PipeClosed`], or the system's words.
    pub fn text(&self, text: &str) -> Result<()> {
        let mut out = std::io::stdout().lock();
        writeln!(out, "{}", safe(text.trim_end_matches('\n')))?;
        Ok(out.flush()?)
    }

    /// One line of JSON on standard output.
    ///
    /// # Errors
    /// [`ErrorKind::PipeClosed`], or the system's words.
    pub fn line(&self, value: &(impl Serialize + JsonSchema)) -> Result<()> {
        self.text(&json_line(value)?)
    }

    /// The result: `value` as a line of JSON, or what `text` makes of it.
    ///
    /// # Errors
    /// [`ErrorKind::PipeClosed`], or the system's words.
    pub fn result<T: Serialize + JsonSchema>(
        &self,
        value: &T,
        text: impl FnOnce(&T) -> String,
    ) -> Result<()> {
        if self.json { self.line(value) } else { self.text(&text(value)) }
    }

    /// A note for people, on standard error. It is lost if nobody reads it.
    pub fn note(&self, text: &str) {
        let _ = writeln!(std::io::stderr().lock(), "{}", safe(text));
    }

    /// Says what went wrong: one JSON line on standard output, or `error:` and `hint:` on standard
    /// error.
    pub fn failure(&self, failure: &Error) {
        self.said(None, failure);
    }

    /// The same of one of several robots: the JSON line has its name as `robot`, the text names it too.
    pub fn failure_of(&self, robot: &Name, failure: &Error) {
        let is_named = self.json || failure.message.contains(robot.as_str());
        let whose = if is_named { String::new() } else { format!("{robot}: ") };
        let message = format!("{whose}{}", failure.message);
        self.said(Some(robot), &Error { message, ..failure.clone() });
    }

    fn said(&self, robot: Option<&Name>, failure: &Error) {
        let Error { kind, message, hint } = failure;
        if *kind == ErrorKind::PipeClosed {
            return;
        }
        let hint = if hint.is_empty() { kind.usual_hint() } else { hint.as_str() };
        if self.json {
            let line = ErrorLine { robot, error: ErrorFields { code: kind.code(), message, hint } };
            // Nobody is left to hear that the error could not be said.
            let _ = self.line(&line);
            return;
        }
        // Who interrupts knows that it is no error.
        let what = if *kind == ErrorKind::Interrupted { "" } else { "error: " };
        self.note(&format!("{what}{message}"));
        if !hint.is_empty() {
            self.note(&format!("hint: {hint}"));
        }
    }
}

/// How something goes on, on standard error: one line that is painted over on a terminal; elsewhere a
/// line now and then, if it is another one.
#[derive(Debug)]
pub struct ProgressLine {
    terminal: bool,
    shown: Option<Instant>,
    /// What was written last where nothing is painted over.
    last: String,
    silent: bool,
}

impl ProgressLine {
    /// Nothing shown yet.
    #[must_use]
    pub fn new() -> Self {
        Self::with(false)
    }

    /// Shows nothing: for one of several that would paint over each other.
    #[must_use]
    pub fn silent() -> Self {
        Self::with(true)
    }

    fn with(silent: bool) -> Self {
        Self { terminal: std::io::stderr().is_terminal(), shown: None, last: String::new(), silent }
    }

    /// Shows how it stands.
    pub fn show(&mut self, text: &str) {
        if self.silent {
            return;
        }
        let text = &*text::escaped(text);
        let due = self.shown.is_none_or(|at| at.elapsed() >= PROGRESS_EVERY);
        let mut err = std::io::stderr().lock();
        // Progress that nobody reads is no error.
        if self.terminal {
            let width = crossterm::terminal::size().map_or(80, |(columns, _)| usize::from(columns));
            let text = shortened(text, width.saturating_sub(1));
            let _ = write!(err, "\r\x1b[2K{text}").and_then(|()| err.flush());
        } else if due && self.last != text {
            let _ = writeln!(err, "{text}");
            self.last = text.to_owned();
        }
        if due {
            self.shown = Some(Instant::now());
        }
    }

    /// What follows stands on its own line.
    pub fn end(&mut self) {
        if self.terminal && self.shown.take().is_some() {
            let _ = writeln!(std::io::stderr().lock());
        }
    }
}

impl Drop for ProgressLine {
    fn drop(&mut self) {
        self.end();
    }
}

impl Default for ProgressLine {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_our_own_colours_and_line_feeds_reach_a_terminal() {
        let out = Output { json: false, colors: true };
        let ours = format!("{}\n{}", out.paint(Tone::Bad, "LATCHED"), out.paint(Tone::Dim, "since 3 s"));
        assert!(matches!(safe("plain · text\nof two lines"), Cow::Borrowed(_)));
        assert_eq!(safe(&ours), ours);
        let theirs = "\x1b]0;t\x07\x1b[2J\x1b\x1b[5m\r\u{9b}1m\x7f\u{202e}x\x1b";
        let shown = safe(theirs);
        assert_eq!(shown, "\\u{1b}]0;t\\u{7}\\u{1b}[2J\\u{1b}\\u{1b}[5m\\r\\u{9b}1m\\u{7f}\\u{202e}x\\u{1b}");
        let mixed = format!("{ours}{theirs}");
        assert_eq!(safe(&mixed), format!("{ours}{shown}"));
    }

    #[test]
    fn json_is_without_control_characters_and_says_the_same() {
        let value = "\x1b\x7f\u{9b}\u{202e}\u{2028}\n";
        let line = json_line(&value).unwrap();
        assert!(!line.contains(text::is_control), "{line:?}");
        assert_eq!(serde_json::from_str::<String>(&line).unwrap(), value);
        assert_eq!(safe(&line), line);
    }
}
