//! Aligned columns for people.

use crate::output::{Output, Tone};

/// One field of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    text: String,
    tone: Tone,
}

impl Cell {
    /// Text in a tone.
    #[must_use]
    pub fn new(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone }
    }
}

impl<T: Into<String>> From<T> for Cell {
    fn from(text: T) -> Self {
        Self::new(text, Tone::Plain)
    }
}

/// Rows under headings, all columns flush left.
#[derive(Debug, Clone, Default)]
pub struct Table {
    rows: Vec<Vec<Cell>>,
}

impl Table {
    /// An empty table with these headings.
    #[must_use]
    pub fn new(headings: &[&str]) -> Self {
        Self { rows: vec![headings.iter().map(|heading| Cell::new(*heading, Tone::Dim)).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<Cell>) {
        self.rows.push(cells);
    }

    /// As text, painted as `out` allows; no line ends in blanks.
    #[must_use]
    pub fn render(&self, out: &Output) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |column: usize| {
            self.rows.iter().filter_map(|row| row.get(column)).map(|cell| cell.text.chars().count()).max()
        };
        let widths: Vec<usize> = (0..columns).map(|column| width(column).unwrap_or(0)).collect();
        let mut text = String::new();
        for row in &self.rows {
            let last = row.iter().rposition(|cell| !cell.text.is_empty()).map_or(0, |last| last + 1);
            for (column, cell) in row.iter().take(last).enumerate() {
                text.push_str(&out.paint(cell.tone, &cell.text));
                if column + 1 < last {
                    let blanks = widths[column] - cell.text.chars().count() + 2;
                    text.extend(std::iter::repeat_n(' ', blanks));
                }
            }
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table = Table::new(&["name", "mode", "goal"]);
        table.row(vec!["xtb-1".into(), "goto".into(), "to (1, 2) · 3 m".into()]);
        table.row(vec!["xtb-10".into(), Cell::new("missing", Tone::Bad), "".into()]);
        table
    }

    #[test]
    fn columns_are_aligned_and_lines_do_not_end_in_blanks() {
        let out = Output { json: false, colors: false };
        let expected = "name    mode     goal\nxtb-1   goto     to (1, 2) · 3 m\nxtb-10  missing\n";
        assert_eq!(example().render(&out), expected);
    }

    #[test]
    fn colours_do_not_move_columns() {
        let plain = example().render(&Output { json: false, colors: false });
        let painted = example().render(&Output { json: false, colors: true });
        assert!(painted.contains("\x1b[31mmissing\x1b[0m"), "{painted:?}");
        let mut stripped = painted;
        for sgr in ["\x1b[0m", "\x1b[2m", "\x1b[31m"] {
            stripped = stripped.replace(sgr, "");
        }
        assert_eq!(stripped, plain);
    }
}
