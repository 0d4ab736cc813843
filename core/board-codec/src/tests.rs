//! The bytes of `docs/io-board.md`, and what becomes of broken ones.

extern crate std;

use super::*;
use std::vec::Vec;

/// The default set-up of the document.
const SETUP: Setup = Setup {
    pwm_period_counts: 55_500,
    tcr_prescaler: 64,
    fqm_window: 0x8000,
    watchdog_ms: 100,
    channels: [0x00, 0x01, 0x02, 0x10, 0x03, 0x04, 0x11, 0x05, 0x06, 0x07, 0x12, 0x13, 0x14, 0x15],
};

fn read(reader: &mut Reader, bytes: &[u8]) -> Vec<Result<Content, FrameError>> {
    let mut found = Vec::new();
    reader.read(bytes, |content| found.push(content));
    found
}

fn frame(before: usize, kind: u8, payload: &[u16]) -> Frame {
    let mut writer = Writer::default();
    for _ in 0..before {
        writer.frame(kind::ENCODER, [0]);
    }
    writer.frame(kind, payload.iter().copied())
}

#[test]
fn the_check_values() {
    assert_eq!(crc32(b"123456789"), 0xCBF4_3926);
    assert_eq!(SETUP.checksum(), 0x0156);
    assert_eq!(Setup::from_payload(&SETUP.to_bytes()), Some(SETUP));
    assert_eq!(Setup::from_payload(&SETUP.to_bytes()[1..]), None);
}

#[test]
fn the_bytes_on_the_line() {
    let pwm = [5272, 3710, 4179, 3750, 3750, 3750, 3750, 3750, 3750, 3750];
    let on_line = [
        0x02, 0x10, 0x19, 0x98, 0x14, 0x7e, 0x0e, 0x53, 0x10, 0xa6, 0x0e, 0xa6, 0x0e, 0xa6, 0x0e, 0xa6, 0x0e,
        0xa6, 0x0e, 0xa6, 0x0e, 0xa6, 0x0e, 0xc5, 0xa2, 0x93, 0x0d, 0x00,
    ];
    assert_eq!(frame(0, kind::PWM, &pwm).as_bytes(), on_line);
    let encoder = [0x04, 0x11, 0x07, 0x17, 0x05, 0xf5, 0x7d, 0x2d, 0xc9, 0x00];
    assert_eq!(frame(7, kind::ENCODER, &[23]).as_bytes(), encoder);
    let content = read(&mut Reader::default(), &on_line).remove(0).unwrap();
    assert_eq!((content.kind, content.seq, words(content.payload())), (kind::PWM, 0, Some(pwm)));
}

#[test]
fn a_frame_in_pieces_between_idle_delimiters_is_one_frame() {
    let frame = frame(0, kind::STATUS, &[0x0101, 1, 0, 7]);
    let mut reader = Reader::default();
    assert!(read(&mut reader, &[0, 0]).is_empty());
    for byte in &frame.as_bytes()[..frame.as_bytes().len() - 1] {
        assert!(read(&mut reader, &[*byte]).is_empty());
        assert!(reader.is_inside_frame());
    }
    assert_eq!(words(read(&mut reader, &[0, 0])[0].as_ref().unwrap().payload()), Some([0x0101, 1, 0, 7]));
    assert!(!reader.is_inside_frame());
}

#[test]
fn no_single_wrong_bit_passes() {
    let good = frame(3, kind::PWM, &[3750; 10]);
    for place in 0..good.as_bytes().len() - 1 {
        for bit in 0..8 {
            let mut bytes = good.as_bytes().to_vec();
            bytes[place] ^= 1 << bit;
            let found = read(&mut Reader::default(), &bytes);
            assert!(found.iter().all(Result::is_err), "byte {place}, bit {bit}");
        }
    }
}

#[test]
fn what_is_wrong_is_named_and_the_next_frame_is_read() {
    let good = frame(0, kind::ENCODER, &[1]);
    let mut reader = Reader::default();
    let mut bytes = [1_u8; MAX_FRAME + 1].to_vec();
    bytes.push(0);
    bytes.extend(good.as_bytes());
    let found = read(&mut reader, &bytes);
    assert_eq!(found[0].as_ref().unwrap_err(), &FrameError::TooLong);
    assert!(found[1].is_ok());
    assert_eq!(read(&mut reader, &[9, 1, 0])[0].as_ref().unwrap_err(), &FrameError::Cobs);
    assert_eq!(read(&mut reader, &[2, 1, 0])[0].as_ref().unwrap_err(), &FrameError::TooShort(1));
    let mut bytes = good.as_bytes().to_vec();
    bytes[3] ^= 0x40;
    assert!(matches!(read(&mut reader, &bytes)[0], Err(FrameError::Crc { .. })));
}

#[test]
fn gaps_and_repeats_are_counted() {
    let mut reader = Reader::default();
    for before in [0, 1, 4, 4] {
        read(&mut reader, frame(before, kind::ENCODER, &[0]).as_bytes());
    }
    assert_eq!(reader.losses(), Losses { lost: 2, repeated: 1 });
    reader.forget();
    read(&mut reader, frame(9, kind::ENCODER, &[0]).as_bytes());
    assert_eq!(reader.losses().lost, 2);
}
