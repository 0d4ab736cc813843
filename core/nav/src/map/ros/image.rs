//! Images of maps: from PNG, PGM and its relatives to cells, and from cells to PGM.

use super::{FREE, OCCUPIED, RosError, Thresholds, UNKNOWN};
use crate::{Cell, Grid};
use image::codecs::pnm::{PnmDecoder, PnmEncoder, PnmSubtype, SampleEncoding};
use image::{ExtendedColorType, ImageDecoder, ImageEncoder, ImageFormat};

/// Where a PNG has its width and its height, each in 4 bytes.
const PNG_SIZE: std::ops::Range<usize> = 16..24;

fn refused(reason: impl std::fmt::Display) -> RosError {
    RosError::Image(reason.to_string().chars().take(200).collect())
}

/// Width, height and cells, rows from south to north.
pub(super) fn cells(bytes: &[u8], thresholds: Thresholds) -> Result<(usize, usize, Vec<Cell>), RosError> {
    let format = match image::guess_format(bytes) {
        Ok(format @ (ImageFormat::Png | ImageFormat::Pnm)) => format,
        _ => return Err(refused("neither PNG nor PGM")),
    };
    // Before any of it is unpacked.
    let (width, height) = size(bytes, format)?;
    let most = Grid::MOST_CELLS;
    if (width as usize).checked_mul(height as usize).is_none_or(|count| count > most) {
        return Err(refused(format!("{width} × {height} pixels, at most {most} are read")));
    }
    let image = image::load_from_memory_with_format(bytes, format).map_err(refused)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let color = image.color();
    let channels = usize::from(color.channel_count());
    let deep = color.bytes_per_pixel() / color.channel_count() == 2;
    let bytes = image.as_bytes();
    let value = |i: usize| match deep {
        true => f64::from(u16::from_ne_bytes([bytes[2 * i], bytes[2 * i + 1]])),
        false => f64::from(bytes[i]),
    };
    let full = if deep { f64::from(u16::MAX) } else { f64::from(u8::MAX) };
    let cell = |pixel: usize| {
        let sum: f64 = (pixel * channels..(pixel + 1) * channels).map(value).sum();
        thresholds.cell(sum / channels as f64 / full)
    };
    let rows = (0..height).rev();
    let cells = rows.flat_map(|row| (row * width..(row + 1) * width).map(cell)).collect();
    Ok((width, height, cells))
}

fn size(bytes: &[u8], format: ImageFormat) -> Result<(u32, u32), RosError> {
    if format == ImageFormat::Pnm {
        return Ok(PnmDecoder::new(bytes).map_err(refused)?.dimensions());
    }
    match bytes.get(PNG_SIZE) {
        Some(&[a, b, c, d, e, f, g, h]) => {
            Ok((u32::from_be_bytes([a, b, c, d]), u32::from_be_bytes([e, f, g, h])))
        }
        _ => Err(refused("a PNG without a size")),
    }
}

/// A binary PGM of a grid.
pub(super) fn pgm(grid: &Grid) -> Result<Vec<u8>, RosError> {
    let shade = |cell: &Cell| match cell {
        Cell::Free => FREE,
        Cell::Occupied => OCCUPIED,
        Cell::Unknown => UNKNOWN,
    };
    let pixels: Vec<u8> = grid.cells().chunks(grid.width()).rev().flatten().map(shade).collect();
    let side = |count: usize| u32::try_from(count).map_err(refused);
    let mut bytes = Vec::new();
    PnmEncoder::new(&mut bytes)
        .with_subtype(PnmSubtype::Graymap(SampleEncoding::Binary))
        .write_image(&pixels, side(grid.width())?, side(grid.height())?, ExtendedColorType::L8)
        .map_err(refused)?;
    Ok(bytes)
}
