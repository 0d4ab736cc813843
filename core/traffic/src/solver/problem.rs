//! The question: a floor, things on it, and cars that want to go somewhere.

use super::motion::MOST_TURN_RAD;
use std::sync::Arc;
use thiserror::Error;
use xtb_nav::planner::space::OneWay;
use xtb_nav::{Car, Cell, Grid, MapPose};

/// Most cars of one problem: sets of them are bits of a u128.
pub const MOST_CARS: usize = 128;

/// Rectangle that no reference point leaves. In m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FloorBounds {
    /// Least x.
    pub west_m: f64,
    /// Least y.
    pub south_m: f64,
    /// Greatest x.
    pub east_m: f64,
    /// Greatest y.
    pub north_m: f64,
}

/// Something that no car may touch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Obstacle {
    /// A round thing.
    Disc {
        /// Middle, in m.
        x_m: f64,
        /// Middle, in m.
        y_m: f64,
        /// In m.
        radius_m: f64,
    },
    /// A rectangle, such as a wall or a crate.
    Box {
        /// Middle, and the direction of its length.
        middle: MapPose,
        /// Half of its length, in m.
        half_length_m: f64,
        /// Half of its width, in m.
        half_width_m: f64,
    },
}

/// One car and where it has to go.
#[derive(Debug, Clone, PartialEq)]
pub struct CarTask {
    /// How messages and the schedule call it.
    pub name: String,
    /// Its body and turning circle.
    pub car: Car,
    /// Where it stands.
    pub start: MapPose,
    /// Where it has to stand at the end.
    pub goal: MapPose,
}

/// What is to be solved.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// No reference point leaves it.
    pub bounds: FloorBounds,
    /// What stands on the floor.
    pub obstacles: Vec<Obstacle>,
    /// Where it may be driven in one direction only; `None` = nowhere.
    pub one_way: Option<Arc<OneWay>>,
    /// Who goes where.
    pub cars: Vec<CarTask>,
    /// Longest way in one step of time, in m; at most the smallest turning radius.
    pub step_m: f64,
    /// What cars keep from each other and from obstacles, in m; less where starts or goals are nearer.
    pub clearance_m: f64,
    /// Within this a car counts as being at its start or goal. Used only where it would touch something.
    pub tolerance: Tolerance,
    /// Whether the schedule is to be driven by its [order](super::precedences) alone: then no car uses in a
    /// step what another one uses in the same step, whoever is early or late in it.
    pub by_order: bool,
}

/// How exactly starts and goals are meant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Tolerance {
    /// In m.
    pub position_m: f64,
    /// In rad.
    pub yaw_rad: f64,
}

/// Start or goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// Where a car stands.
    Start,
    /// Where it wants to go.
    Goal,
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

/// Why a problem has no solution, or makes no sense.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProblemError {
    /// A number is not finite, or out of its range.
    #[error("{what} is {value}, not {expected}")]
    Value {
        /// Which number.
        what: String,
        /// What it is.
        value: f64,
        /// What it should be.
        expected: &'static str,
    },
    /// More than [`MOST_CARS`].
    #[error("{0} vehicles; at most {MOST_CARS} can be planned at once")]
    TooMany(usize),
    /// Two cars with one name.
    #[error("two vehicles have the name {0}")]
    SameName(String),
    /// A start or goal outside of the bounds.
    #[error("the {place} of {name} at ({x_m:.2}, {y_m:.2}) is outside the map")]
    Outside {
        /// Start or goal.
        place: Place,
        /// Whose.
        name: String,
        /// In m.
        x_m: f64,
        /// In m.
        y_m: f64,
    },
    /// A start or goal on an obstacle.
    #[error("the {place} of {name} overlaps the obstacle at ({x_m:.2}, {y_m:.2}) by {overlap_m:.3} m")]
    Blocked {
        /// Start or goal.
        place: Place,
        /// Whose.
        name: String,
        /// How deep even the best place within the tolerance lies in it, in m.
        overlap_m: f64,
        /// Of the obstacle, in m.
        x_m: f64,
        /// Of the obstacle, in m.
        y_m: f64,
    },
    /// Two cars that start, or want to stand, in the same place.
    #[error("the {place}s of {first} and {second} overlap")]
    Overlap {
        /// Starts or goals.
        place: Place,
        /// One of them.
        first: String,
        /// The other.
        second: String,
    },
}

