//! A nearly cheapest assignment for many: an auction (Bertsekas 1988).
//!
//! Rows bid for columns. Each bid raises the column's price to where the next best would do as well,
//! and by `RAISE_M` more; the row that had the column bids again. Nobody bids more than `LIMIT_M`:
//! who cannot have a column for that goes without. The sum is at most rows × `RAISE_M` above the best.
//!
//! It ends for any costs: a bid that is lost in the last digit of a cost is none, and there are only so many
//! bids (`MOST_BIDS`). Whoever has no column then takes the cheapest that is left: still one for each row, and
//! one row for each, but perhaps not nearly the cheapest.

use super::INFEASIBLE;

/// Smallest raise, in m.
pub const RAISE_M: f32 = 0.25;
/// Beyond the dearest of its columns, a row pays this much more before it goes without, in m.
const LIMIT_M: f32 = 50.0;
/// Bids for each row and column, at most: four times as many as a copy of this took for up to 240 robots and 480
/// tasks at random in a hall of 100 m (55). It bounds the time that costs which no room has can take.
const MOST_BIDS: usize = 200;

/// The column of each row; `rows` ≤ `columns`.
#[must_use]
pub fn solve(cost: &[f32], rows: usize, columns: usize) -> Vec<Option<usize>> {
    let mut price = vec![0.0_f32; columns];
    let mut row_of: Vec<Option<usize>> = vec![None; columns];
    let mut column_of: Vec<Option<usize>> = vec![None; rows];
    let mut bidders: Vec<usize> = (0..rows).rev().collect();
    let dearest: Vec<f32> = (0..rows).map(|row| dearest(&cost[row * columns..][..columns])).collect();
    for _ in 0..MOST_BIDS.saturating_mul(rows + columns) {
        let Some(row) = bidders.pop() else { break };
        let costs = &cost[row * columns..][..columns];
        let (best, total, second) = two_best(costs, &price);
        let limit = dearest[row] + LIMIT_M;
        if total > limit {
            continue;
        }
        let raised = price[best] + (second.min(limit) - total + RAISE_M);
        // Where the costs are so large that 32 bits hold no raise, two rows would displace each other for ever.
        if costs[best] + raised <= total {
            continue;
        }
        price[best] = raised;
        column_of[row] = Some(best);
        if let Some(loser) = row_of[best].replace(row) {
            column_of[loser] = None;
            bidders.push(loser);
        }
    }
    fill(cost, columns, &mut row_of, &mut column_of);
    column_of
}

fn dearest(costs: &[f32]) -> f32 {
    costs.iter().copied().filter(|cost| *cost != INFEASIBLE).fold(0.0, f32::max)
}

/// The cheapest column with its price, what it comes to, and what the next one would.
fn two_best(costs: &[f32], price: &[f32]) -> (usize, f32, f32) {
    let (mut best, mut total, mut second) = (0, INFEASIBLE, INFEASIBLE);
    for (column, (cost, price)) in costs.iter().zip(price).enumerate() {
        let sum = cost + price;
        if sum < second {
            if sum < total {
                (best, second, total) = (column, total, sum);
            } else {
                second = sum;
            }
        }
    }
    (best, total, second)
}

/// Who went without takes what is left, if anything is: a robot never idles for a price.
fn fill(cost: &[f32], columns: usize, row_of: &mut [Option<usize>], column_of: &mut [Option<usize>]) {
    for row in 0..column_of.len() {
        if column_of[row].is_some() {
            continue;
        }
        let costs = &cost[row * columns..][..columns];
        let left = (0..columns).filter(|&column| row_of[column].is_none() && costs[column] != INFEASIBLE);
        if let Some(column) = left.min_by(|&a, &b| costs[a].total_cmp(&costs[b])) {
            (row_of[column], column_of[row]) = (Some(row), Some(column));
        }
    }
}
