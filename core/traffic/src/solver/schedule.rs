//! The answer: where each car is after each step.

use super::instance::Instance;
use super::table::Track;
use xtb_nav::{MapPose, Path, Piece};

/// Where a car is at one moment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScheduleRow {
    /// In steps.
    pub step: usize,
    /// Where.
    pub pose: MapPose,
    /// What is driven from here to the next row; nothing where it waits, and at the end.
    pub piece: Piece,
}

/// The way of one car.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// The car.
    pub name: String,
    /// One a step, from step 0 to the one in which it stands for good.
    pub rows: Vec<ScheduleRow>,
}

/// The ways of all cars, in the problem's order.
#[derive(Debug, Clone, PartialEq)]
pub struct Schedule {
    /// One a car.
    pub ways: Vec<Way>,
}

impl Schedule {
    pub(crate) fn new<'t>(instance: &Instance, track: impl Fn(usize) -> Option<&'t Track>) -> Self {
        let ways = instance.drivers.iter().enumerate().map(|(car, driver)| {
            let rows = track(car).map_or_else(Vec::new, |track| {
                (0..=track.steps())
                    .map(|step| {
                        let (spot, piece) = track.at(step);
                        ScheduleRow { step, pose: spot.pose(), piece: *piece }
                    })
                    .collect()
            });
            Way { name: driver.name.clone(), rows }
        });
        Self { ways: ways.collect() }
    }

    /// Steps until everyone stands.
    #[must_use]
    pub fn makespan(&self) -> usize {
        self.ways.iter().filter_map(|way| way.rows.last()).map(|row| row.step).max().unwrap_or(0)
    }

    /// Sum of each car's steps until it stands.
    #[must_use]
    pub fn flowtime(&self) -> usize {
        self.ways.iter().filter_map(|way| way.rows.last()).map(|row| row.step).sum()
    }

    /// Way of all cars together, in m.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.ways.iter().flat_map(|way| &way.rows).fold(0.0, |sum, row| sum + row.piece.length_m.abs())
    }
}

impl Way {
    /// The same as a path, without its times.
    #[must_use]
    pub fn path(&self) -> Option<Path> {
        let mut path = Path::standing(self.rows.first()?.pose);
        self.rows.iter().for_each(|row| path.push(row.piece));
        Some(path)
    }
}
