//! The few shapes of the drawings.

use std::fmt::Write as _;

/// A drawing under way.
pub(crate) struct Svg(String);

pub(crate) const INK: &str = "#222";
pub(crate) const SIGNAL: &str = "#1f5fbf";
pub(crate) const SENSE: &str = "#2c7a2c";
pub(crate) const SUPPLY: &str = "#c0392b";
pub(crate) const GROUND: &str = "#222";
pub(crate) const FADED: &str = "#999";

impl Svg {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"15\" fill=\"{INK}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n"
        ))
    }

    fn push(&mut self, shape: std::fmt::Arguments<'_>) {
        let _ = self.0.write_fmt(shape); // a string takes everything
        self.0.push('\n');
    }

    pub(crate) fn rect(&mut self, (x, y): (f64, f64), (width, height): (f64, f64), fill: &str, stroke: &str) {
        self.push(format_args!(
            "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\" rx=\"6\" fill=\"{fill}\" \
             stroke=\"{stroke}\" stroke-width=\"1.5\"/>"
        ));
    }

    pub(crate) fn line(&mut self, points: &[(f64, f64)], stroke: &str, width: f64) {
        let points: Vec<_> = points.iter().map(|(x, y)| format!("{x},{y}")).collect();
        self.push(format_args!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{stroke}\" stroke-width=\"{width}\"/>",
            points.join(" ")
        ));
    }

    pub(crate) fn dot(&mut self, (x, y): (f64, f64), fill: &str) {
        self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"5\" fill=\"{fill}\"/>"));
    }

    fn put(&mut self, (x, y): (f64, f64), anchor: &str, more: &str, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;");
        self.push(format_args!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\" {more}>{text}</text>"));
    }

    pub(crate) fn text(&mut self, at: (f64, f64), text: &str) {
        self.put(at, "start", "", text);
    }

    pub(crate) fn right(&mut self, at: (f64, f64), text: &str) {
        self.put(at, "end", "", text);
    }

    pub(crate) fn middle(&mut self, at: (f64, f64), text: &str) {
        self.put(at, "middle", "", text);
    }

    pub(crate) fn small(&mut self, at: (f64, f64), text: &str) {
        self.put(at, "middle", "font-size=\"12\" fill=\"#555\"", text);
    }

    pub(crate) fn heading(&mut self, at: (f64, f64), text: &str) {
        self.put(at, "start", "font-size=\"19\" font-weight=\"bold\"", text);
    }

    /// A box with lines of text, the first one bold.
    pub(crate) fn block(
        &mut self,
        (x, y): (f64, f64),
        (width, height): (f64, f64),
        fill: &str,
        lines: &[&str],
    ) {
        self.rect((x, y), (width, height), fill, INK);
        let middle = x + width / 2.0;
        let top = y + height / 2.0 - 9.0 * (lines.len() as f64 - 1.0) + 5.0;
        for (i, line) in lines.iter().enumerate() {
            let weight = if i == 0 { "font-weight=\"bold\"" } else { "font-size=\"13\"" };
            self.put((middle, top + 18.0 * i as f64), "middle", weight, line);
        }
    }

    pub(crate) fn end(self) -> String {
        self.0 + "</svg>\n"
    }
}