impl Problem {
    /// Checks every number.
    ///
    /// # Errors
    /// The first that is not finite or out of its range, too many cars, or a name used twice.
    pub fn validate(&self) -> Result<(), ProblemError> {
        /// Farther than any map, in m.
        const FAR_M: f64 = 1e4;
        let near = |what: &dyn Fn() -> String, value: f64| {
            let (ok, expected) = ((-FAR_M..=FAR_M).contains(&value), "within ± 10 km");
            if ok { Ok(()) } else { Err(ProblemError::Value { what: what(), value, expected }) }
        };
        let positive = |what: &dyn Fn() -> String, value: f64| {
            let (ok, expected) = (value > 1e-6 && value <= FAR_M, "a length above 0");
            if ok { Ok(()) } else { Err(ProblemError::Value { what: what(), value, expected }) }
        };
        let FloorBounds { west_m, south_m, east_m, north_m } = self.bounds;
        for side in [west_m, south_m, east_m, north_m] {
            near(&|| "a side of the map".to_owned(), side)?;
        }
        positive(&|| "the map's width".to_owned(), east_m - west_m)?;
        positive(&|| "the map's depth".to_owned(), north_m - south_m)?;
        positive(&|| "the length of one step".to_owned(), self.step_m)?;
        near(&|| "the clearance".to_owned(), self.clearance_m)?;
        near(&|| "the tolerance".to_owned(), self.tolerance.position_m + self.tolerance.yaw_rad)?;
        for obstacle in &self.obstacles {
            let what = || "an obstacle's number".to_owned();
            obstacle.numbers().into_iter().try_for_each(|value| near(&what, value))?;
        }
        if self.cars.len() > MOST_CARS {
            return Err(ProblemError::TooMany(self.cars.len()));
        }
        for (i, CarTask { name, car, start, goal }) in self.cars.iter().enumerate() {
            if self.cars[..i].iter().any(|other| other.name == *name) {
                return Err(ProblemError::SameName(name.clone()));
            }
            for value in [start.x_m, start.y_m, start.yaw_rad, goal.x_m, goal.y_m, goal.yaw_rad] {
                near(&|| format!("a number of the start or goal of {name}"), value)?;
            }
            for value in [car.front_m + car.rear_m, car.half_width_m, car.radius_m] {
                positive(&|| format!("a measure of {name}"), value)?;
            }
            if self.step_m > car.radius_m * MOST_TURN_RAD {
                let (what, expected) =
                    (format!("the length of one step of {name}"), "at most its turning radius");
                return Err(ProblemError::Value { what, value: self.step_m, expected });
            }
        }
        Ok(())
    }
}

impl Obstacle {
    fn numbers(&self) -> [f64; 5] {
        match *self {
            Self::Disc { x_m, y_m, radius_m } => [x_m, y_m, radius_m, 0.0, 0.0],
            Self::Box { middle, half_length_m, half_width_m } => {
                [middle.x_m, middle.y_m, middle.yaw_rad, half_length_m, half_width_m]
            }
        }
    }

    /// Middle of it, in m.
    #[must_use]
    pub fn middle_m(&self) -> [f64; 2] {
        match self {
            Self::Disc { x_m, y_m, .. } => [*x_m, *y_m],
            Self::Box { middle, .. } => [middle.x_m, middle.y_m],
        }
    }

    /// Farthest point of it from its middle, in m.
    #[must_use]
    pub fn reach_m(&self) -> f64 {
        match self {
            Self::Disc { radius_m, .. } => *radius_m,
            Self::Box { half_length_m, half_width_m, .. } => libm::hypot(*half_length_m, *half_width_m),
        }
    }
}

/// The squares of a grid that are not free, as few boxes as rows allow: runs of one row, grown
/// northwards as long as the rows are alike.
#[must_use]
pub fn obstacles_of(grid: &Grid) -> Vec<Obstacle> {
    let (width, height, side) = (grid.width(), grid.height(), grid.resolution_m());
    let solid = |column: usize, row: usize| grid.cells()[row * width + column] != Cell::Free;
    let mut taken = vec![false; width * height];
    let mut boxes = Vec::new();
    for row in 0..height {
        let mut column = 0;
        while column < width {
            let begin = column;
            while column < width && solid(column, row) && !taken[row * width + column] {
                column += 1;
            }
            if column == begin {
                column += 1;
                continue;
            }
            let alike = |r: &usize| (begin..column).all(|c| solid(c, *r) && !taken[*r * width + c]);
            let rows = (row..height).take_while(alike).count();
            for r in row..row + rows {
                taken[r * width + begin..r * width + column].fill(true);
            }
            let columns = column - begin;
            let [west, south] = grid.origin_m();
            boxes.push(Obstacle::Box {
                middle: MapPose {
                    x_m: west + (begin as f64 + columns as f64 / 2.0) * side,
                    y_m: south + (row as f64 + rows as f64 / 2.0) * side,
                    yaw_rad: 0.0,
                },
                half_length_m: columns as f64 * side / 2.0,
                half_width_m: rows as f64 * side / 2.0,
            });
        }
    }
    boxes
}
