//! Sets of cars, as bits.

use super::problem::MOST_CARS;

/// A bit for each of [`MOST_CARS`] cars.
pub(crate) type Cars = u128;
const _: () = assert!(MOST_CARS == Cars::BITS as usize);

/// The cars whose bits are set.
pub(crate) fn bits(mut cars: Cars) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        if cars == 0 {
            return None;
        }
        let car = cars.trailing_zeros() as usize;
        cars &= cars - 1;
        Some(car)
    })
}
