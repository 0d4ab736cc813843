//! The numbers of `xtb-board-codec`, which the firmware uses, are those of the typed frames.

use xtb_board_codec as codec;
use xtb_control::tpu::{PINS, SYSTEM_CLOCK_HZ, TpuSetup};
use xtb_control::{AdcCount, PwmCount, VehicleConfig};
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::board::{
    Ask, BoardError, BoardIdentity, BoardStatus, Firmware, FrameReader, FrameWriter, FromBoard, ToBoard,
};

#[test]
fn a_set_up_is_the_same_bytes_and_the_same_check_sum() {
    let typed = TpuSetup::of(&VehicleConfig::default()).unwrap();
    let plain = codec::Setup::from_payload(&typed.to_bytes()).unwrap();
    assert_eq!(plain.to_bytes(), typed.to_bytes());
    assert_eq!(plain.checksum(), typed.checksum());
    assert_eq!((codec::PINS, f64::from(codec::CLOCK_HZ)), (PINS, SYSTEM_CLOCK_HZ));
}

#[test]
fn ranges_are_those_of_the_quantities() {
    let (least, most) = (*codec::PULSES.start(), *codec::PULSES.end());
    assert_eq!((least, most), (PwmCount::MIN.get(), PwmCount::MAX.get()));
    assert_eq!(codec::NEUTRAL, PwmCount::NEUTRAL.get());
    assert!(
        AdcCount::try_from(codec::MAX_RANGE).is_ok() && AdcCount::try_from(codec::MAX_RANGE + 1).is_err()
    );
}

/// A status of the board with these bits, read back.
fn status(firmware: u16, bits: u16) -> BoardStatus {
    let frame = codec::Writer::default().frame(codec::kind::STATUS, [firmware, bits, 0x0156, 2]);
    let mut found = Vec::new();
    FrameReader::default().from_board(frame.as_bytes(), |frame| found.push(frame.unwrap()));
    let [FromBoard::Status(status)] = found[..] else { panic!("{found:?}") };
    let again = FrameWriter::default().status(&status);
    assert_eq!(again.as_bytes(), frame.as_bytes(), "and written as it was read");
    status
}

#[test]
fn an_emergency_stop_is_unknown_of_a_firmware_that_does_not_know_it_unless_it_says_pressed() {
    use codec::flags::{EMERGENCY_STOP, READY, WATCHDOG};
    for (firmware, bits, pressed) in [
        (0, READY, None),
        (0x0100, READY | WATCHDOG, None),
        (0x0100, READY | EMERGENCY_STOP, Some(true)),
        (0x0101, READY, Some(false)),
        (0x0101, READY | WATCHDOG | EMERGENCY_STOP, Some(true)),
        (0x0200, READY, None),
    ] {
        let status = status(firmware, bits);
        assert_eq!(status.emergency_stop, pressed, "{}", status.firmware);
        assert_eq!((status.ready, status.watchdog), (true, bits & WATCHDOG != 0));
    }
}

/// What is new in a later status of version 1 does not disturb an agent that does not know it.
#[test]
fn bits_that_the_agent_does_not_know_are_ignored() {
    let frame = codec::Writer::default().frame(codec::kind::STATUS, [0x0101, 0x8001, 0x0156, 2]);
    let mut found = Vec::new();
    FrameReader::default().from_board(frame.as_bytes(), |frame| found.push(frame.unwrap()));
    assert_eq!(found, [FromBoard::Status(status(0x0101, codec::flags::READY))]);
}

#[test]
fn identity_sample_and_ask_read_back_as_they_were_written() {
    let identity = BoardIdentity {
        firmware: Firmware(0x0101),
        hash: 0x89AB_CDEF,
        model: 2,
        after_hang: true,
        late_periods: 3,
        replaced_samples: 4,
    };
    let sample = Bno085Sample { index: 7, bad: 1, yaw_cdeg: -18_000, ..Bno085Sample::default() };
    let mut writer = FrameWriter::default();
    let mut bytes = writer.identity(&identity).as_bytes().to_vec();
    bytes.extend(writer.bno085(&sample).as_bytes());
    let mut found = Vec::new();
    FrameReader::default().from_board(&bytes, |frame| found.push(frame));
    assert_eq!(found, [Ok(FromBoard::Identity(identity)), Ok(FromBoard::Bno085(sample))]);
    for bits in 1..8 {
        let [identity, imu, wide_scan] = [1, 2, 4].map(|bit| bits & bit != 0);
        let (ask, mut found) = (Ask { identity, imu, wide_scan }, Vec::new());
        FrameReader::default().to_board(writer.ask(ask).as_bytes(), |frame| found.push(frame));
        assert_eq!(found, [Ok(ToBoard::Ask(ask))]);
    }
}

#[test]
fn a_sample_with_an_impossible_angle_is_dropped_and_the_next_frame_is_read() {
    let mut writer = codec::Writer::default();
    let mut bytes = writer.frame(codec::kind::IMU, [0, 18_001, 0, 0, 0, 0, 0]).as_bytes().to_vec();
    bytes.extend(writer.frame(codec::kind::ENCODER, [23]).as_bytes());
    let (mut reader, mut found) = (FrameReader::default(), Vec::new());
    reader.from_board(&bytes, |frame| found.push(frame));
    assert!(matches!(found[0], Err(BoardError::Value(_))), "{found:?}");
    assert_eq!(found[1..], [Ok(FromBoard::Encoder { pulses: 23 })]);
    assert_eq!((reader.counters().frames, reader.counters().rejected), (1, 1));
}
