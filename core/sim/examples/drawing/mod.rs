//! A floor from above as SVG, for the drawings of docs/navigation.md.

use std::fmt::{Arguments, Write};
use xtb_control::VehicleConfig;
use xtb_nav::{Car, Cell, Grid, MapPose, Path};

/// Around the floor, in pixels.
const EDGE: f64 = 20.0;
/// A line of words below it, in pixels.
const LINE: f64 = 24.0;
/// Between two points of a path, in m.
const STEP_M: f64 = 0.05;

/// A part of the floor at so many pixels a metre; x east and y north in m.
pub(crate) struct Floor {
    west_m: f64,
    north_m: f64,
    size_m: [f64; 2],
    scale: f64,
    lines: usize,
    svg: String,
}

impl Floor {
    /// `lines` of words fit below it.
    pub(crate) fn new(south_west_m: [f64; 2], size_m: [f64; 2], scale: f64, lines: usize) -> Self {
        let [west_m, south_m] = south_west_m;
        let (wide, high) = (size_m[0] * scale, size_m[1] * scale);
        let (width, height) = (wide + 2.0 * EDGE, high + 2.0 * EDGE + LINE * lines as f64);
        let mut floor =
            Self { west_m, north_m: south_m + size_m[1], size_m, scale, lines: 0, svg: String::new() };
        floor.add(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" \
             height=\"{height}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"#222\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>\n\
             <clipPath id=\"floor\"><rect x=\"{EDGE}\" y=\"{EDGE}\" width=\"{wide}\" height=\"{high}\"/></clipPath>\n\
             <g clip-path=\"url(#floor)\">"
        ));
        floor
    }

    /// The drawing, with its border.
    pub(crate) fn end(mut self) -> String {
        let [wide, high] = self.size_m.map(|m| m * self.scale);
        let open = if self.lines == 0 { "</g>\n" } else { "" };
        self.add(format_args!(
            "{open}<rect x=\"{EDGE}\" y=\"{EDGE}\" width=\"{wide}\" height=\"{high}\" fill=\"none\" stroke=\"#222\" \
             stroke-width=\"3\"/>\n</svg>"
        ));
        self.svg
    }

    fn add(&mut self, line: Arguments<'_>) {
        writeln!(self.svg, "{line}").unwrap();
    }

    fn px(&self, [x_m, y_m]: [f64; 2]) -> (f64, f64) {
        (EDGE + (x_m - self.west_m) * self.scale, EDGE + (self.north_m - y_m) * self.scale)
    }

    fn points(&self, points: impl IntoIterator<Item = [f64; 2]>) -> String {
        points.into_iter().fold(String::new(), |mut all, point| {
            let (x, y) = self.px(point);
            write!(all, "{x:.1},{y:.1} ").unwrap();
            all
        })
    }

    /// A line from point to point.
    pub(crate) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points = self.points(points);
        self.add(format_args!("<polyline points=\"{points}\" fill=\"none\" {style}/>"));
    }

    /// A filled shape.
    pub(crate) fn shape(&mut self, corners: impl IntoIterator<Item = [f64; 2]>, style: &str) {
        let points = self.points(corners);
        self.add(format_args!("<polygon points=\"{points}\" {style}/>"));
    }

    /// A disc of so many pixels.
    pub(crate) fn dot(&mut self, point: [f64; 2], radius: f64, style: &str) {
        let (x, y) = self.px(point);
        self.add(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" {style}/>"));
    }

    /// Words in the middle of a point.
    #[allow(dead_code)] // only one of the examples has any
    pub(crate) fn label(&mut self, point: [f64; 2], text: &str) {
        let (x, y) = self.px(point);
        self.add(format_args!(
            "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
            y + 5.0
        ));
    }

    /// A truck's body, with a nose.
    pub(crate) fn body(&mut self, pose: &MapPose, style: &str) {
        let car = Car::of(&VehicleConfig::default());
        self.shape(car.corners(pose), style);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let [(x1, y1), (x2, y2)] =
            [0.15, car.front_m].map(|ahead_m| self.px([pose.x_m + ahead_m * cos, pose.y_m + ahead_m * sin]));
        self.add(format_args!("<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" {style}/>"));
    }

    /// A path: ahead in one style, astern in another.
    pub(crate) fn path(&mut self, path: &Path, ahead: &str, astern: &str) {
        let mut from = path.start;
        let mut stretch = vec![[from.x_m, from.y_m]];
        for (index, piece) in path.pieces.iter().enumerate() {
            let steps = libm::ceil(piece.length_m.abs() / STEP_M).max(1.0) as u32;
            let way_m = |step: u32| piece.length_m * f64::from(step) / f64::from(steps);
            let poses = (1..=steps).map(|step| piece.after(&from, way_m(step)));
            stretch.extend(poses.map(|pose| [pose.x_m, pose.y_m]));
            from = piece.end(&from);
            if path.pieces.get(index + 1).is_none_or(|next| next.gear() != piece.gear()) {
                let style = if piece.gear() > 0.0 { ahead } else { astern };
                self.line(std::mem::take(&mut stretch), style);
                stretch.push([from.x_m, from.y_m]);
            }
        }
    }

    /// Where the gear changes.
    pub(crate) fn cusps(&mut self, path: &Path, style: &str) {
        let mut at = path.start;
        for pair in path.pieces.windows(2) {
            at = pair[0].end(&at);
            if pair[0].gear() != pair[1].gear() {
                self.dot([at.x_m, at.y_m], 5.0, style);
            }
        }
    }

    /// What a map has that is not free: occupied cells, and unknown ones.
    pub(crate) fn grid(&mut self, grid: &Grid, occupied: &str, unknown: &str) {
        for (cell, style) in [(Cell::Occupied, occupied), (Cell::Unknown, unknown)] {
            let mut outline = String::new();
            for [column, row, wide, high] in rects(grid, cell) {
                let [x_m, y_m] = grid.centre_m(column, row);
                let half_m = grid.resolution_m() / 2.0;
                let (x, y) = self.px([x_m - half_m, y_m - half_m]);
                let [w, h] = [wide, high].map(|cells| cells as f64 * grid.resolution_m() * self.scale);
                write!(outline, "M{x:.1} {y:.1}h{w:.1}v-{h:.1}h-{w:.1}z").unwrap();
            }
            self.add(format_args!("<path d=\"{outline}\" {style}/>"));
        }
    }

    /// Words below the floor; nothing of the floor may come after them.
    pub(crate) fn words(&mut self, text: &str) {
        if self.lines == 0 {
            self.add(format_args!("</g>"));
        }
        let y = EDGE * 2.0 + self.size_m[1] * self.scale + LINE * self.lines as f64 + 8.0;
        self.lines += 1;
        self.add(format_args!("<text x=\"{EDGE}\" y=\"{y:.1}\">{text}</text>"));
    }
}

/// Column, row, width and height of rectangles that cover all cells of one kind.
fn rects(grid: &Grid, cell: Cell) -> Vec<[i64; 4]> {
    let (width, height) = (grid.width() as i64, grid.height() as i64);
    let (mut done, mut open): (Vec<[i64; 4]>, Vec<[i64; 4]>) = (Vec::new(), Vec::new());
    for row in 0..height {
        let (mut runs, mut column) = (Vec::new(), 0);
        while column < width {
            let wide = (column..width).take_while(|c| grid.cell(*c, row) == cell).count() as i64;
            if wide > 0 {
                runs.push([column, row, wide, 1]);
            }
            column += wide.max(1);
        }
        // A run that goes on upwards is one rectangle.
        for run in &mut runs {
            if let Some(at) = open.iter().position(|below| below[0] == run[0] && below[2] == run[2]) {
                let below = open.swap_remove(at);
                *run = [below[0], below[1], below[2], below[3] + 1];
            }
        }
        done.append(&mut open);
        open = runs;
    }
    done.append(&mut open);
    done.sort_unstable();
    done
}
