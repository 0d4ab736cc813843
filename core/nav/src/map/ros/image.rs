//! Images of maps: from PNG, PGM and its relatives to cells, and from cells to PGM.

mod pnm;

use super::{FREE, OCCUPIED, RosError, Thresholds, UNKNOWN};
use crate::geometry::{Cell, Grid};
use std::io::Cursor;

/// Where a PNG has its width and its height, each in 4 bytes (PNG specification, IHDR).
const PNG_SIZE: std::ops::Range<usize> = 16..24;
/// Bytes that decoding a PNG may take: four channels of 16 bits for each cell.
const MOST_PNG_BYTES: usize = 8 * Grid::MOST_CELLS;

fn refused(reason: impl std::fmt::Display) -> RosError {
    RosError::Image(reason.to_string().chars().take(200).collect())
}

/// Pixels, rows from north to south.
struct Picture {
    width: usize,
    height: usize,
    channels: usize,
    /// The value of white.
    full: u16,
    samples: Vec<u16>,
}

impl Picture {
    fn read(bytes: &[u8]) -> Result<Self, RosError> {
        match bytes {
            [0x89, b'P', b'N', b'G', ..] => png(bytes),
            [b'P', b'1'..=b'6', ..] => pnm::read(bytes),
            _ => Err(refused("neither PNG nor PGM")),
        }
    }

    /// How bright each pixel is, 0 to 1, rows from south to north.
    fn shades(&self) -> impl Iterator<Item = f64> {
        let rows = self.samples.chunks_exact(self.width * self.channels).rev();
        rows.flat_map(|row| row.chunks_exact(self.channels)).map(|pixel| {
            let sum: f64 = pixel.iter().map(|&sample| f64::from(sample)).sum();
            sum / self.channels as f64 / f64::from(self.full)
        })
    }
}

/// Width, height and cells, rows from south to north.
pub(super) fn cells(bytes: &[u8], thresholds: Thresholds) -> Result<(usize, usize, Vec<Cell>), RosError> {
    let picture = Picture::read(bytes)?;
    let cells = picture.shades().map(|shade| thresholds.cell(shade)).collect();
    Ok((picture.width, picture.height, cells))
}

/// How many pixels are as bright as this one of 8 bits.
pub(super) fn count(bytes: &[u8], of: u8) -> Result<usize, RosError> {
    let of = f64::from(of) / 255.0;
    Ok(Picture::read(bytes)?.shades().filter(|shade| (shade - of).abs() < 0.5 / 255.0).count())
}

/// Before any of it is unpacked.
fn check_size(width: u32, height: u32) -> Result<(usize, usize), RosError> {
    let (wide, high, most) = (width as usize, height as usize, Grid::MOST_CELLS);
    match wide.checked_mul(high) {
        Some(0) => Err(refused("it has no pixels")),
        Some(pixels) if pixels <= most => Ok((wide, high)),
        _ => Err(refused(format!("{width} × {height} pixels, the limit is {most}"))),
    }
}

fn png(bytes: &[u8]) -> Result<Picture, RosError> {
    let Some(&[a, b, c, d, e, f, g, h]) = bytes.get(PNG_SIZE) else {
        return Err(refused("a PNG without a size"));
    };
    let (width, height) = check_size(u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h]))?;
    let limits = png::Limits { bytes: MOST_PNG_BYTES };
    let mut decoder = png::Decoder::new_with_limits(Cursor::new(bytes), limits);
    // Palettes become colours, few bits become eight.
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(refused)?;
    let length = reader.output_buffer_size().ok_or_else(|| refused("a PNG without a size"))?;
    let mut raw = vec![0; length];
    let frame = reader.next_frame(&mut raw).map_err(refused)?;
    raw.truncate(frame.buffer_size());
    let (full, samples) = match frame.bit_depth {
        png::BitDepth::Sixteen => {
            (u16::MAX, raw.chunks_exact(2).map(|two| u16::from_be_bytes([two[0], two[1]])).collect())
        }
        _ => (u16::from(u8::MAX), raw.into_iter().map(u16::from).collect()),
    };
    Ok(Picture { width, height, channels: frame.color_type.samples(), full, samples })
}

/// A binary PGM of a grid.
pub(super) fn pgm(grid: &Grid) -> Vec<u8> {
    let shade = |cell: &Cell| match cell {
        Cell::Free => FREE,
        Cell::Occupied => OCCUPIED,
        Cell::Unknown => UNKNOWN,
    };
    let mut bytes = format!("P5\n{} {} 255\n", grid.width(), grid.cells().len() / grid.width()).into_bytes();
    bytes.extend(grid.cells().chunks(grid.width()).rev().flatten().map(shade));
    bytes
}
