//! Which part of the floor the map shows, and which cell of it is where.

use ratatui::layout::Rect;

/// Finest and coarsest width of a cell, in m.
const SCALES_M: (f64, f64) = (0.01, 50.0);
/// One step of the zoom.
const ZOOM: f64 = 1.5;
/// Around what is shown as a whole.
const MARGIN_M: f64 = 0.3;

/// What decides on the part that is shown.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Mode {
    /// Everything fits.
    Whole,
    /// As the person has put it.
    Free,
    /// A robot stays in the middle.
    Follow,
}

/// The part that is shown. A cell is twice as high as wide.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct View {
    mode: Mode,
    centre: (f64, f64),
    /// Width of a cell.
    scale_m: f64,
    columns: f64,
    rows: f64,
}

impl View {
    /// Everything, on no screen yet.
    pub(super) fn new() -> Self {
        Self { mode: Mode::Whole, centre: (0.0, 0.0), scale_m: 0.1, columns: 1.0, rows: 1.0 }
    }

    /// Takes in where there is to draw, what there is to show, and where the selected robot is.
    pub(super) fn arrange(&mut self, area: Rect, bounds: ([f64; 2], [f64; 2]), followed: Option<(f64, f64)>) {
        // Signs stand between the first and the last cell: one less than there are.
        self.columns = f64::from(area.width.saturating_sub(1).max(1));
        self.rows = f64::from(area.height.saturating_sub(1).max(1));
        match (self.mode, followed) {
            (Mode::Whole, _) => {
                let (x, y) = bounds;
                let (width_m, height_m) = (x[1] - x[0] + 2.0 * MARGIN_M, y[1] - y[0] + 2.0 * MARGIN_M);
                self.centre = ((x[0] + x[1]) / 2.0, (y[0] + y[1]) / 2.0);
                let scale_m = (width_m / self.columns).max(height_m / (2.0 * self.rows));
                self.scale_m = scale_m.clamp(SCALES_M.0, SCALES_M.1);
            }
            (Mode::Follow, Some(at)) => self.centre = at,
            _ => {}
        }
    }

    /// West and east, south and north edge.
    pub(super) fn bounds(&self) -> ([f64; 2], [f64; 2]) {
        let (x, y) = (self.scale_m * self.columns / 2.0, self.scale_m * self.rows);
        ([self.centre.0 - x, self.centre.0 + x], [self.centre.1 - y, self.centre.1 + y])
    }

    /// Width and height of a cell.
    pub(super) fn cell_m(&self) -> (f64, f64) {
        (self.scale_m, 2.0 * self.scale_m)
    }

    /// The middle of what is shown.
    pub(super) fn centre(&self) -> (f64, f64) {
        self.centre
    }

    /// Whether the selected robot stays in the middle.
    pub(super) fn follows(&self) -> bool {
        self.mode == Mode::Follow
    }

    /// The cell of `area` in which a point lies; `None` = it is not shown. As the canvas puts its labels.
    pub(super) fn cell(&self, area: Rect, (x_m, y_m): (f64, f64)) -> Option<(u16, u16)> {
        let (x, y) = self.bounds();
        let inside = (x[0]..=x[1]).contains(&x_m) && (y[0]..=y[1]).contains(&y_m);
        let column = ((x_m - x[0]) * self.columns / (x[1] - x[0])) as u16;
        let row = ((y[1] - y_m) * self.rows / (y[1] - y[0])) as u16;
        (inside && column < area.width && row < area.height).then(|| (area.x + column, area.y + row))
    }

    /// Everything again.
    pub(super) fn whole(&mut self) {
        self.mode = Mode::Whole;
    }

    /// Follows the selected robot, or no longer does.
    pub(super) fn follow(&mut self) {
        self.mode = if self.follows() { Mode::Free } else { Mode::Follow };
    }

    /// Nearer or farther, about a point if one is given.
    pub(super) fn zoom(&mut self, nearer: bool, about: Option<(f64, f64)>) {
        if let Some(about) = about.filter(|_| self.mode == Mode::Whole) {
            self.centre = about;
        }
        if self.mode == Mode::Whole {
            self.mode = Mode::Free;
        }
        let scale_m = if nearer { self.scale_m / ZOOM } else { self.scale_m * ZOOM };
        self.scale_m = scale_m.clamp(SCALES_M.0, SCALES_M.1);
    }

    /// By so many halves of what is shown, to the east and to the north.
    pub(super) fn pan(&mut self, east: i8, north: i8) {
        self.mode = Mode::Free;
        let (x, y) = self.bounds();
        self.centre.0 += f64::from(east) * (x[1] - x[0]) / 2.0;
        self.centre.1 += f64::from(north) * (y[1] - y[0]) / 2.0;
    }

    /// So that a point is shown.
    pub(super) fn reveal(&mut self, (x_m, y_m): (f64, f64)) {
        let (x, y) = self.bounds();
        // By a cell more than to the edge, so that rounding does not matter.
        let beyond = |at: f64, [low, high]: [f64; 2], cell_m: f64| match at {
            at if at > high => at - high + cell_m,
            at if at < low => at - low - cell_m,
            _ => 0.0,
        };
        let (width_m, height_m) = self.cell_m();
        let (east_m, north_m) = (beyond(x_m, x, width_m), beyond(y_m, y, height_m));
        if east_m != 0.0 || north_m != 0.0 {
            self.mode = Mode::Free;
            self.centre = (self.centre.0 + east_m, self.centre.1 + north_m);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> (View, Rect) {
        let (mut view, area) = (View::new(), Rect::new(2, 1, 41, 21));
        view.arrange(area, ([-6.0, 6.0], [-7.0, 7.0]), None);
        (view, area)
    }

    #[test]
    fn the_whole_room_is_shown_and_its_corners_lie_in_cells() {
        let (view, area) = room();
        let (x, y) = view.bounds();
        assert!(x[0] <= -6.0 && x[1] >= 6.0 && y[0] <= -7.0 && y[1] >= 7.0, "{x:?} {y:?}");
        assert_eq!(view.cell_m().1, 2.0 * view.cell_m().0);
        for corner in [(-6.0, -7.0), (6.0, 7.0), (0.0, 0.0)] {
            assert!(view.cell(area, corner).is_some(), "{corner:?}");
        }
        assert_eq!(view.cell(area, (0.0, 99.0)), None);
        let (left, right) = (view.cell(area, (-5.0, 0.0)).unwrap(), view.cell(area, (5.0, 0.0)).unwrap());
        assert!(left.0 < right.0 && left.1 == right.1);
        assert!(
            view.cell(area, (0.0, 5.0)).unwrap().1 < view.cell(area, (0.0, -5.0)).unwrap().1,
            "north is up"
        );
    }

    #[test]
    fn zoom_pan_follow_and_whole_again() {
        let (mut view, area) = room();
        let whole = view;
        view.zoom(true, Some((3.0, 3.0)));
        assert_eq!((view.centre(), view.cell_m().0), ((3.0, 3.0), whole.cell_m().0 / ZOOM));
        view.pan(-1, 0);
        assert!(view.centre().0 < 3.0);
        view.follow();
        view.arrange(area, ([-6.0, 6.0], [-7.0, 7.0]), Some((1.0, 2.0)));
        assert!(view.follows() && view.centre() == (1.0, 2.0));
        view.reveal((1.0, 99.0));
        assert!(view.bounds().1[1] >= 99.0);
        view.whole();
        view.arrange(area, ([-6.0, 6.0], [-7.0, 7.0]), None);
        assert_eq!(view, whole);
    }
}
