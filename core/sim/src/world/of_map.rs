//! A world that is made of a map: what is occupied there stands in it as boxes.

use super::layout::{BoxSpec, Contents, NamedBox};
use super::{World, WorldError};
use crate::geometry::{Bounds, OrientedBox};
use xtb_nav::{Cell, Grid, Map};

/// More boxes than this are too many to look for at each step.
const MOST_MAP_BOXES: usize = 20_000;

impl World {
    /// The world of this map: its occupied cells, joined to boxes row by row, its zones and its places. Robots start
    /// on free cells only. Its [map](World::to_map) is the map itself.
    ///
    /// # Errors
    /// [`WorldError::TooManyBoxes`], or a map that is farther out than a world can be.
    pub fn of_map(map: &Map) -> Result<Self, WorldError> {
        let blocks = blocks(map.grid());
        if blocks.len() > MOST_MAP_BOXES {
            return Err(WorldError::TooManyBoxes { boxes: blocks.len(), most: MOST_MAP_BOXES });
        }
        let world = Self(Contents {
            name: Some(map.name().to_owned()),
            boxes: blocks.iter().map(|block| NamedBox::nameless(block.spec(map.grid()))).collect(),
            zones: map.zones().to_vec(),
            places: map.places().to_vec(),
            map: Some(map.clone()),
            ..Contents::default()
        });
        world.check_values()?;
        Ok(world)
    }

    /// The map that this world is made of, if it is.
    pub(crate) fn map(&self) -> Option<&Map> {
        self.0.map.as_ref()
    }

    /// All of the map that this world is made of.
    pub(crate) fn map_bounds(&self) -> Option<Bounds> {
        let grid = self.map()?.grid();
        let whole = Block { west: 0, east: grid.width(), south: 0, north: grid.height() };
        Some(whole.spec(grid).shape().bounds())
    }

    /// Whether its map, if it is made of one, is free everywhere under this shape.
    pub(crate) fn is_known_free(&self, shape: &OrientedBox) -> bool {
        let Some(grid) = self.map().map(Map::grid) else { return true };
        let bounds = shape.bounds();
        let (west, south) = grid.place(bounds.min_x_m, bounds.min_y_m);
        let (east, north) = grid.place(bounds.max_x_m, bounds.max_y_m);
        let mut cells = (south..=north).flat_map(|row| (west..=east).map(move |column| (column, row)));
        let cell_m = grid.resolution_m();
        cells.all(|(column, row)| {
            let [x_m, y_m] = grid.centre_m(column, row);
            let cell = || OrientedBox::new(x_m, y_m, 0.0, cell_m, cell_m);
            grid.cell(column, row) == Cell::Free || shape.separation_m(&cell()) > 0.0
        })
    }
}

/// Occupied cells: columns `west..east` of the rows `south..north`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Block {
    west: usize,
    east: usize,
    south: usize,
    north: usize,
}

impl Block {
    fn spec(&self, grid: &Grid) -> BoxSpec {
        let (cell_m, [x_m, y_m]) = (grid.resolution_m(), grid.origin_m());
        let middle = |from: usize, to: usize| (from + to) as f64 / 2.0 * cell_m;
        BoxSpec {
            x_m: x_m + middle(self.west, self.east),
            y_m: y_m + middle(self.south, self.north),
            width_m: (self.east - self.west) as f64 * cell_m,
            depth_m: (self.north - self.south) as f64 * cell_m,
            yaw_rad: 0.0,
        }
    }
}

/// Every occupied cell in one block: the runs of each row, joined to those of the row before that are as long.
fn blocks(grid: &Grid) -> Vec<Block> {
    let (mut done, mut open) = (Vec::new(), Vec::<Block>::new());
    for (row, cells) in grid.cells().chunks(grid.width()).enumerate() {
        let runs: Vec<Block> = runs(cells)
            .map(|(west, east)| {
                let before = open.iter().find(|block| (block.west, block.east) == (west, east));
                Block { west, east, south: before.map_or(row, |block| block.south), north: row + 1 }
            })
            .collect();
        let goes_on = |block: &Block| runs.iter().any(|run| run.west == block.west && run.east == block.east);
        done.extend(open.into_iter().filter(|block| !goes_on(block)));
        open = runs;
    }
    done.extend(open);
    done
}

