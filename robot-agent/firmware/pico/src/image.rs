//! Which program is in the flash: its version, and a hash that `cargo xtask uf2` prints too.

use xtb_board_codec::crc32;

/// Major version in the high byte, minor in the low one.
pub(crate) const VERSION: u16 =
    number(env!("CARGO_PKG_VERSION_MAJOR")) << 8 | number(env!("CARGO_PKG_VERSION_MINOR"));

const fn number(text: &str) -> u16 {
    match u16::from_str_radix(text, 10) {
        Ok(number) if number < 256 => number,
        _ => panic!("a version has numbers below 256"),
    }
}

#[expect(unsafe_code, reason = "addresses of the linker script of cortex-m-rt")]
unsafe extern "C" {
    static __vector_table: u32;
    static __sidata: u32;
    static __sdata: u32;
    static __edata: u32;
}

/// CRC-32 from the vector table to the end of the data that is copied to RAM.
pub(crate) fn hash() -> u32 {
    let start = &raw const __vector_table as usize;
    let data = &raw const __edata as usize - &raw const __sdata as usize;
    let len = &raw const __sidata as usize + data - start;
    // SAFETY: the linker put this range, and nothing but it, into flash, which nobody writes.
    #[expect(unsafe_code, reason = "flash as bytes")]
    let program = unsafe { core::slice::from_raw_parts(start as *const u8, len) };
    crc32(program)
}
