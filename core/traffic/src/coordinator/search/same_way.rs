//! The same way at other times: as early as all others let a truck drive it.
//!
//! Safe intervals as in [`super`], but piece by piece along one way: at the end of each, of all arrivals that have until
//! the same tick to go on, the earliest is kept.

use super::{COARSE, MOVES, Search};
use crate::coordinator::occupancy::{NEVER, TICK_WAY_M};
use crate::coordinator::task::{Leg, Stuck, Task};
use xtb_nav::Piece;
use xtb_nav::geometry::rect::{LOOK_OUT_M, Stand};

/// So many arrivals are kept at the end of each piece; chosen, not measured.
const MOST_ARRIVALS: usize = 8;

/// The end of a piece, reached at a tick, where it may stay until another one; when it left the piece's start, and which
/// of the arrivals there.
#[derive(Clone, Copy)]
struct Arrival {
    tick: u32,
    safe: u32,
    depart: u32,
    from: usize,
}

/// When each of these pieces, one behind the other from the start on, is driven so that the end is reached as early as it
/// can be, and for good. As many pieces as an expanded node makes moves count one down in `left`.
pub(in crate::coordinator) fn keep_to(
    task: &Task<'_>,
    pieces: &[Piece],
    left: &mut u32,
) -> Result<Vec<Leg>, Stuck> {
    let search = Search::new(task, &COARSE, LOOK_OUT_M)?;
    let safe = search.crowd.safe_until(&Stand::still(task.car, &task.start), task.tick);
    let mut arrivals = vec![vec![Arrival { tick: task.tick, safe, depart: task.tick, from: 0 }]];
    let (mut legs, mut sweep) = (Vec::new(), Vec::new());
    let (mut pose, mut gear) = (task.start, task.gear);
    for (place, piece) in pieces.iter().flat_map(cut).enumerate() {
        if place % MOVES.len() == 0 {
            *left = left.checked_sub(1).ok_or(Stuck::Budget)?;
        }
        let swept = search.sweep_over(&mut sweep, pose, gear, &[piece]);
        let (end, end_gear, driven, _) = swept.ok_or(Stuck::Nowhere)?;
        let mut next: Vec<Arrival> = Vec::new();
        for (from, last) in arrivals[arrivals.len() - 1].iter().enumerate() {
            let gaps = search.gaps(&sweep, &end, (last.tick, last.safe), false);
            for (depart, safe) in gaps.take(MOST_ARRIVALS) {
                let arrival = Arrival { tick: depart + sweep.len() as u32, safe, depart, from };
                match next.iter_mut().find(|known| known.safe == safe) {
                    Some(known) if arrival.tick < known.tick => *known = arrival,
                    Some(_) => {}
                    None => next.push(arrival),
                }
            }
        }
        if next.is_empty() {
            return Err(Stuck::Nowhere);
        }
        next.truncate(MOST_ARRIVALS);
        arrivals.push(next);
        legs.push(driven);
        (pose, gear) = (end, end_gear);
    }
    let stays = arrivals[arrivals.len() - 1].iter().filter(|last| last.safe == NEVER);
    let mut at = *stays.min_by_key(|last| last.tick).ok_or(Stuck::Nowhere)?;
    let mut all = Vec::with_capacity(legs.len());
    for (legs, before) in legs.iter().zip(&arrivals).rev() {
        all.extend(legs.iter().rev().map(|leg| Leg { depart: leg.depart + at.depart, ..*leg }));
        at = before[at.from];
    }
    all.reverse();
    Ok(all)
}

/// Pieces of one coarse move at most.
fn cut(piece: &Piece) -> impl Iterator<Item = Piece> {
    let most_m = TICK_WAY_M * f64::from(COARSE.moves[0]);
    let parts = libm::ceil(piece.length_m.abs() / most_m - 1e-6).max(1.0);
    std::iter::repeat_n(Piece { length_m: piece.length_m / parts, ..*piece }, parts as usize)
}

#[cfg(test)]
mod tests;
