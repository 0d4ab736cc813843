//! UF2: the file that is dragged onto a Pico in its boot mode (https://github.com/microsoft/uf2).

use crate::elf::FLASH;

const MAGIC: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const MAGIC_END: u32 = 0x0AB1_6F30;
const FAMILY_PRESENT: u32 = 0x2000;
const RP2040: u32 = 0xE48B_FF56;
/// A page of the flash.
const PAYLOAD: usize = 256;
const ROOM: usize = 476;
/// What fills the last page: erased flash.
const ERASED: u8 = 0xFF;

/// Blocks of 512 bytes for an image that begins where flash does.
pub(crate) fn blocks(image: &[u8]) -> Vec<u8> {
    let pages = image.chunks(PAYLOAD);
    let count = pages.len() as u32;
    let mut file = Vec::with_capacity(pages.len() * 512);
    for (number, page) in (0..).zip(pages) {
        let address = FLASH + number * PAYLOAD as u32;
        let header = [MAGIC[0], MAGIC[1], FAMILY_PRESENT, address, PAYLOAD as u32, number, count, RP2040];
        file.extend(header.iter().flat_map(|word| word.to_le_bytes()));
        let mut payload = [ERASED; PAYLOAD];
        payload[..page.len()].copy_from_slice(page);
        file.extend(payload);
        file.extend([0; ROOM - PAYLOAD]);
        file.extend(MAGIC_END.to_le_bytes());
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_comes_out_again() {
        let image: Vec<u8> = (0..700_u32).map(|i| (i * 7) as u8).collect();
        let file = blocks(&image);
        assert_eq!(file.len(), 3 * 512);
        let word = |block: usize, i: usize| {
            let bytes = &file[block * 512 + 4 * i..][..4];
            u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
        };
        let mut flash: Vec<u8> = Vec::new();
        for block in 0..3 {
            assert_eq!([word(block, 0), word(block, 1), word(block, 127)], [MAGIC[0], MAGIC[1], MAGIC_END]);
            assert_eq!(word(block, 3), FLASH + 256 * block as u32);
            assert_eq!(
                [word(block, 4), word(block, 5), word(block, 6), word(block, 7)],
                [256, block as u32, 3, RP2040]
            );
            flash.extend(&file[block * 512 + 32..][..256]);
        }
        assert_eq!(flash[..700], image);
        assert!(flash[700..].iter().all(|byte| *byte == ERASED));
    }
}
