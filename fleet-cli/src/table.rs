//! Aligned columns for people.

use crate::output::{Output, Tone};
use crate::text::width::{shortened, text_width};

/// Blanks between two columns.
const GAP: usize = 2;

/// One field of a table.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TableCell {
    text: String,
    tone: Tone,
}

impl TableCell {
    /// Text in a tone.
    #[must_use]
    pub fn new(text: impl Into<String>, tone: Tone) -> Self {
        Self { text: text.into(), tone }
    }
}

impl<T: Into<String>> From<T> for TableCell {
    fn from(text: T) -> Self {
        Self::new(text, Tone::Plain)
    }
}

/// A step that makes a table narrower; columns are named by their headings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Narrowing {
    /// The column is left out.
    Drop(&'static str),
    /// The column's texts are shortened as far as needed, but not below this width.
    Shorten(&'static str, usize),
}

/// A column as it is printed.
#[derive(Debug, Clone, Copy)]
struct Column {
    /// Of its cells in their rows.
    index: usize,
    /// In columns of the terminal.
    width: usize,
    /// How narrow it may become.
    least: usize,
}

/// Width of columns that stand side by side.
fn total(columns: &[Column], width: impl Fn(&Column) -> usize) -> usize {
    columns.iter().map(width).sum::<usize>() + GAP * columns.len().saturating_sub(1)
}

/// Rows under headings, all columns flush left.
#[derive(Debug, Clone, Default)]
pub struct Table {
    rows: Vec<Vec<TableCell>>,
}

impl Table {
    /// An empty table with these headings.
    #[must_use]
    pub fn new(headings: &[&str]) -> Self {
        Self { rows: vec![headings.iter().map(|heading| TableCell::new(*heading, Tone::Dim)).collect()] }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: Vec<TableCell>) {
        self.rows.push(cells);
    }

    /// Columns of the terminal that it takes with nothing left out.
    #[must_use]
    pub fn width(&self) -> usize {
        total(&self.columns(), |column| column.width)
    }

    /// As text, painted as `out` allows; no line ends in blanks.
    #[must_use]
    pub fn render(&self, out: &Output) -> String {
        self.lines(&self.columns(), out).into_iter().map(|line| line + "\n").collect()
    }

    /// The headings and a line for each row, none wider than `most`. The steps are taken in their order, until
    /// the table fits; what is too wide after the last one is cut off at the right edge.
    #[must_use]
    pub fn lines_within(&self, most: usize, steps: &[Narrowing], out: &Output) -> Vec<String> {
        let mut columns = self.columns();
        for step in steps {
            if total(&columns, |column| column.least) <= most {
                break;
            }
            match *step {
                Narrowing::Drop(heading) => columns.retain(|column| self.heading(column) != heading),
                Narrowing::Shorten(heading, least) => {
                    for column in &mut columns {
                        if self.heading(column) == heading {
                            column.least = column.width.min(least);
                        }
                    }
                }
            }
        }
        let mut excess = total(&columns, |column| column.width).saturating_sub(most);
        for column in &mut columns {
            let cut = excess.min(column.width - column.least);
            column.width -= cut;
            excess -= cut;
        }
        while excess > 0 {
            match columns.last_mut() {
                Some(last) if last.width > excess => {
                    last.width -= excess;
                    excess = 0;
                }
                Some(last) => {
                    excess = excess.saturating_sub(last.width + GAP);
                    columns.pop();
                }
                None => break,
            }
        }
        self.lines(&columns, out)
    }

    /// All columns, each as wide as its widest cell.
    fn columns(&self) -> Vec<Column> {
        let count = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let column = |index: usize| {
            let cells = self.rows.iter().filter_map(|row| row.get(index));
            let width = cells.map(|cell| text_width(&cell.text)).max().unwrap_or(0);
            Column { index, width, least: width }
        };
        (0..count).map(column).collect()
    }

    fn heading(&self, column: &Column) -> &str {
        let cell = self.rows.first().and_then(|row| row.get(column.index));
        cell.map_or("", |cell| cell.text.as_str())
    }

    fn lines(&self, columns: &[Column], out: &Output) -> Vec<String> {
        self.rows.iter().map(|row| line(row, columns, out)).collect()
    }
}

fn line(row: &[TableCell], columns: &[Column], out: &Output) -> String {
    let mut line = String::new();
    let mut blanks = 0;
    for column in columns {
        let Some(cell) = row.get(column.index) else { break };
        let text = shortened(&cell.text, column.width);
        if !text.is_empty() {
            line.extend(std::iter::repeat_n(' ', blanks));
            line.push_str(&out.paint(cell.tone, &text));
            blanks = 0;
        }
        blanks += column.width - text_width(&text) + GAP;
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn example() -> Table {
        let mut table = Table::new(&["name", "mode", "goal"]);
        table.row(vec!["xtb-1".into(), "goto".into(), "to (1, 2) · 3 m".into()]);
        table.row(vec!["xtb-10".into(), TableCell::new("missing", Tone::Bad), "".into()]);
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

    #[test]
    fn steps_are_taken_in_their_order_until_it_fits() {
        let out = Output { json: false, colors: false };
        let steps = [Narrowing::Shorten("goal", 8), Narrowing::Drop("mode"), Narrowing::Shorten("goal", 4)];
        let within = |most: usize| example().lines_within(most, &steps, &out);
        assert_eq!(example().width(), 32);
        assert_eq!(within(32).concat(), example().render(&out).replace('\n', ""));
        assert_eq!(within(31)[1], "xtb-1   goto     to (1, 2) · 3…");
        assert_eq!(within(25)[1], "xtb-1   goto     to (1…");
        assert_eq!(within(24), ["name    goal", "xtb-1   to (1, 2) · 3 m", "xtb-10"]);
        assert_eq!(within(13), ["name    goal", "xtb-1   to (…", "xtb-10"]);
        // Nothing is left to be taken away: the right edge is.
        assert_eq!(within(9), ["name    …", "xtb-1   …", "xtb-10"]);
        assert_eq!(within(4), ["name", "xtb…", "xtb…"]);
        for most in 1..40 {
            assert!(within(most).iter().all(|line| text_width(line) <= most), "{most}: {:?}", within(most));
        }
    }
}
