//! The numbers of `xtb-board-codec`, which the firmware uses, are those of the typed frames.

#![allow(clippy::unwrap_used)] // a test that cannot go on shall end

use xtb_board_codec as codec;
use xtb_control::tpu::{PINS, SYSTEM_CLOCK_HZ, Setup};
use xtb_control::{AdcCount, PwmCount, VehicleConfig};
use xtb_protocol::board::{BoardError, BoardStatus, FrameReader, FrameWriter, FromBoard};

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

/// The frames that the typed layer does not know yet, as `docs/io-board.md` shows them.
#[test]
fn the_document_shows_what_is_optional() {
    let doc = include_str!("../../../docs/io-board.md");
    let shows = |sequence: usize, kind: u8, numbers: &[u16]| {
        let mut writer = codec::Writer::default();
        for _ in 0..sequence {
            writer.frame(codec::kind::ENCODER, [0]);
        }
        let frame = writer.frame(kind, numbers.iter().copied());
        let bytes: Vec<String> = frame.as_bytes().iter().map(|byte| format!("{byte:02x}")).collect();
        assert!(doc.contains(&format!("`{}`", bytes.join(" "))), "{kind:#04x}: {}", bytes.join(" "));
    };
    shows(2, codec::kind::STATUS, &[0x0101, 7, 0x0156, 0]);
    shows(3, codec::kind::ASK, &[codec::ask::IDENTITY | codec::ask::IMU]);
    shows(4, codec::kind::IDENTITY, &[0x0101, 0xCDEF, 0x89AB, 0x0101, 0, 2]);
    let [yaw, pitch, roll, x, y, z] = [1_i16, -110, 2085, -371, -20, 977].map(|number| number as u16);
    shows(5, codec::kind::IMU, &[0x01DE, yaw, pitch, roll, x, y, z]);
}

/// An agent that does not know the optional frames counts them and goes on.
#[test]
fn an_agent_refuses_optional_frames_and_reads_the_next() {
    let mut writer = codec::Writer::default();
    let mut bytes = writer.frame(codec::kind::IMU, [0; 7]).as_bytes().to_vec();
    bytes.extend(writer.frame(codec::kind::ENCODER, [23]).as_bytes());
    let mut reader = FrameReader::default();
    let mut found = Vec::new();
    reader.from_board(&bytes, |frame| found.push(frame));
    assert_eq!(found, [Err(BoardError::UnknownType(0x16)), Ok(FromBoard::Encoder { pulses: 23 })]);
    assert_eq!((reader.counters().frames, reader.counters().rejected), (1, 1));
}
