#!/usr/bin/env python3
"""Turn a terminal capture (`tmux capture-pane -e -p`) into an SVG that looks the same everywhere.

    ansi2svg.py [COLUMNS [ROWS]] < capture.ansi > picture.svg

Braille dots and box lines are drawn as shapes, every letter has its own place: nothing depends on
the fonts of whoever looks at it.
"""

import re
import sys
from html import escape

CELL_W, CELL_H, FONT, MARGIN = 9.0, 18.0, 15, 12
BACKGROUND, FOREGROUND = "#11151c", "#d5dae3"
BASIC = [
    "#2a2f3a", "#e06c75", "#98c379", "#e5c07b", "#61afef", "#c678dd", "#56b6c2", "#c8cdd6",
    "#6b7280", "#ff8b94", "#b6e39a", "#ffd68a", "#8ecbff", "#e0a0f5", "#7fdbe6", "#ffffff",
]  # fmt: skip
# Arms of the box characters: left, right, up, down.
BOX = {
    "─": "lr", "│": "ud", "┌": "rd", "┐": "ld", "└": "ru", "┘": "lu",
    "├": "rud", "┤": "lud", "┬": "lrd", "┴": "lru", "┼": "lrud",
}  # fmt: skip
# Column and row of the dots of a Braille character, by bit.
DOTS = [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (0, 3), (1, 3)]


def xterm(n):
    if n < 16:
        return BASIC[n]
    if n >= 232:
        return "#" + f"{8 + 10 * (n - 232):02x}" * 3
    n -= 16
    return "#" + "".join(f"{55 + 40 * v if v else 0:02x}" for v in (n // 36, n // 6 % 6, n % 6))


class Pen:
    def __init__(self):
        self.fg, self.bold, self.dim = FOREGROUND, False, False

    def sgr(self, codes):
        codes = [int(c or 0) for c in codes.split(";")]
        while codes:
            code = codes.pop(0)
            if code == 0:
                self.__init__()
            elif code == 1:
                self.bold = True
            elif code == 2:
                self.dim = True
            elif code == 22:
                self.bold = self.dim = False
            elif 30 <= code <= 37:
                self.fg = BASIC[code - 30]
            elif 90 <= code <= 97:
                self.fg = BASIC[code - 82]
            elif code == 39:
                self.fg = FOREGROUND
            elif code in (38, 48):
                kind = codes.pop(0)
                colour = xterm(codes.pop(0)) if kind == 5 else "#%02x%02x%02x" % tuple(codes.pop(0) for _ in "rgb")
                self.fg = colour if code == 38 else self.fg

    def style(self):
        return self.fg, self.bold, self.dim


def cells(text):
    """(row, column, character, style) of everything that is not blank."""
    pen = Pen()
    for row, line in enumerate(text.split("\n")):
        column = 0
        for codes, char in re.findall(r"\x1b\[([0-9;]*)m|([^\x1b])", line):
            if not char:
                pen.sgr(codes)
                continue
            if char not in " \u2800\r":
                yield row, column, char, pen.style()
            column += 1


def main():
    columns = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    rows = int(sys.argv[2]) if len(sys.argv) > 2 else 30
    words, dots, lines = [], {}, {}
    for row, column, char, style in cells(sys.stdin.read()):
        x, y = MARGIN + column * CELL_W, MARGIN + row * CELL_H
        if 0x2800 <= ord(char) < 0x2900:
            for bit, (i, j) in enumerate(DOTS):
                if ord(char) >> bit & 1:
                    spot = (x + CELL_W * (0.25 + 0.5 * i), y + CELL_H * (0.125 + 0.25 * j))
                    dots.setdefault(style[0], []).append("M%g %gh0" % spot)
        elif char in BOX:
            middle = (x + CELL_W / 2, y + CELL_H / 2)
            arm = {"l": (-CELL_W / 2, 0), "r": (CELL_W / 2, 0), "u": (0, -CELL_H / 2), "d": (0, CELL_H / 2)}
            strokes = ["M%g %gl%g %g" % (middle + arm[side]) for side in BOX[char]]
            lines.setdefault(style[0], []).extend(strokes)
        elif words and words[-1][0] == row and words[-1][1] + len(words[-1][2]) == column and words[-1][3] == style:
            words[-1][2] += char
        else:
            words.append([row, column, char, style])
    width, height = 2 * MARGIN + columns * CELL_W, 2 * MARGIN + rows * CELL_H
    print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}">')
    print(f'<rect width="100%" height="100%" rx="8" fill="{BACKGROUND}"/>')
    for colour, path in lines.items():
        print(f'<path d="{"".join(path)}" stroke="{colour}" stroke-linecap="square" fill="none"/>')
    for colour, path in dots.items():
        print(f'<path d="{"".join(path)}" stroke="{colour}" stroke-width="3.2" stroke-linecap="round" fill="none"/>')
    print(f"<g font-family=\"'DejaVu Sans Mono',Menlo,Consolas,monospace\" font-size=\"{FONT}\">")
    for row, column, text, (colour, bold, dim) in words:
        places = " ".join("%g" % (MARGIN + (column + i) * CELL_W) for i in range(len(text)))
        more = (' font-weight="bold"' if bold else "") + (' opacity="0.6"' if dim else "")
        print(f'<text x="{places}" y="{MARGIN + row * CELL_H + 13.5:g}" fill="{colour}"{more}>{escape(text)}</text>')
    print("</g></svg>")


main()
