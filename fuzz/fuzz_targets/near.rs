//! What robots tell those near them.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::near(bytes);
});
