//! States of robots.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::robot_state(bytes);
});
