//! PBM, PGM and PPM, plain and binary, after netpbm's own pages (`man 5 pgm`).

use super::{Picture, check_size, refused};
use crate::map::ros::RosError;

/// Reads an image whose first two bytes are `P1` to `P6`.
pub(super) fn read(bytes: &[u8]) -> Result<Picture, RosError> {
    let kind = bytes[1];
    let mut header = Text(&bytes[2..]);
    let (width, height) = (header.number("width")?, header.number("height")?);
    let (width, height) = check_size(width, height)?;
    let is_bitmap = matches!(kind, b'1' | b'4');
    let full = match is_bitmap {
        true => 1,
        false => match u16::try_from(header.number("maximum")?) {
            Ok(full @ 1..) => full,
            _ => return Err(refused("its maximum must be 1 to 65535")),
        },
    };
    let channels = if matches!(kind, b'3' | b'6') { 3 } else { 1 };
    let count = width * height * channels;
    let mut samples = if kind <= b'3' {
        plain(header, count, is_bitmap)?
    } else {
        // One white-space character ends the header.
        let data = header.0.get(1..).unwrap_or_default();
        let binary = match (is_bitmap, full > 255) {
            (true, _) => {
                data.chunks_exact(width.div_ceil(8)).flat_map(|row| bits(row, width)).take(count).collect()
            }
            (_, true) => {
                data.chunks_exact(2).map(|two| u16::from_be_bytes([two[0], two[1]])).take(count).collect()
            }
            _ => data.iter().map(|&byte| u16::from(byte)).take(count).collect::<Vec<_>>(),
        };
        if binary.len() < count {
            return Err(refused(format!("it ends after {} of {count} samples", binary.len())));
        }
        binary
    };
    if is_bitmap {
        samples.iter_mut().for_each(|sample| *sample = 1 - *sample); // 1 is black
    }
    match samples.iter().find(|&&sample| sample > full) {
        Some(sample) => Err(refused(format!("a sample of {sample} is above its maximum of {full}"))),
        None => Ok(Picture { width, height, channels, full, samples }),
    }
}

fn bits(row: &[u8], width: usize) -> impl Iterator<Item = u16> {
    (0..width).map(|i| u16::from(row[i / 8] >> (7 - i % 8) & 1))
}

/// Samples as text; those of a bitmap are single digits that need no space between them.
fn plain(mut text: Text<'_>, count: usize, is_bitmap: bool) -> Result<Vec<u16>, RosError> {
    let mut samples = Vec::new();
    while samples.len() < count {
        let sample = match is_bitmap {
            true => text.digit(),
            false => text.number("sample").ok().and_then(|number| u16::try_from(number).ok()),
        };
        let Some(sample) = sample else {
            return Err(refused(format!("sample {} of {count} is not a number", samples.len() + 1)));
        };
        samples.push(sample);
    }
    Ok(samples)
}

/// What is still to be read.
struct Text<'a>(&'a [u8]);

impl Text<'_> {
    /// Skips white space, and comments from # to the line's end.
    fn skip(&mut self) {
        let mut in_comment = false;
        let next = self.0.iter().position(|&byte| {
            in_comment = if in_comment { !matches!(byte, b'\n' | b'\r') } else { byte == b'#' };
            !in_comment && !byte.is_ascii_whitespace()
        });
        self.0 = &self.0[next.unwrap_or(self.0.len())..];
    }

    fn number(&mut self, what: &str) -> Result<u32, RosError> {
        self.skip();
        let digits = self.0.iter().take_while(|byte| byte.is_ascii_digit()).count();
        let (number, rest) = self.0.split_at(digits);
        self.0 = rest;
        let number = std::str::from_utf8(number).ok().and_then(|text| text.parse().ok());
        number.ok_or_else(|| refused(format!("it has no {what}")))
    }

    fn digit(&mut self) -> Option<u16> {
        self.skip();
        let (&digit, rest) = self.0.split_first()?;
        self.0 = rest;
        matches!(digit, b'0' | b'1').then(|| u16::from(digit - b'0'))
    }
}
