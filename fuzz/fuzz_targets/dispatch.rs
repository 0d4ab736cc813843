//! Questions to the dispatcher.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::dispatch(bytes);
});