/// First and end of each run of occupied cells.
fn runs(cells: &[Cell]) -> impl Iterator<Item = (usize, usize)> {
    let mut at = 0;
    std::iter::from_fn(move || {
        let first = at + cells[at..].iter().position(|cell| *cell == Cell::Occupied)?;
        let length = cells[first..].iter().position(|cell| *cell != Cell::Occupied);
        at = length.map_or(cells.len(), |length| first + length);
        Some((first, at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Body;

    /// Rows from north to south; `#` occupied, `?` unknown.
    fn map(rows: &[&str], cell_m: f64) -> Map {
        let cells = rows.iter().rev().flat_map(|row| row.chars()).map(|sign| match sign {
            '#' => Cell::Occupied,
            '?' => Cell::Unknown,
            _ => Cell::Free,
        });
        let grid = Grid::new(cell_m, [-1.0, 2.0], rows[0].len(), rows.len(), cells.collect()).unwrap();
        Map::new("hall", grid, Vec::new()).unwrap()
    }

    #[test]
    fn every_occupied_cell_is_in_one_block_and_none_else() {
        let map = map(&["######", "#..#.#", "#..#.#", "##.#.#", "######"], 0.5);
        let blocks = blocks(map.grid());
        assert_eq!(blocks.len(), 6, "{blocks:?}");
        for row in 0..5 {
            for column in 0..6 {
                let holds =
                    |b: &&Block| (b.west..b.east).contains(&column) && (b.south..b.north).contains(&row);
                let occupied = map.grid().cell(column as i64, row as i64) == Cell::Occupied;
                assert_eq!(blocks.iter().filter(holds).count(), usize::from(occupied), "{column}, {row}");
            }
        }
        let world = World::of_map(&map).unwrap();
        let (_, south) = world.boxes().find(|(_, b)| b.y_m < 2.5).unwrap();
        assert_eq!((south.x_m, south.y_m, south.width_m, south.depth_m), (0.5, 2.25, 3.0, 0.5));
        assert_eq!((world.to_map(0.05).unwrap(), world.name()), (map, Some("hall")));
    }

    #[test]
    fn robots_start_on_free_floor_only() {
        let (wall, free) = ("#".repeat(40), format!("#{}#", ".".repeat(38)));
        let (halved, mut rows) = (format!("#{}{}#", "?".repeat(19), ".".repeat(19)), vec![wall.as_str()]);
        rows.extend([halved.as_str(); 20]);
        rows.push(&wall);
        let world = World::of_map(&map(&rows, 0.5)).unwrap();
        let body = Body::default();
        let poses = world.start_poses(2, &body).unwrap();
        assert!(poses.iter().all(|pose| pose.x_m > 9.0 && pose.x_m < 18.5), "{poses:?}");
        rows[1..21].fill(free.as_str());
        let open = World::of_map(&map(&rows, 0.5)).unwrap().start_poses(3, &body).unwrap();
        assert!(open.iter().any(|pose| pose.x_m < 9.0), "{open:?}");
    }

    #[test]
    fn a_corridor_has_room_along_it() {
        let (wall, free) = ("#".repeat(30), format!("#{}#", ".".repeat(28)));
        let mut rows = vec![wall.as_str()];
        rows.extend([free.as_str(); 3]);
        rows.push(&wall);
        let poses = World::of_map(&map(&rows, 0.5)).unwrap().start_poses(2, &Body::default()).unwrap();
        assert!(poses.iter().all(|pose| pose.yaw_rad.sin().abs() < 1e-9), "{poses:?}");
    }

    #[test]
    fn a_map_of_noise_is_refused_with_the_number_of_its_boxes() {
        let side = 210;
        let chequered = (0..side * side).map(|i| match (i / side + i % side) % 2 {
            0 => Cell::Occupied,
            _ => Cell::Free,
        });
        let grid = Grid::new(0.05, [0.0, 0.0], side, side, chequered.collect()).unwrap();
        let error = World::of_map(&Map::new("noise", grid, Vec::new()).unwrap()).unwrap_err();
        assert_eq!(error, WorldError::TooManyBoxes { boxes: side * side / 2, most: MOST_MAP_BOXES });
    }
}
