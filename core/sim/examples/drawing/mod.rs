//! A floor from above as SVG, for the drawings of docs/navigation.md.

use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use xtb_control::VehicleConfig;
use xtb_nav::{Car, Cell, Grid, MapPose, Path};

/// Around the floor, in pixels.
const EDGE: u32 = 40;
/// A line of words below it, in pixels.
const LINE: u32 = 46;
/// Of the words; the size in pixels, times 1.24.
const FONT: (&str, i32) = ("sans-serif", 32);
/// Between two points of a path, in m.
const STEP_M: f64 = 0.1;
pub(crate) const INK: RGBColor = RGBColor(0x22, 0x22, 0x22);
pub(crate) const BLUE: RGBColor = RGBColor(0x1f, 0x5f, 0xbf);
pub(crate) const ORANGE: RGBColor = RGBColor(0xc4, 0x56, 0x0a);
pub(crate) const RED: RGBColor = RGBColor(0xb3, 0x26, 0x1e);
/// A line's dash and gap, in pixels; this dash never ends.
pub(crate) const SOLID: [i32; 2] = [1_000_000, 0];
pub(crate) const DASHED: [i32; 2] = [9, 7];

/// A part of the floor at so many pixels a metre; x east and y north in m.
pub(crate) struct Floor<'a> {
    root: DrawingArea<SVGBackend<'a>, Shift>,
    area: DrawingArea<SVGBackend<'a>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    /// Where the next line of words begins, in pixels.
    below: i32,
}

impl<'a> Floor<'a> {
    /// To be written into this file; `lines` of words fit below it.
    pub(crate) fn new(
        file: &'a std::path::Path,
        [west_m, south_m]: [f64; 2],
        [wide_m, deep_m]: [f64; 2],
        scale: f64,
        lines: u32,
    ) -> Self {
        let [wide, deep] = [wide_m, deep_m].map(|m| (m * scale) as u32 + 2 * EDGE);
        let root = SVGBackend::new(file, (wide, deep + lines * LINE)).into_drawing_area();
        root.fill(&WHITE).unwrap();
        let chart = ChartBuilder::on(&root)
            .margin(EDGE)
            .margin_bottom(EDGE + lines * LINE)
            .build_cartesian_2d(west_m..west_m + wide_m, south_m..south_m + deep_m)
            .unwrap();
        let area = chart.plotting_area().clone();
        Self { root, area, below: (deep - EDGE / 2) as i32 }
    }

    /// Writes the drawing, with its border.
    pub(crate) fn end(self) {
        let (x, y) = self.area.get_pixel_range();
        let [a, c] = [(x.start, y.start), (x.end, y.end)];
        let border = vec![a, (c.0, a.1), c, (a.0, c.1), a];
        self.root.draw(&PathElement::new(border, INK.stroke_width(5))).unwrap();
        self.root.present().unwrap();
    }

    /// A line from point to point.
    pub(crate) fn line(
        &self,
        points: impl IntoIterator<Item = [f64; 2]>,
        style: impl Into<ShapeStyle>,
        [dash, gap]: [i32; 2],
    ) {
        let points: Vec<(f64, f64)> = points.into_iter().map(<(f64, f64)>::from).collect();
        self.area.draw(&DashedPathElement::new(points, dash, gap, style)).unwrap();
    }

    /// A shape of four corners, filled if its style is.
    pub(crate) fn shape(&self, corners: [[f64; 2]; 4], style: impl Into<ShapeStyle>, dashes: [i32; 2]) {
        let style: ShapeStyle = style.into();
        if style.filled {
            let corners = corners.map(<(f64, f64)>::from).to_vec();
            self.area.draw(&Polygon::new(corners, style.color.mix(0.35))).unwrap();
        }
        self.line(corners.into_iter().chain([corners[0]]), style, dashes);
    }

    /// A disc of so many pixels.
    pub(crate) fn dot(&self, [x_m, y_m]: [f64; 2], radius: i32, colour: RGBColor) {
        self.area.draw(&Circle::new((x_m, y_m), radius, colour.filled())).unwrap();
    }

    /// Words in the middle of a point.
    #[allow(dead_code)] // only one of the examples has any
    pub(crate) fn label(&self, [x_m, y_m]: [f64; 2], text: &str) {
        let style = FONT.into_font().color(&INK).pos(Pos::new(HPos::Center, VPos::Center));
        self.area.draw(&Text::new(text, (x_m, y_m), style)).unwrap();
    }

    /// A truck's body, with a nose.
    pub(crate) fn body(&self, pose: &MapPose, style: impl Into<ShapeStyle>, dashes: [i32; 2]) {
        let (car, style): (Car, ShapeStyle) = (Car::of(&VehicleConfig::default()), style.into());
        self.shape(car.corners(pose), style, dashes);
        let (sin, cos) = libm::sincos(pose.yaw_rad);
        let ahead = |m: f64| [pose.x_m + m * cos, pose.y_m + m * sin];
        self.line([ahead(0.15), ahead(car.front_m)], style, dashes);
    }

    /// A path: ahead in one style, astern in another.
    pub(crate) fn path(&self, path: &Path, ahead: ShapeStyle, astern: ShapeStyle, dashes: [i32; 2]) {
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
                self.line(std::mem::take(&mut stretch), style, dashes);
                stretch.push([from.x_m, from.y_m]);
            }
        }
    }

    /// Where the gear changes.
    pub(crate) fn cusps(&self, path: &Path, colour: RGBColor) {
        let mut at = path.start;
        for pair in path.pieces.windows(2) {
            at = pair[0].end(&at);
            if pair[0].gear() != pair[1].gear() {
                self.dot([at.x_m, at.y_m], 11, WHITE);
                self.dot([at.x_m, at.y_m], 9, colour);
            }
        }
    }

    /// What a map has that is not free: occupied cells, and unknown ones.
    pub(crate) fn grid(&self, grid: &Grid) {
        let (side_m, half_m) = (grid.resolution_m(), grid.resolution_m() / 2.0);
        let (occupied, unknown) = (RGBColor(0x5b, 0x65, 0x70), RGBColor(0xd5, 0xd9, 0xdd));
        for (cell, colour) in [(Cell::Occupied, occupied), (Cell::Unknown, unknown)] {
            for [column, row, wide, high] in rects(grid, cell) {
                let [x_m, y_m] = grid.centre_m(column, row).map(|m| m - half_m);
                let [wide_m, high_m] = [wide, high].map(|cells| cells as f64 * side_m);
                let corners = [(x_m, y_m), (x_m + wide_m, y_m + high_m)];
                self.area.draw(&Rectangle::new(corners, colour.filled())).unwrap();
            }
        }
    }

    /// Words below the floor.
    pub(crate) fn words(&mut self, text: &str) {
        self.root.draw_text(text, &FONT.into_font().color(&INK), (EDGE as i32, self.below)).unwrap();
        self.below += LINE as i32;
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
