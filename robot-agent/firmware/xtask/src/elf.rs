//! Just enough of ELF32 for a linker's file of a microcontroller: what goes into flash, and a symbol's address.

use xtb_board_codec::crc32;

/// Where flash begins.
pub(crate) const FLASH: u32 = 0x1000_0000;
const FLASH_END: u32 = 0x1100_0000;
/// Flash that nobody has written.
const ERASED: u8 = 0xFF;
const PT_LOAD: u32 = 1;
const SHT_SYMTAB: u32 = 2;

/// A program as it lies in flash.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Program {
    /// From the beginning of flash.
    pub(crate) image: Vec<u8>,
    /// What the firmware tells of itself: CRC-32 from the vector table to the end of the data.
    pub(crate) hash: u32,
}

struct File<'a>(&'a [u8]);

impl File<'_> {
    fn u16(&self, at: u32) -> Option<u32> {
        let bytes = self.0.get(at as usize..at as usize + 2)?;
        Some(u32::from(u16::from_le_bytes([bytes[0], bytes[1]])))
    }

    fn u32(&self, at: u32) -> Option<u32> {
        Some(self.u16(at)? | self.u16(at + 2)? << 16)
    }

    fn symbol(&self, wanted: &str) -> Option<u32> {
        let (sections, size, count) = (self.u32(32)?, self.u16(46)?, self.u16(48)?);
        let table =
            (0..count).map(|i| sections + i * size).find(|at| self.u32(at + 4) == Some(SHT_SYMTAB))?;
        let (begin, length) = (self.u32(table + 16)?, self.u32(table + 20)?);
        let strings = self.u32(sections + self.u32(table + 24)? * size + 16)?;
        (begin..begin + length).step_by(16).find_map(|at| {
            let name = self.0.get((strings + self.u32(at)?) as usize..)?;
            let is_it = name.starts_with(wanted.as_bytes()) && name.get(wanted.len()) == Some(&0);
            is_it.then(|| self.u32(at + 4)).flatten()
        })
    }
}

impl Program {
    /// `None` if this is not such a file.
    pub(crate) fn read(bytes: &[u8]) -> Option<Self> {
        let file = File(bytes);
        if !bytes.starts_with(b"\x7FELF\x01\x01") {
            return None;
        }
        let mut image = Vec::new();
        for i in 0..file.u16(44)? {
            let header = file.u32(28)? + i * file.u16(42)?;
            let (offset, address, size) =
                (file.u32(header + 4)?, file.u32(header + 12)?, file.u32(header + 16)?);
            if file.u32(header)? != PT_LOAD || size == 0 || !(FLASH..FLASH_END).contains(&address) {
                continue;
            }
            let place = (address - FLASH) as usize;
            if image.len() < place + size as usize {
                image.resize(place + size as usize, ERASED);
            }
            let segment = bytes.get(offset as usize..(offset + size) as usize)?;
            image[place..place + segment.len()].copy_from_slice(segment);
        }
        let start = file.symbol("__vector_table")? - FLASH;
        let data = file.symbol("__edata")? - file.symbol("__sdata")?;
        let end = file.symbol("__sidata")? - FLASH + data;
        let hash = crc32(image.get(start as usize..end as usize)?);
        Some(Self { image, hash })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_such_file_is_refused() {
        assert_eq!(Program::read(b""), None);
        assert_eq!(Program::read(b"\x7FELF\x02\x01 a 64-bit one"), None);
        assert_eq!(Program::read(b"\x7FELF\x01\x01 cut off"), None);
    }
}
