//! Points on the command line, or in a file: `X,Y` or `X,Y,YAW`, in m and degrees, or the name of a place.

use crate::context::Context;
use std::path::Path;
use xtb_client::{Client, Error, ErrorKind, Result, map_source};
use xtb_protocol::messages::{MAX_COORDINATE_M, MAX_POINTS, MapPlace, Waypoint, place_name};

/// A file of points is not longer than this.
const MAX_BYTES: usize = 1 << 20;

/// A point as people wrote it.
struct Written {
    text: String,
    /// The file and the line, counted from 1; `None` = on the command line.
    at: Option<(String, usize)>,
}

/// The points that `words` are, or that stand in the file that the only one of them names. The map server is asked
/// if one is the name of a place.
///
/// # Errors
/// [`ErrorKind::Invalid`] with the point, or [`ErrorKind::Config`] with the file's line, that is wrong; no router.
pub(in crate::commands) async fn read(ctx: &Context, words: &[String]) -> Result<Vec<Waypoint>> {
    let written = written(words)?;
    let names = written.iter().any(|point| place_name(&point.text).is_ok());
    let places = if names { places(ctx).await? } else { Vec::new() };
    parse(&written, &places)
}

/// The places of the fleet's map.
pub(super) async fn places(ctx: &Context) -> Result<Vec<MapPlace>> {
    let client = Client::open(&ctx.settings).await?;
    let places = map_source::places(client.bus(), client.keys(), ctx.settings.timeout).await;
    client.close().await;
    places?.ok_or_else(map_source::no_map)
}

fn written(words: &[String]) -> Result<Vec<Written>> {
    match words {
        [word] if is_a_file(word) => from_file(Path::new(word)),
        words => Ok(words.iter().map(|word| Written { text: word.trim().to_owned(), at: None }).collect()),
    }
}

fn is_a_file(word: &str) -> bool {
    let is_point = word.contains(',') || word.trim().parse::<f64>().is_ok() || place_name(word).is_ok();
    Path::new(word).exists() || !is_point
}

fn from_file(path: &Path) -> Result<Vec<Written>> {
    let text = super::text(path, MAX_BYTES)?;
    let lines = text.lines().map(|line| line.split('#').next().unwrap_or_default().trim());
    let points = lines.enumerate().filter(|(_, line)| !line.is_empty());
    let written: Vec<_> = points
        .map(|(i, line)| Written { text: line.to_owned(), at: Some((path.display().to_string(), i + 1)) })
        .collect();
    match written.len() {
        0 => Err(Error::new(ErrorKind::Config, format!("{}: no points", path.display()))
            .hint("a line is X,Y or X,Y,YAW, in m and degrees")),
        _ => Ok(written),
    }
}

fn parse(written: &[Written], places: &[MapPlace]) -> Result<Vec<Waypoint>> {
    if written.len() > MAX_POINTS {
        let kind = if written[0].at.is_some() { ErrorKind::Config } else { ErrorKind::Invalid };
        return Err(Error::new(kind, format!("{} points, the limit is {MAX_POINTS}", written.len())));
    }
    written.iter().map(|point| self::point(&point.text, places).map_err(|what| wrong(point, &what))).collect()
}

fn wrong(written: &Written, what: &str) -> Error {
    match &written.at {
        Some((path, line)) => Error::new(ErrorKind::Config, format!("{path}, line {line}: {what}")),
        None => Error::new(ErrorKind::Invalid, format!("{:?} is not a point: {what}", written.text)),
    }
    .hint(
        "a point is X,Y or X,Y,YAW, in m and degrees: 1.5,-2 or 1.5,-2,90; or the name of a place \
         (`fleet-cli place list`); or give a file of points",
    )
}

/// One point: numbers with commas or blanks, or a place.
fn point(text: &str, places: &[MapPlace]) -> std::result::Result<Waypoint, String> {
    if place_name(text).is_ok() {
        return named(text, places);
    }
    let parts = text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty());
    let numbers = parts.map(|part| part.parse::<f64>().map_err(|_| format!("{part:?} is not a number")));
    numbers.collect::<std::result::Result<Vec<f64>, String>>().and_then(|numbers| waypoint(&numbers))
}

/// The point of the place of this name.
pub(super) fn named(name: &str, places: &[MapPlace]) -> std::result::Result<Waypoint, String> {
    let found = places.iter().find(|place| place.name.as_str() == name);
    let &MapPlace { x_m, y_m, yaw_rad, .. } = found.ok_or_else(|| format!("there is no place {name:?}"))?;
    Ok(Waypoint { x_m, y_m, yaw_rad })
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
        let dock: MapPlace =
            serde_json::from_str(r#"{"name":"dock-1","x_m":3,"y_m":4,"yaw_rad":1}"#).unwrap();
        written(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>())
            .and_then(|written| parse(&written, &[dock]))
    }

    #[test]
    fn a_place_is_a_point_by_its_name() {
        let dock = Waypoint { x_m: 3.0, y_m: 4.0, yaw_rad: Some(1.0) };
        assert_eq!(of(&["dock-1"]).unwrap(), [dock]);
        assert_eq!(of(&["1,2", "dock-1"]).unwrap()[1], dock);
        let failure = of(&["dock-2", "dock-1"]).unwrap_err();
        assert_eq!(failure.message, "\"dock-2\" is not a point: there is no place \"dock-2\"");
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
        std::fs::write(&path, "# the corridor\n1, 0\n\n2 0 90  # turn\ndock-1\n").unwrap();
        assert_eq!(of(&[file]).unwrap().len(), 3);
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
        let failure = of(&["0,0"; MAX_POINTS + 1]).unwrap_err();
        assert_eq!(failure.message, "101 points, the limit is 100");
    }
}
