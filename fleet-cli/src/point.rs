//! A point on the command line: two coordinates, or the name of a place.

use crate::context::Context;
use crate::values::metres;
use clap::Args;
use xtb_client::{Client, Error, ErrorKind, Result, map_source};
use xtb_protocol::Name;
use xtb_protocol::messages::{MapPlace, Waypoint, place_name};

/// A point of the map: its coordinates, or the name of a place.
#[derive(Debug, Clone, PartialEq, Args)]
pub struct PointArgs {
    /// East, in m; or a place (`fleet-cli place list`).
    #[arg(value_name = "X|PLACE", value_parser = PointWord::parse)]
    pub point: PointWord,
    /// North, in m.
    #[arg(value_name = "Y", value_parser = metres)]
    pub y_m: Option<f64>,
}

/// The first word of a point.
#[derive(Debug, Clone, PartialEq)]
pub enum PointWord {
    /// East, in m.
    X(f64),
    /// A place's name.
    Place(Name),
}

/// A point as it was written.
pub(crate) enum Written<'a> {
    Point(Waypoint),
    Place(&'a Name),
}

impl PointWord {
    pub(crate) fn parse(text: &str) -> std::result::Result<Self, String> {
        match place_name(text) {
            Ok(name) => Ok(Self::Place(name)),
            Err(_) => metres(text).map(Self::X).map_err(|error| format!("{error}, or the name of a place")),
        }
    }
}

impl PointArgs {
    /// Whether it names a place, so that somebody has to be asked for it.
    pub(crate) fn is_place(&self) -> bool {
        matches!(self.point, PointWord::Place(_))
    }

    /// The point; a place is asked for at the map server.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: a number too few or too many, or there is no such place; else no router.
    pub(crate) async fn resolve(&self, ctx: &Context) -> Result<Waypoint> {
        if let Written::Point(at) = self.written()? {
            return Ok(at);
        }
        let client = Client::open(&ctx.settings).await?;
        let found = self.find(&client).await;
        client.close().await;
        found.map(|(at, _)| at)
    }

    /// The point, and the place that it is of.
    ///
    /// # Errors
    /// As [`Self::resolve`].
    pub(crate) async fn find(&self, client: &Client) -> Result<(Waypoint, Option<MapPlace>)> {
        let name = match self.written()? {
            Written::Point(at) => return Ok((at, None)),
            Written::Place(name) => name.as_str(),
        };
        let within = client.settings().timeout;
        let place = map_source::place(client.bus(), client.keys(), name, within).await?;
        let MapPlace { x_m, y_m, yaw_rad, .. } = place;
        Ok((Waypoint { x_m, y_m, yaw_rad }, Some(place)))
    }

    /// What stands there.
    ///
    /// # Errors
    /// [`ErrorKind::Invalid`]: a number too few or too many.
    pub(crate) fn written(&self) -> Result<Written<'_>> {
        match (&self.point, self.y_m) {
            (PointWord::X(x_m), Some(y_m)) => Ok(Written::Point(Waypoint { x_m: *x_m, y_m, yaw_rad: None })),
            (PointWord::X(x_m), None) => {
                let error =
                    Error::new(ErrorKind::Invalid, format!("a point needs two numbers; {x_m} is X alone"));
                Err(error.hint("give X and Y in m, or the name of a place"))
            }
            (PointWord::Place(name), Some(y_m)) => {
                let message = format!("{name} is the name of a place, which needs no Y ({y_m})");
                Err(Error::new(ErrorKind::Invalid, message).hint("give X and Y in m, or a place alone"))
            }
            (PointWord::Place(name), None) => Ok(Written::Place(name)),
        }
    }
}
