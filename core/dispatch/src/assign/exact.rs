//! The cheapest assignment: shortest augmenting paths with prices (Jonker and Volgenant 1987).

use super::INFEASIBLE;

/// More than any real cost: a pair that may not be is taken only if there is no other, and left out then.
const FORBIDDEN: f64 = 1e7;

/// The column of each row; `rows` ≤ `columns`. As many pairs as can be, of these the cheapest. Takes
/// rows² × columns steps.
#[must_use]
pub fn solve(cost: &[f32], rows: usize, columns: usize) -> Vec<Option<usize>> {
    let at = |row: usize, column: usize| {
        let cost = cost[row * columns + column];
        if cost == INFEASIBLE { FORBIDDEN } else { f64::from(cost) }
    };
    let (mut row_price, mut column_price) = (vec![0.0; rows], vec![0.0; columns]);
    let mut row_of: Vec<Option<usize>> = vec![None; columns];
    for start in 0..rows {
        let mut distance = vec![f64::INFINITY; columns];
        let mut before: Vec<Option<usize>> = vec![None; columns];
        let mut done = vec![false; columns];
        let (mut row, mut last, mut reached) = (start, None, 0.0);
        let end = loop {
            let mut nearest = None;
            for column in (0..columns).filter(|&column| !done[column]) {
                let way = reached + at(row, column) - row_price[row] - column_price[column];
                if way < distance[column] {
                    (distance[column], before[column]) = (way, last);
                }
                if nearest.is_none_or(|best: usize| distance[column] < distance[best]) {
                    nearest = Some(column);
                }
            }
            let Some(column) = nearest else { break None };
            done[column] = true;
            (last, reached) = (Some(column), distance[column]);
            match row_of[column] {
                None => break Some(column),
                Some(next) => row = next,
            }
        };
        let Some(mut column) = end else { continue };
        row_price[start] += reached;
        for other in (0..columns).filter(|&other| done[other]) {
            let slack = reached - distance[other];
            column_price[other] -= slack;
            if let Some(row) = row_of[other] {
                row_price[row] += slack;
            }
        }
        while let Some(previous) = before[column] {
            row_of[column] = row_of[previous];
            column = previous;
        }
        row_of[column] = Some(start);
    }
    let mut found = vec![None; rows];
    for (column, row) in row_of.iter().enumerate() {
        if let Some(row) = *row
            && cost[row * columns + column] != INFEASIBLE
        {
            found[row] = Some(column);
        }
    }
    found
}
