//! The log of both programs: to standard error, as text for people or as JSON lines for programs.

use clap::ValueEnum;
use std::io::{self, IsTerminal, Write};
use tracing_subscriber::EnvFilter;
use xtb_protocol::text;

/// Variables that say how detailed the log is, such as `debug`; the first that is set counts.
const DETAIL: [&str; 2] = ["XTB_LOG", "RUST_LOG"];

/// How a line of the log looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ValueEnum)]
pub enum LogFormat {
    /// For people.
    #[default]
    Text,
    /// One JSON object a line.
    Json,
}

/// Begins to log; `usual` is how detailed, in the words of `RUST_LOG`, unless the environment says so.
pub fn start(format: LogFormat, usual: &str) {
    let set = DETAIL.iter().find_map(|name| std::env::var(name).ok().filter(|text| !text.is_empty()));
    let filter = set.and_then(|text| EnvFilter::try_new(text).ok()).unwrap_or_else(|| EnvFilter::new(usual));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(move || Escaped { format });
    match format {
        LogFormat::Text => log.with_ansi(std::io::stderr().is_terminal()).init(),
        LogFormat::Json => log.json().flatten_event(true).with_current_span(false).init(),
    }
}

/// Standard error for whole lines of the log: what came in with a message stands in them as text. Colours
/// stay, which are the log's own: it escapes those in what it is told itself.
struct Escaped {
    format: LogFormat,
}

impl Write for Escaped {
    fn write(&mut self, line: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(line);
        io::stderr().lock().write_all(escaped(&text, self.format).as_bytes())?;
        Ok(line.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        io::stderr().flush()
    }
}

/// One event as it is written: its last line feed ends it, there is no other.
fn escaped(event: &str, format: LogFormat) -> String {
    let (event, end) = event.strip_suffix('\n').map_or((event, ""), |event| (event, "\n"));
    let body = match format {
        LogFormat::Json => text::escaped_json(event).into_owned(),
        LogFormat::Text => {
            let mut parts = event.split('\x1b');
            let first = text::escaped(parts.next().unwrap_or_default()).into_owned();
            parts.fold(first, |whole, part| {
                let color = part.strip_prefix('[').and_then(|it| it.split_once('m')).map(|(sgr, _)| sgr);
                let own = color.is_some_and(|sgr| sgr.bytes().all(|b| b.is_ascii_digit() || b == b';'));
                let escape = if own { "\x1b" } else { "\\u{1b}" };
                whole + escape + &text::escaped(part)
            })
        }
    };
    body + end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_one_line_whatever_it_tells() {
        let event = "\x1b[2m12:00\x1b[0m WARN on ros/x: a\nforged\r\u{9b}\u{202e}\x1b]0;t\x07 b\n";
        let line = "\x1b[2m12:00\x1b[0m WARN on ros/x: a\\nforged\\r\\u{9b}\\u{202e}\\u{1b}]0;t\\u{7} b\n";
        assert_eq!(escaped(event, LogFormat::Text), line);
        assert_eq!(escaped("{\"m\":\"\u{9b}\"}\n", LogFormat::Json), "{\"m\":\"\\u009b\"}\n");
    }
}
