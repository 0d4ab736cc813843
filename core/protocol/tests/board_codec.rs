//! The numbers of `xtb-board-codec`, which the firmware uses, are those of the typed frames.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_board_codec as codec;
use xtb_control::tpu::{PINS, SYSTEM_CLOCK_HZ, Setup};
use xtb_control::{AdcCount, PwmCount, VehicleConfig};
use xtb_protocol::board::{BoardStatus, FrameReader, FrameWriter, FromBoard};

#[test]
fn a_set_up_is_the_same_bytes_and_the_same_check_sum() {
    let typed = Setup::of(&VehicleConfig::default()).unwrap();
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

/// What is new in a status of version 1 does not disturb an agent that does not know it.
#[test]
fn an_agent_reads_a_status_with_the_bit_of_the_emergency_stop() {
    let state = codec::flags::READY | codec::flags::WATCHDOG | codec::flags::EMERGENCY_STOP;
    let frame = codec::Writer::default().frame(codec::kind::STATUS, [0x0101, state, 0x0156, 2]);
    let status =
        BoardStatus { firmware: 0x0101, ready: true, watchdog: true, setup_checksum: 0x0156, rejected: 2 };
    let mut found = Vec::new();
    FrameReader::default().from_board(frame.as_bytes(), |frame| found.push(frame.unwrap()));
    assert_eq!(found, [FromBoard::Status(status)]);
    assert_eq!(FrameWriter::default().status(&status).as_bytes().len(), frame.as_bytes().len());
}
