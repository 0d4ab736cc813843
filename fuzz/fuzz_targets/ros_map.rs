//! Maps in the files of ROS's map_server.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = fleet_tests::fuzz::ros_map(bytes);
});
