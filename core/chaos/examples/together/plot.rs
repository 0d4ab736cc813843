//! The drawing: the true ways of all trucks from above, with the bodies every few seconds.

use crate::drawing::{DASHED, Floor, SOLID};
use crate::meetings::Meeting;
use plotters::style::{Color, HSLColor};
use std::path::Path;

/// Room, in m.
const SIDE_M: f64 = 8.0;
/// Bodies are drawn at each 25th moment: each 5 s.
const EVERY: usize = 25;

/// One room of [`SIDE_M`] around the origin.
pub(crate) fn draw(file: &Path, made: &Meeting) {
    let mut floor = Floor::new(file, [-SIDE_M / 2.0; 2], [SIDE_M; 2], 160.0, 1);
    let trucks = made.tracks.len();
    for (index, track) in made.tracks.iter().enumerate() {
        // The golden angle never comes round to the same colour.
        let colour = HSLColor((index as f64 * 0.381_966).fract(), 0.67, 0.42);
        floor.line(track.iter().map(|pose| [pose.x_m, pose.y_m]), colour.stroke_width(4), SOLID);
        for pose in track.iter().step_by(EVERY) {
            floor.body(pose, colour.mix(0.45).stroke_width(2), SOLID);
        }
        let (first, last) = (track[0], track[track.len() - 1]);
        floor.body(&first, colour.stroke_width(4), DASHED);
        floor.body(&last, colour.stroke_width(4).filled(), SOLID);
        floor.label([last.x_m, last.y_m], &(index + 1).to_string());
    }
    floor.words(&format!(
        "{trucks} trucks in {SIDE_M} × {SIDE_M} m swap places in {:.0} s, {} contacts; \
         dashed: start, filled: end, thin: each 5 s",
        made.took_s, made.contacts,
    ));
    floor.end();
}
