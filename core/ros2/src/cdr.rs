//! Classic CDR (XCDR1), as ROS 2 writes it: four bytes that say the byte order, then the fields.
//!
//! Numbers are aligned to their size, counted from after those four bytes. Written is little endian with padding
//! of zeros; read are both orders, any padding, and bytes after the end (genuine serializers pad). A sequence is
//! believed only if its elements can be in the bytes that are left, so a message never takes much more memory than
//! its bytes.

use thiserror::Error;

/// The bytes before the fields: little endian, no options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Bytes that are not the message that was expected. Offsets count from the first byte.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum CdrError {
    /// Not classic CDR: parameter lists, XCDR2, or no CDR at all.
    #[error("begins with {0:02x?}, classic CDR begins with 00 00 or 00 01")]
    Encapsulation(Vec<u8>),
    /// It ends within a value.
    #[error("ends at byte {length}, {needed} more are needed at byte {offset}")]
    Short {
        /// Where the value is.
        offset: usize,
        /// Its bytes.
        needed: usize,
        /// Bytes in all.
        length: usize,
    },
    /// A sequence says that it has more elements than the bytes that are left can hold.
    #[error("a sequence at byte {offset} says {count} elements, {left} bytes are left")]
    Sequence {
        /// Where its count is.
        offset: usize,
        /// What that says.
        count: u32,
        /// Bytes after it.
        left: usize,
    },
    /// A truth value that is neither 0 nor 1.
    #[error("the truth value at byte {offset} is {value}")]
    Bool {
        /// Where.
        offset: usize,
        /// What is there.
        value: u8,
    },
    /// A text that is no UTF-8.
    #[error("the text at byte {offset} is not UTF-8")]
    Text {
        /// Where its first character is.
        offset: usize,
    },
}

/// Something that is written and read as CDR.
pub trait Cdr: Sized {
    /// The fewest bytes that one takes, padding left out; at least 1.
    const MIN_BYTES: usize;

    /// Appends it.
    fn write(&self, to: &mut Writer);

    /// Takes it.
    ///
    /// # Errors
    /// See [`CdrError`].
    fn read(from: &mut Reader<'_>) -> Result<Self, CdrError>;
}

/// A message with its first four bytes.
#[must_use]
pub fn to_bytes<T: Cdr>(message: &T) -> Vec<u8> {
    let mut writer = Writer { bytes: LITTLE_ENDIAN.to_vec() };
    message.write(&mut writer);
    writer.bytes
}

/// The message at the beginning of these bytes; what comes after it is left alone.
///
/// # Errors
/// See [`CdrError`].
pub fn from_bytes<T: Cdr>(bytes: &[u8]) -> Result<T, CdrError> {
    T::read(&mut Reader::new(bytes)?)
}

/// Takes values from bytes.
#[derive(Debug)]
pub struct Reader<'a> {
    bytes: &'a [u8],
    /// Of the next byte; never beyond the end.
    offset: usize,
    big_endian: bool,
}

impl<'a> Reader<'a> {
    /// Behind the first four bytes.
    ///
    /// # Errors
    /// [`CdrError::Encapsulation`].
    pub fn new(bytes: &'a [u8]) -> Result<Self, CdrError> {
        match bytes {
            [0, order @ (0 | 1), _, _, ..] => Ok(Self { bytes, offset: 4, big_endian: *order == 0 }),
            _ => Err(CdrError::Encapsulation(bytes.iter().take(4).copied().collect())),
        }
    }

    fn left(&self) -> usize {
        self.bytes.len() - self.offset
    }

    fn slice(&mut self, needed: usize) -> Result<&'a [u8], CdrError> {
        let rest = self.bytes.get(self.offset..).unwrap_or_default();
        let short = CdrError::Short { offset: self.offset, needed, length: self.bytes.len() };
        let (taken, _) = rest.split_at_checked(needed).ok_or(short)?;
        self.offset += needed;
        Ok(taken)
    }

    /// A number's bytes in little-endian order, after the padding before it.
    fn number<const N: usize>(&mut self) -> Result<[u8; N], CdrError> {
        self.slice(padding(self.offset, N).min(self.left()))?;
        let mut number = [0; N];
        number.copy_from_slice(self.slice(N)?);
        if self.big_endian {
            number.reverse();
        }
        Ok(number)
    }
}

/// Appends values.
#[derive(Debug)]
pub struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    fn number<const N: usize>(&mut self, little_endian: [u8; N]) {
        let padding = padding(self.bytes.len(), N);
        self.bytes.extend(std::iter::repeat_n(0, padding));
        self.bytes.extend_from_slice(&little_endian);
    }

    /// Longer things than 4 GiB are never made.
    fn count(&mut self, count: usize) {
        u32::try_from(count).unwrap_or(u32::MAX).write(self);
    }
}

/// Bytes up to the next multiple of a power of two; the four bytes before the fields change nothing for 1, 2 and 4.
fn padding(offset: usize, align: usize) -> usize {
    offset.wrapping_sub(LITTLE_ENDIAN.len()).wrapping_neg() & (align - 1)
}

