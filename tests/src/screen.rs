//! What a program has painted on its terminal: as much of one as `top` and `teleop` use.
//!
//! Pure: bytes in, cells out. What is not known is left out.

/// A character with its attributes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cell {
    /// What stands there.
    pub sign: char,
    /// How.
    pub style: Style,
}

/// Attributes; colours are those of the 256-colour palette.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Style {
    /// Colour; `None` = the terminal's own.
    pub color: Option<u8>,
    /// Bold.
    pub bold: bool,
    /// Dim.
    pub dim: bool,
    /// Underlined.
    pub underlined: bool,
    /// Foreground and background swapped.
    pub reversed: bool,
}

const BLANK: Cell = Cell {
    sign: ' ',
    style: Style { color: None, bold: false, dim: false, underlined: false, reversed: false },
};

/// A screen of fixed size.
#[derive(Debug, Clone)]
pub struct Screen {
    columns: usize,
    cells: Vec<Cell>,
    /// Column and row.
    cursor: (usize, usize),
    style: Style,
    /// Bytes of a sequence or a character that has not ended.
    pending: Vec<u8>,
}

impl Screen {
    /// An empty one.
    #[must_use]
    pub fn new(columns: usize, rows: usize) -> Self {
        let cells = vec![BLANK; columns * rows];
        Self { columns, cells, cursor: (0, 0), style: Style::default(), pending: Vec::new() }
    }

    /// Rows of cells.
    pub fn rows(&self) -> impl Iterator<Item = &[Cell]> {
        self.cells.chunks(self.columns)
    }

    /// The lines as text.
    #[must_use]
    pub fn text(&self) -> String {
        let line = |row: &[Cell]| row.iter().map(|cell| cell.sign).collect::<String>().trim_end().to_owned();
        self.rows().map(line).collect::<Vec<_>>().join("\n")
    }

    /// Takes in what the program wrote.
    pub fn write(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.pending.push(*byte);
            if self.is_complete() {
                let complete = std::mem::take(&mut self.pending);
                self.obey(&complete);
            }
        }
    }

    fn is_complete(&self) -> bool {
        match self.pending.as_slice() {
            [0x1b] | [0x1b, b'['] => false,
            [0x1b, b'[', .., last] => (0x40..=0x7e).contains(last),
            bytes => std::str::from_utf8(bytes).is_ok() || bytes.len() == 4,
        }
    }

    fn obey(&mut self, bytes: &[u8]) {
        match bytes {
            [0x1b, b'[', parameters @ .., last] => {
                let text = String::from_utf8_lossy(parameters);
                let numbers: Vec<usize> = text.split(';').map(|part| part.parse().unwrap_or(0)).collect();
                self.control(*last, &numbers);
            }
            [0x1b, ..] => {}
            b"\r" => self.cursor.0 = 0,
            b"\n" => self.cursor.1 += 1,
            _ => {
                let sign = String::from_utf8_lossy(bytes).chars().next().unwrap_or(' ');
                self.put(sign);
            }
        }
    }

    fn put(&mut self, sign: char) {
        let (column, row) = self.cursor;
        let at = row * self.columns + column;
        if column < self.columns
            && let Some(cell) = self.cells.get_mut(at)
        {
            *cell = Cell { sign, style: self.style };
        }
        self.cursor.0 += 1;
    }

    fn control(&mut self, last: u8, numbers: &[usize]) {
        let number = |index: usize| numbers.get(index).copied().unwrap_or(0);
        let here = (self.cursor.1 * self.columns + self.cursor.0).min(self.cells.len());
        match last {
            b'H' | b'f' => self.cursor = (number(1).max(1) - 1, number(0).max(1) - 1),
            b'J' if number(0) == 2 => self.cells.fill(BLANK),
            b'J' => self.cells[here..].fill(BLANK),
            b'K' => {
                let end = ((self.cursor.1 + 1) * self.columns).min(self.cells.len());
                self.cells[here.min(end)..end].fill(BLANK);
            }
            b'm' => self.paint(numbers),
            _ => {}
        }
    }

    fn paint(&mut self, numbers: &[usize]) {
        let style = &mut self.style;
        let mut numbers = numbers.iter().copied();
        while let Some(number) = numbers.next() {
            match number {
                0 => *style = Style::default(),
                1 => style.bold = true,
                2 => style.dim = true,
                4 => style.underlined = true,
                7 => style.reversed = true,
                22 => (style.bold, style.dim) = (false, false),
                24 => style.underlined = false,
                27 => style.reversed = false,
                30..=37 => style.color = u8::try_from(number - 30).ok(),
                90..=97 => style.color = u8::try_from(number - 82).ok(),
                38 => {
                    let palette = numbers.next() == Some(5);
                    style.color = numbers.next().filter(|_| palette).and_then(|n| u8::try_from(n).ok());
                }
                48 => numbers.by_ref().take(2).for_each(drop),
                39 => style.color = None,
                _ => {}
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_painted_in_pieces_stands_where_it_belongs() {
        let mut screen = Screen::new(10, 3);
        for piece in ["\x1b[2J\x1b[2;3Hab\x1b[1;38;5;9m", "→\x1b[0", "m\x1b[3;1Hend\x1b[?25l"] {
            let (first, rest) = piece.as_bytes().split_at(piece.len() / 2);
            screen.write(first);
            screen.write(rest);
        }
        assert_eq!(screen.text(), "\n  ab→\nend");
        let arrow = screen.rows().nth(1).unwrap()[4];
        assert_eq!(arrow.style, Style { color: Some(9), bold: true, ..Style::default() });
        screen.write(b"\x1b[2;4H\x1b[K");
        assert_eq!(screen.text(), "\n  a\nend");
    }
}
