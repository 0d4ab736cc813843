//! Text from elsewhere, for people: shown as text, whatever characters it holds.
//!
//! A control character in a robot's words could clear a terminal, forge a line or turn what follows it
//! around, and one that nobody sees could make two names look alike. Each becomes its visible escape (`\n`,
//! `\u{1b}`, `\u{200b}`): nothing of the text is lost. Every text for
//! people in a message is escaped where the message is read ([`read`] and its like); what is printed is
//! looked at once more where it leaves the program.

use serde::{Deserialize, Deserializer};
use std::borrow::Cow;

/// Whether a character could do anything but stand there: C0 with line feed and tab, DEL, C1, line and
/// paragraph separators, and what changes the direction of text.
#[must_use]
pub fn is_control(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Whether a character takes no room, so that a text with it looks like one without: soft hyphen, joiners and
/// spaces without width, marks of order and annotation, tags. (Unicode's format characters but for those that are
/// drawn, such as Arabic number signs.)
#[must_use]
pub fn is_invisible(c: char) -> bool {
    matches!(c,
        '\u{ad}' | '\u{180e}' | '\u{200b}'..='\u{200f}' | '\u{2060}'..='\u{206f}' | '\u{feff}'
        | '\u{fff9}'..='\u{fffb}' | '\u{1bca0}'..='\u{1bca3}' | '\u{1d173}'..='\u{1d17a}'
        | '\u{e0000}'..='\u{e007f}')
}

fn is_escaped(c: char) -> bool {
    is_control(c) || is_invisible(c)
}

/// The text with each control character and each invisible one as its escape.
#[must_use]
pub fn escaped(text: &str) -> Cow<'_, str> {
    escaped_but(text, |_| false)
}

/// The same for a text of several lines: line feeds stay.
#[must_use]
pub fn escaped_lines(text: &str) -> Cow<'_, str> {
    escaped_but(text, |c| c == '\n')
}

fn escaped_but(text: &str, stays: impl Fn(char) -> bool) -> Cow<'_, str> {
    let bad = |c: char| is_escaped(c) && !stays(c);
    if !text.contains(bad) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(2 * text.len());
    for c in text.chars() {
        if bad(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// JSON with the control characters that JSON itself leaves as they are (DEL, C1 and the others above C0) and with
/// the invisible ones as JSON's own escapes: the value is the same.
#[must_use]
pub fn escaped_json(json: &str) -> Cow<'_, str> {
    let bad = |c: char| c >= '\u{7f}' && is_escaped(c);
    if !json.contains(bad) {
        return Cow::Borrowed(json);
    }
    let mut out = String::with_capacity(2 * json.len());
    for c in json.chars() {
        if bad(c) {
            // Two of them for a character beyond 16 bits.
            out.extend(c.encode_utf16(&mut [0; 2]).iter().map(|unit| format!("\\u{unit:04x}")));
        } else {
            out.push(c);
        }
    }
    Cow::Owned(out)
}

fn owned(text: String) -> String {
    match escaped(&text) {
        Cow::Borrowed(_) => text,
        Cow::Owned(escaped) => escaped,
    }
}

/// A field of a message that is a text for people, read escaped.
///
/// # Errors
/// It is no text.
pub fn read<'de, D: Deserializer<'de>>(from: D) -> Result<String, D::Error> {
    String::deserialize(from).map(owned)
}

/// The same where there may be none.
///
/// # Errors
/// It is no text.
pub fn read_option<'de, D: Deserializer<'de>>(from: D) -> Result<Option<String>, D::Error> {
    Ok(Option::<String>::deserialize(from)?.map(owned))
}

/// The same for a list.
///
/// # Errors
/// It is no list of texts.
pub fn read_list<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    Ok(Vec::<String>::deserialize(from)?.into_iter().map(owned).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_of_every_kind_become_their_escapes() {
        for (raw, shown) in [
            ("\x1b[2J", "\\u{1b}[2J"),
            ("a\r\nb\tc\0", "a\\r\\nb\\tc\\u{0}"),
            ("\x7f", "\\u{7f}"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("\u{202e}txt\u{2066}\u{200f}", "\\u{202e}txt\\u{2066}\\u{200f}"),
            ("\u{2028}\u{2029}", "\\u{2028}\\u{2029}"),
            ("xtb\u{200b}-1\u{ad}\u{feff}", "xtb\\u{200b}-1\\u{ad}\\u{feff}"),
            ("\u{2060}a\u{e0041}", "\\u{2060}a\\u{e0041}"),
        ] {
            assert_eq!(escaped(raw), shown);
            assert!(!escaped(raw).contains(is_escaped));
            assert_eq!(escaped(shown), shown, "escaped once");
        }
        assert_eq!(escaped_lines("a\nb\x07"), "a\nb\\u{7}");
    }

    #[test]
    fn text_stays_as_it_is() {
        for text in ["", "nothing to escape: (1, 2) · 3 m/s² — «ö» 北 🚗 \\n"] {
            assert!(matches!(escaped(text), Cow::Borrowed(same) if same == text));
        }
    }

    #[test]
    fn json_keeps_its_value() {
        let value = "\x1b\x7f\u{85}\u{2028}\u{202e}\u{200b}\u{e0041}ok";
        let json = serde_json::to_string(value).unwrap();
        let safe = escaped_json(&json);
        assert!(!safe.contains(is_escaped), "{safe:?}");
        assert_eq!(serde_json::from_str::<String>(&safe).unwrap(), value);
    }
}
