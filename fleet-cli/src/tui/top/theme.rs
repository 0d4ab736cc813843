//! How the cockpit looks on this terminal: with colours or without, in UTF-8 or in ASCII.
//!
//! What matters is always said in letters or signs; colours only repeat it.

use crate::output::Tone;
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier, Style};
use std::f64::consts::TAU;

/// Robots in turn.
const COLORS: [Color; 6] =
    [Color::Cyan, Color::Yellow, Color::Magenta, Color::Green, Color::LightBlue, Color::LightRed];
/// From east, counter-clockwise.
const ARROWS: [char; 8] = ['→', '↗', '↑', '↖', '←', '↙', '↓', '↘'];
const ASCII_ARROWS: [char; 4] = ['>', '^', '<', 'v'];

/// What the terminal can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Theme {
    /// Colours.
    pub(crate) color: bool,
    /// Nothing but ASCII.
    pub(crate) ascii: bool,
}

impl Theme {
    /// As options and environment say; `value` looks up a variable.
    pub(crate) fn of(colors: bool, ascii: bool, value: impl Fn(&str) -> Option<String>) -> Self {
        let value = |name: &str| value(name).filter(|text| !text.is_empty());
        let term = value("TERM").unwrap_or_default();
        let monochrome = term.starts_with("vt") || term.ends_with("-mono") || term.ends_with("-m");
        let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(value).unwrap_or_default();
        let utf8 = locale.to_ascii_lowercase().replace('-', "").contains("utf8");
        Self { color: colors && !monochrome, ascii: ascii || !utf8 }
    }

    /// A tone's style.
    pub(super) fn tone(self, tone: Tone) -> Style {
        let style = match tone {
            Tone::Plain | Tone::Good => Style::new(),
            Tone::Strong | Tone::Warning | Tone::Bad => Style::new().add_modifier(Modifier::BOLD),
            Tone::Dim => Style::new().add_modifier(Modifier::DIM),
        };
        match tone {
            _ if !self.color => style,
            Tone::Good => style.fg(Color::Green),
            Tone::Warning => style.fg(Color::Yellow),
            Tone::Bad => style.fg(Color::LightRed),
            _ => style,
        }
    }

    /// What must be seen before anything else.
    pub(super) fn alarm(self) -> Style {
        let style = Style::new().add_modifier(Modifier::BOLD | Modifier::REVERSED);
        if self.color { style.fg(Color::Red) } else { style }
    }

    /// The colour of the robot in this row.
    pub(super) fn robot(self, row: usize) -> Color {
        self.paint(COLORS[row % COLORS.len()])
    }

    /// A colour where there are any.
    pub(super) fn paint(self, color: Color) -> Color {
        if self.color { color } else { Color::Reset }
    }

    /// An arrow in a direction.
    pub(super) fn arrow(self, yaw_rad: f64) -> char {
        let eighths = |parts: usize| {
            let turns = yaw_rad.rem_euclid(TAU) / TAU;
            (turns * parts as f64).round() as usize % parts
        };
        if self.ascii { ASCII_ARROWS[eighths(4)] } else { ARROWS[eighths(8)] }
    }

    /// Replaces what is not ASCII, if nothing else may be shown.
    pub(super) fn reduce(self, buffer: &mut Buffer) {
        if !self.ascii {
            return;
        }
        for cell in &mut buffer.content {
            if let Some(sign) = cell.symbol().chars().next().filter(|sign| !sign.is_ascii()) {
                cell.set_char(ascii(sign));
            }
        }
    }
}

fn ascii(sign: char) -> char {
    match sign {
        '─' | '━' | '—' | '–' | '−' => '-',
        '│' | '┃' => '|',
        '┌'..='╿' => '+',
        '→' => '>',
        '←' => '<',
        '↑' => '^',
        '↓' => 'v',
        '·' | '…' => '.',
        '◇' => '*',
        '°' => 'd',
        '±' => '~',
        '\u{2800}'..='\u{28ff}' => dots(sign as u32 - 0x2800),
        _ => '?',
    }
}

/// A sign for a pattern of 2 × 4 dots.
fn dots(bits: u32) -> char {
    const UPPER: u32 = 0x1b;
    const LOWER: u32 = 0xe4;
    const COLUMNS: [u32; 2] = [0x47, 0xb8];
    const ROWS: [u32; 4] = [0x09, 0x12, 0x24, 0xc0];
    const BARS: [u32; 3] = [0x1b, 0x36, 0xe4];
    let within = |mask: u32| bits & !mask == 0;
    match bits.count_ones() {
        0 => ' ',
        5.. => '#',
        4 if BARS.contains(&bits) => '=',
        3.. if COLUMNS.into_iter().any(within) => '|',
        2 if ROWS.into_iter().any(within) => '-',
        _ if within(UPPER) => '\'',
        _ if within(LOWER) => '.',
        _ => ':',
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(color: bool, ascii: bool, environment: &[(&str, &str)]) -> Theme {
        let value = |name: &str| {
            let found = environment.iter().find(|(key, _)| *key == name);
            found.map(|(_, value)| (*value).to_owned())
        };
        Theme::of(color, ascii, value)
    }

    #[test]
    fn the_environment_says_what_the_terminal_can_show() {
        let utf8 = [("TERM", "xterm"), ("LANG", "en_GB.UTF-8")];
        assert_eq!(look(true, false, &utf8), Theme { color: true, ascii: false });
        assert_eq!(look(false, true, &utf8), Theme { color: false, ascii: true });
        assert!(look(true, false, &[("LANG", "C")]).ascii, "not UTF-8");
        assert!(look(true, false, &[]).ascii, "nothing said is the locale C");
        assert!(look(true, false, &[("LC_ALL", "C"), ("LANG", "de_DE.utf8")]).ascii, "LC_ALL wins");
        assert!(!look(true, false, &[("LC_ALL", ""), ("LANG", "C.utf8")]).ascii);
        assert!(!look(true, false, &[("TERM", "vt100"), ("LANG", "C.utf8")]).color);
        assert!(!look(true, false, &[("TERM", "xterm-mono")]).color);
    }

    #[test]
    fn arrows_point_where_the_robot_does() {
        let utf8 = look(true, false, &[("LANG", "C.utf8")]);
        assert_eq!(
            [0.0, 90.0, 180.0, -90.0, -46.0].map(|deg: f64| utf8.arrow(deg.to_radians())),
            ['→', '↑', '←', '↓', '↘']
        );
        let ascii = look(true, true, &[]);
        assert_eq!(
            [10.0, 80.0, 200.0, 359.0].map(|deg: f64| ascii.arrow(deg.to_radians())),
            ['>', '^', '<', '>']
        );
    }

    #[test]
    fn dots_become_signs_of_their_shape() {
        let signs: String = "⠀⠁⡀⡇⢸⠒⣿⢁⠶".chars().map(ascii).collect();
        assert_eq!(signs, " '.||-#:=");
    }
}
