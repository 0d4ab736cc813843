//! Maps from the network.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::fleet_map(bytes);
});
