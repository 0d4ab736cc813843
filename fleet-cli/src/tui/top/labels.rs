//! Labels that do not run into each other, and lines that end in `…` where there is no room for them.

use crate::text::width::shortened;
use ratatui::text::{Line, Span};

/// How much of a robot's label on the map is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd)]
pub(super) enum Extent {
    /// Its sign alone.
    Sign,
    /// Its sign and its name.
    Name,
    /// The age of its last state too.
    Age,
}

/// Where a label begins, and its columns.
#[derive(Debug, Clone, Copy)]
pub(super) struct Label {
    pub(super) column: u16,
    pub(super) row: u16,
    /// Sign and name.
    pub(super) name: u16,
    /// The age behind it; 0 = it is fresh.
    pub(super) age: u16,
}

/// How much of each is shown: every sign, then names, then ages, as far as they hide nothing of another robot. What is
/// fresh comes first, and with its name in any case.
pub(super) fn extents(labels: &[Option<Label>]) -> Vec<Extent> {
    let all = labels.iter().enumerate().filter_map(|(index, label)| Some((index, (*label)?)));
    let (fresh, old): (Vec<_>, Vec<_>) = all.partition(|(_, label)| label.age == 0);
    let all: Vec<(usize, Label)> = fresh.into_iter().chain(old).collect();
    let mut ends: Vec<u16> = labels.iter().map(|it| it.map_or(0, |it| it.column.saturating_add(1))).collect();
    let mut extents = vec![Extent::Sign; labels.len()];
    for (before, extent) in [(Extent::Sign, Extent::Name), (Extent::Name, Extent::Age)] {
        for &(index, label) in all.iter().filter(|(_, label)| extent == Extent::Name || label.age > 0) {
            let age = if extent == Extent::Age { label.age } else { 0 };
            let end = label.column.saturating_add(label.name).saturating_add(age);
            let hides = |(other, there): &(usize, Label)| {
                *other != index && there.row == label.row && end > there.column && ends[*other] > label.column
            };
            if extents[index] == before && (label.age == 0 || !all.iter().any(hides)) {
                (ends[index], extents[index]) = (end, extent);
            }
        }
    }
    extents
}

/// The line, or as much of it as `most` columns hold.
pub(super) fn fitted(line: Line<'_>, most: u16) -> Line<'_> {
    let mut room = usize::from(most);
    if line.width() <= room {
        return line;
    }
    let mut spans = Vec::new();
    for span in line.spans {
        // The last column is for the `…`.
        if span.width() < room {
            room -= span.width();
            spans.push(span);
            continue;
        }
        let text = shortened(&format!("{} …", span.content), room);
        spans.push(Span::styled(text, span.style));
        break;
    }
    Line { spans, ..line }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ratatui::style::{Color, Style};

    #[test]
    fn ages_give_way_to_names_and_names_to_signs() {
        let label = |column, row, age| Some(Label { column, row, name: 4, age });
        let all = [
            label(10, 3, 6),
            label(18, 3, 0),
            label(30, 3, 6),
            label(36, 3, 6),
            label(50, 3, 6),
            label(52, 3, 6),
            label(10, 4, 6),
            None,
        ];
        let expected = [
            Extent::Name, // the fresh one is behind it
            Extent::Name,
            Extent::Name, // the next one's sign is where its age would be
            Extent::Age,
            Extent::Sign,
            Extent::Age,
            Extent::Age, // on its own row
            Extent::Sign,
        ];
        assert_eq!(extents(&all), expected);
    }

    #[test]
    fn a_line_that_is_too_long_ends_in_an_ellipsis_and_keeps_its_colours() {
        let red = Style::new().fg(Color::Red);
        let line = || Line::from(vec![Span::raw("  3.0 s "), Span::styled("xtb-1 is missing", red)]);
        let text =
            |most| fitted(line(), most).spans.iter().map(|span| span.content.to_string()).collect::<String>();
        assert_eq!(text(24), "  3.0 s xtb-1 is missing");
        assert_eq!(text(17), "  3.0 s xtb-1 is…");
        assert_eq!(text(8), "  3.0 s…");
        assert_eq!(fitted(line(), 17).spans[1].style, red);
        for most in 0..21 {
            assert!(fitted(line(), most).width() <= usize::from(most), "{most}");
        }
    }
}
