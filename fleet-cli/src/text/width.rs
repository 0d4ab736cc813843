//! How wide texts are on a terminal, and shorter ones where there is no room.

use ratatui::text::Span;

/// Columns of the terminal that a text takes.
pub(crate) fn text_width(text: &str) -> usize {
    Span::raw(text).width()
}

/// The text if it fits into `most` columns, else its beginning and a `…`. A number is never cut: it would be
/// taken for another one.
pub(crate) fn shortened(text: &str, most: usize) -> String {
    if text_width(text) <= most {
        return text.to_owned();
    }
    let Some(room) = most.checked_sub(1) else { return String::new() };
    let mut short = String::new();
    let mut cut = None;
    for sign in text.chars() {
        short.push(sign);
        if text_width(&short) > room {
            cut = short.pop();
            break;
        }
    }
    let in_number = |sign: char| sign.is_ascii_digit() || sign == '.';
    let whole: &str = match cut {
        Some(sign) if in_number(sign) => short.trim_end_matches(|sign: char| in_number(sign) || sign == '-'),
        _ => &short,
    };
    format!("{}…", whole.trim_end_matches([' ', ',']))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_counted_and_not_bytes_or_signs() {
        assert_eq!(["", "xtb-1", "90°…", "日本"].map(text_width), [0, 5, 4, 4]);
    }

    #[test]
    fn what_is_too_long_ends_in_an_ellipsis_and_fits() {
        let goal = "running (1.00, -2.00), 1.50 m to go";
        for (most, expected) in [
            (35, goal),
            (34, "running (1.00, -2.00), 1.50 m to…"),
            (27, "running (1.00, -2.00)…"),
            (18, "running (1.00…"),
            (4, "run…"),
            (1, "…"),
            (0, ""),
        ] {
            assert_eq!(shortened(goal, most), expected, "{most}");
        }
        assert_eq!(shortened("日本語", 4), "日…");
    }
}