macro_rules! numbers {
    ($($type:ty),+) => {
        $(impl Cdr for $type {
            const MIN_BYTES: usize = size_of::<Self>();

            fn write(&self, to: &mut Writer) {
                to.number(self.to_le_bytes());
            }

            fn read(from: &mut Reader<'_>) -> Result<Self, CdrError> {
                from.number().map(Self::from_le_bytes)
            }
        })+
    };
}

numbers!(u8, i8, u16, i16, u32, i32, f32, f64);

impl Cdr for bool {
    const MIN_BYTES: usize = 1;

    fn write(&self, to: &mut Writer) {
        u8::from(*self).write(to);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, CdrError> {
        let offset = from.offset;
        match u8::read(from)? {
            value @ (0 | 1) => Ok(value == 1),
            value => Err(CdrError::Bool { offset, value }),
        }
    }
}

impl Cdr for String {
    /// Some write an empty text without its final NUL.
    const MIN_BYTES: usize = 4;

    fn write(&self, to: &mut Writer) {
        to.count(self.len() + 1);
        to.bytes.extend_from_slice(self.as_bytes());
        to.bytes.push(0);
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, CdrError> {
        let length = u32::read(from)?;
        let offset = from.offset;
        let bytes = from.slice(usize::try_from(length).unwrap_or(usize::MAX))?;
        let text = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        std::str::from_utf8(text).map(str::to_owned).map_err(|_| CdrError::Text { offset })
    }
}

impl<T: Cdr> Cdr for Vec<T> {
    const MIN_BYTES: usize = 4;

    fn write(&self, to: &mut Writer) {
        to.count(self.len());
        self.iter().for_each(|element| element.write(to));
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, CdrError> {
        let count = u32::read(from)?;
        let (offset, left) = (from.offset - 4, from.left());
        let elements = usize::try_from(count).ok().filter(|count| *count <= left / T::MIN_BYTES);
        let elements = elements.ok_or(CdrError::Sequence { offset, count, left })?;
        (0..elements).map(|_| T::read(from)).collect()
    }
}

impl<T: Cdr + Copy + Default, const N: usize> Cdr for [T; N] {
    const MIN_BYTES: usize = N * T::MIN_BYTES;

    fn write(&self, to: &mut Writer) {
        self.iter().for_each(|element| element.write(to));
    }

    fn read(from: &mut Reader<'_>) -> Result<Self, CdrError> {
        let mut elements = [T::default(); N];
        for element in &mut elements {
            *element = T::read(from)?;
        }
        Ok(elements)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_from_behind_the_first_four_bytes() {
        let mut writer = Writer { bytes: LITTLE_ENDIAN.to_vec() };
        1_u8.write(&mut writer);
        2.0_f64.write(&mut writer);
        3_u16.write(&mut writer);
        4_u32.write(&mut writer);
        let expected = "00010000 0100000000000000 0000000000000040 0300 0000 04000000".replace(' ', "");
        assert_eq!(writer.bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>(), expected);
    }

    #[test]
    fn both_byte_orders_are_read() {
        assert_eq!(from_bytes(&[0, 0, 0, 0, 0, 0, 1, 2]), Ok(0x0102_u32));
        assert_eq!(
            from_bytes(&[0, 1, 9, 9, 2, 1, 0, 0, 77]),
            Ok(0x0102_u32),
            "options and the rest are nobody's"
        );
        assert_eq!(from_bytes::<u32>(&[0, 3, 0, 0, 0, 0]), Err(CdrError::Encapsulation(vec![0, 3, 0, 0])));
        assert_eq!(from_bytes::<u32>(&[0]), Err(CdrError::Encapsulation(vec![0])));
    }

    #[test]
    fn what_is_too_short_says_where() {
        let short = |offset, needed, length| CdrError::Short { offset, needed, length };
        assert_eq!(from_bytes::<u32>(&[0, 1, 0, 0, 1, 2]), Err(short(4, 4, 6)));
        assert_eq!(from_bytes::<String>(&[0, 1, 0, 0, 9, 0, 0, 0, b'a']), Err(short(8, 9, 9)));
        let huge = [0, 1, 0, 0, 255, 255, 255, 255, 1];
        let sequence = CdrError::Sequence { offset: 4, count: u32::MAX, left: 1 };
        assert_eq!(from_bytes::<Vec<i8>>(&huge), Err(sequence));
    }

    #[test]
    fn texts_and_truths_are_checked() {
        assert_eq!(from_bytes(&[0, 1, 0, 0, 0, 0, 0, 0]), Ok(String::new()), "an empty text without its NUL");
        assert_eq!(
            from_bytes::<String>(&[0, 1, 0, 0, 2, 0, 0, 0, 255, 0]),
            Err(CdrError::Text { offset: 8 })
        );
        assert_eq!(from_bytes::<bool>(&[0, 1, 0, 0, 2]), Err(CdrError::Bool { offset: 4, value: 2 }));
    }
}
