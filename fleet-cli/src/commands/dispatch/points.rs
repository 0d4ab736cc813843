//! Points on the command line, or in a file: `X,Y` or `X,Y,YAW`, in m and degrees.

use std::path::Path;
use xtb_client::{Error, ErrorKind, Result};
use xtb_protocol::messages::{MAX_COORDINATE_M, MAX_POINTS, Waypoint};

/// A file of points is not longer than this.
const MAX_BYTES: usize = 1 << 20;

/// The points that `words` are, or that stand in the file that the only one of them names.
///
/// # Errors
/// [`ErrorKind::Invalid`] with the point, or [`ErrorKind::Config`] with the file's line, that is wrong.
pub(in crate::commands) fn read(words: &[String]) -> Result<Vec<Waypoint>> {
    let points = match words {
        [word] if !looks_like_a_point(word) => return from_file(Path::new(word)),
        words => words.iter().map(|word| point(word).map_err(|what| wrong(word, &what))),
    };
    bounded(points.collect::<Result<_>>()?, ErrorKind::Invalid)
}

fn looks_like_a_point(word: &str) -> bool {
    !Path::new(word).exists() && word.contains(',') || word.trim().parse::<f64>().is_ok()
}

fn wrong(word: &str, what: &str) -> Error {
    Error::new(ErrorKind::Invalid, format!("{:?} is not a point: {what}", word.trim()))
        .hint("a point is X,Y or X,Y,YAW, in m and degrees: 1.5,-2 or 1.5,-2,90; or give a file of points")
}

fn from_file(path: &Path) -> Result<Vec<Waypoint>> {
    let place = path.display();
    let failed = |what: String| Error::new(ErrorKind::Config, what);
    let text = super::text(path, MAX_BYTES)?;
    let mut points = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if !line.is_empty() {
            let point = point(line).map_err(|what| failed(format!("{place}, line {}: {what}", i + 1)))?;
            points.push(point);
        }
    }
    let points = bounded(points, ErrorKind::Config);
    points.map_err(|failure| Error { message: format!("{place}: {}", failure.message), ..failure })
}

fn bounded(points: Vec<Waypoint>, kind: ErrorKind) -> Result<Vec<Waypoint>> {
    match points.len() {
        0 => Err(Error::new(kind, "no points")),
        1..=MAX_POINTS => Ok(points),
        many => Err(Error::new(kind, format!("{many} points, the limit is {MAX_POINTS}"))),
    }
}

/// One point, with commas or blanks.
fn point(text: &str) -> std::result::Result<Waypoint, String> {
    let parts = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty());
    let numbers = parts.map(|part| part.parse::<f64>().map_err(|_| format!("{part:?} is not a number")));
    numbers.collect::<std::result::Result<Vec<f64>, String>>().and_then(|numbers| waypoint(&numbers))
}

/// X and Y in m, and yaw in degrees if it matters.
pub(super) fn waypoint(numbers: &[f64]) -> std::result::Result<Waypoint, String> {
    let (x_m, y_m, yaw_deg) = match *numbers {
        [x_m, y_m] => (x_m, y_m, None),
        [x_m, y_m, yaw_deg] => (x_m, y_m, Some(yaw_deg)),
        _ => return Err(format!("{} numbers; a point has X, Y and optionally YAW", numbers.len())),
    };
    for (name, value) in [("X", x_m), ("Y", y_m)] {
        if !(-MAX_COORDINATE_M..=MAX_COORDINATE_M).contains(&value) {
            return Err(format!("{name} = {value} m is not within ±{MAX_COORDINATE_M}"));
        }
    }
    if let Some(yaw_deg) = yaw_deg.filter(|yaw_deg| !(-360.0..=360.0).contains(yaw_deg)) {
        return Err(format!("YAW = {yaw_deg} degrees is not within ±360"));
    }
    Ok(Waypoint { x_m, y_m, yaw_rad: yaw_deg.map(f64::to_radians) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(words: &[&str]) -> Result<Vec<Waypoint>> {
        read(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn points_are_numbers_with_commas_and_a_yaw_in_degrees() {
        let points = of(&["1,0", " -2,.5", "2,2,90"]).unwrap();
        assert_eq!(points[1], Waypoint { x_m: -2.0, y_m: 0.5, yaw_rad: None });
        assert_eq!(points[2].yaw_rad, Some(std::f64::consts::FRAC_PI_2));
        for (bad, what) in [
            ("1", "1 numbers"),
            ("1,b", "\"b\" is not a number"),
            ("1,2,3,4", "4 numbers"),
            ("nan,0", "X = NaN m"),
            ("1001,0", "X = 1001 m"),
            ("1,2,400", "YAW = 400"),
        ] {
            let failure = of(&[bad, "0,0"]).unwrap_err();
            assert_eq!(failure.kind, ErrorKind::Invalid);
            assert!(failure.message.contains(what), "{failure}");
        }
    }

    #[test]
    fn a_file_has_a_point_in_each_line_and_errors_name_the_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("route.txt");
        let file = path.to_str().unwrap();
        std::fs::write(&path, "# the corridor\n1, 0\n\n2 0 90  # turn\n").unwrap();
        assert_eq!(of(&[file]).unwrap().len(), 2);
        std::fs::write(&path, "1,0\n\n2,x\n").unwrap();
        let failure = of(&[file]).unwrap_err();
        assert!(failure.message.ends_with("route.txt, line 3: \"x\" is not a number"), "{failure}");
        std::fs::write(&path, "# nothing\n").unwrap();
        assert!(of(&[file]).unwrap_err().message.ends_with("route.txt: no points"));
        let missing = of(&["corridor.txt"]).unwrap_err();
        assert!(missing.message.starts_with("cannot read corridor.txt"), "{missing}");
    }

    #[test]
    fn a_route_is_not_longer_than_the_protocol_allows() {
        let failure = read(&vec!["0,0".to_owned(); MAX_POINTS + 1]).unwrap_err();
        assert_eq!(failure.message, "101 points, the limit is 100");
    }
}
