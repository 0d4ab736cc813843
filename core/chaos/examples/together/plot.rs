//! The drawing: the true ways of all trucks from above, with the bodies every few seconds.

use crate::drawing::Floor;
use crate::meetings::Meeting;

/// Room, in m.
const SIDE_M: f64 = 8.0;
/// Bodies are drawn at each 25th moment: each 5 s.
const EVERY: usize = 25;

/// Of the trucks.
const COLOURS: [&str; 10] = [
    "#1f5fbf", "#c4560a", "#2a8a3a", "#b3261e", "#7a4fb5", "#7a5230", "#c03a92", "#5f6b73", "#8f8f00",
    "#0a8f9c",
];

/// One room of [`SIDE_M`] around the origin.
pub(crate) fn svg(made: &Meeting) -> String {
    let mut floor = Floor::new([-SIDE_M / 2.0; 2], [SIDE_M; 2], 80.0, 1);
    let trucks = made.tracks.len();
    for (index, track) in made.tracks.iter().enumerate() {
        let colour = COLOURS[index % COLOURS.len()];
        let style = format!("fill=\"none\" stroke=\"{colour}\"");
        floor.line(
            track.iter().map(|pose| [pose.x_m, pose.y_m]),
            &format!("stroke=\"{colour}\" stroke-width=\"2\""),
        );
        for pose in track.iter().step_by(EVERY) {
            floor.body(pose, &format!("{style} stroke-width=\"1\" stroke-opacity=\"0.45\""));
        }
        let (first, last) = (track[0], track[track.len() - 1]);
        floor.body(&first, &format!("{style} stroke-width=\"2\" stroke-dasharray=\"4 3\""));
        floor.body(
            &last,
            &format!("fill=\"{colour}\" fill-opacity=\"0.35\" stroke=\"{colour}\" stroke-width=\"2\""),
        );
        floor.label([last.x_m, last.y_m], &(index + 1).to_string());
    }
    floor.words(&format!(
        "{trucks} trucks in {SIDE_M} × {SIDE_M} m swap places in {:.0} s, {} contacts; \
         dashed: start, filled: end, thin: each 5 s",
        made.took_s, made.contacts,
    ));
    floor.end()
}
