//! What traffic control says of itself.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::traffic(bytes);
});
