//! Whatever comes in: codecs round-trip what they wrote and never panic on what they did not.

use proptest::prelude::*;
use xtb_control::controller::{AdcSample, PwmOutputs};
use xtb_control::vehicle::{SLOTS, USUAL_SLOTS};
use xtb_control::{AdcCount, PwmCount};
use xtb_protocol::board::{BoardError, FrameReader, FrameWriter, FromBoard, MAX_PULSES, ToBoard};
use xtb_protocol::codec::{Format, decode, encode, encoding};
use xtb_protocol::gyro_3dmg::GyroReader;
use xtb_protocol::messages::{
    Body, Event, LinkLoss, MAX_ROSTER, Message, Reply, Request, RobotState, Roster, RosterEntry, Setpoint,
    Via,
};
use xtb_protocol::wire::{CodecError, MAX_BYTES};
use xtb_protocol::{Name, Uuid, keys::Key};

fn pwm() -> impl Strategy<Value = PwmOutputs> {
    prop::collection::vec(2331_u16..=5272, 10).prop_map(|counts| {
        let at = |i: usize| PwmCount::try_from(counts[i]).unwrap();
        PwmOutputs {
            motor: at(0),
            steer_front: at(1),
            steer_rear: at(2),
            bumper_front: at(3),
            bumper_rear: at(4),
            pistons: [at(5), at(6), at(7), at(8)],
            spare: at(9),
        }
    })
}

/// A scan with all channels.
fn adc() -> impl Strategy<Value = AdcSample> {
    let ranges = prop::collection::vec(0_u16..=1023, 2 * SLOTS);
    let sums = prop::collection::vec(0_u16..=1023 * 64, 6);
    (ranges, sums).prop_map(|(ranges, sums)| {
        let whole = |i: usize| AdcCount::try_from(ranges[i]).unwrap();
        let mean = |i: usize| AdcCount::try_from(f64::from(sums[i]) / 64.0).unwrap();
        AdcSample {
            ir_front: std::array::from_fn(whole),
            ir_rear: std::array::from_fn(|i| whole(i + SLOTS)),
            tilt: [mean(0), mean(1)],
            pistons: [mean(2), mean(3), mean(4), mean(5)],
        }
    })
}

fn body() -> impl Strategy<Value = Body> {
    let link_loss = prop_oneof![Just(LinkLoss::Halt), Just(LinkLoss::Finish)];
    prop_oneof![
        any::<bool>().prop_map(|take| Body::Acquire { take }),
        Just(Body::Retain {}),
        Just(Body::Stop {}),
        any::<u128>().prop_map(|id| Body::Cancel { goal: Uuid::from_u128(id) }),
        (-1000.0..1000.0, -1000.0..1000.0, prop::option::of(-3.1..3.1), link_loss).prop_map(
            |(x_m, y_m, yaw_rad, on_link_loss)| Body::Goto {
                x_m,
                y_m,
                yaw_rad,
                via: yaw_rad.map(|_| Via::Planned),
                on_link_loss,
                finish_s: 60.0
            }
        ),
    ]
}

fn never_panics<M: Message>(bytes: &[u8]) {
    for format in [Format::Postcard, Format::Json] {
        let _ = decode::<M>(&encoding::<M>(format), bytes);
    }
}

proptest! {
    #[test]
    fn requests_round_trip_in_both_formats(id: u128, body in body()) {
        let request = Request { id: Uuid::from_u128(id), lease: None, body };
        for format in [Format::Postcard, Format::Json] {
            let bytes = encode(&request, format).unwrap();
            let (back, read_as) = decode::<Request>(&encoding::<Request>(format), &bytes).unwrap();
            prop_assert_eq!((&back, read_as), (&request, format));
        }
    }

    #[test]
    fn random_bytes_are_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), text: String) {
        never_panics::<Request>(&bytes);
        never_panics::<Reply>(&bytes);
        never_panics::<Setpoint>(&bytes);
        never_panics::<RobotState>(&bytes);
        never_panics::<Event>(&bytes);
        let _ = decode::<Request>(&text, &bytes);
        let _ = Key::parse(&text);
    }

    #[test]
    fn a_truncated_or_lengthened_message_is_refused(body in body(), extra in 1_usize..9) {
        let request = Request { id: Uuid::nil(), lease: None, body };
        let name = encoding::<Request>(Format::Postcard);
        let mut bytes = encode(&request, Format::Postcard).unwrap();
        for len in 0..bytes.len() {
            prop_assert!(decode::<Request>(&name, &bytes[..len]).is_err());
        }
        bytes.extend(vec![0; extra]);
        prop_assert!(decode::<Request>(&name, &bytes).is_err());
    }

    #[test]
    fn numbers_that_are_not_finite_or_in_range_are_refused(
        x in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(1000.5), Just(-1e300)]
    ) {
        let body =
            Body::Goto { x_m: x, y_m: 0.0, yaw_rad: None, via: None, on_link_loss: LinkLoss::Halt, finish_s: 60.0 };
        let request = Request { id: Uuid::nil(), lease: None, body };
        prop_assert!(matches!(encode(&request, Format::Postcard), Err(CodecError::OutOfRange(_))));
        let setpoint = Setpoint { lease: None, seq: 0, echo_tick_ms: None, rpm: 0.0, steering: x };
        prop_assert!(matches!(encode(&setpoint, Format::Json), Err(CodecError::OutOfRange(_))));
    }

    #[test]
    fn board_frames_round_trip_in_any_pieces(
        pwm in pwm(), adc in adc(), pulses in 0..=MAX_PULSES, battery in prop::option::of(0_u16..20_000),
        piece in 1_usize..50,
    ) {
        let (mut writer, mut reader) = (FrameWriter::default(), FrameReader::default());
        let mut bytes = writer.encoder(pulses).as_bytes().to_vec();
        bytes.extend(writer.adc(&adc, battery).as_bytes());
        bytes.extend(writer.wide_adc(&adc, battery).as_bytes());
        let mut found = Vec::new();
        for piece in bytes.chunks(piece) {
            reader.from_board(piece, |frame| found.push(frame));
        }
        let mut usual = adc;
        for side in [&mut usual.ir_front, &mut usual.ir_rear] {
            side[USUAL_SLOTS..].fill(AdcCount::ZERO);
        }
        let expected = vec![
            Ok(FromBoard::Encoder { pulses }),
            Ok(FromBoard::Adc { sample: usual, battery_mv: battery, is_wide: false }),
            Ok(FromBoard::Adc { sample: adc, battery_mv: battery, is_wide: true }),
        ];
        prop_assert_eq!(found, expected);
        let mut back = Vec::new();
        FrameReader::default().to_board(writer.pwm(&pwm).as_bytes(), |frame| back.push(frame));
        prop_assert_eq!(back, vec![Ok(ToBoard::Pwm(pwm))]);
    }

    #[test]
    fn random_bytes_on_a_line_are_never_a_panic_and_the_next_frame_is_found(
        garbage in prop::collection::vec(any::<u8>(), 0..400), pulses in 0..=MAX_PULSES,
    ) {
        let mut reader = FrameReader::default();
        let mut last = None;
        reader.from_board(&garbage, |_| {});
        reader.from_board(&[0], |_| {});
        reader.from_board(FrameWriter::default().encoder(pulses).as_bytes(), |frame| last = Some(frame));
        prop_assert_eq!(last, Some(Ok(FromBoard::Encoder { pulses })));
        GyroReader::default().push(&garbage, |_| {});
    }

    #[test]
    fn a_flipped_bit_in_a_board_frame_is_never_accepted(pwm in pwm(), bit in 0_usize..26 * 8) {
        let mut frame = FrameWriter::default().pwm(&pwm).as_bytes().to_vec();
        let bit = bit % (8 * (frame.len() - 1));
        frame[bit / 8] ^= 1 << (bit % 8);
        FrameReader::default().to_board(&frame, |got| assert!(got.is_err(), "{got:?}"));
    }
}

#[test]
fn what_is_wrong_is_named() {
    let too_long = decode::<Request>("application/json", &vec![b' '; MAX_BYTES + 1]).unwrap_err();
    assert_eq!(too_long, CodecError::Oversized { len: MAX_BYTES + 1, max: MAX_BYTES });
    let version = decode::<Request>("application/x-postcard;xtb.Request.v9", &[]).unwrap_err();
    assert_eq!(version.to_string(), "Request version 9, this program speaks version 2");
    let foreign = decode::<Request>("", b"{}").unwrap_err();
    assert!(foreign.to_string().contains("application/json"), "{foreign}");
    let unknown = decode::<Request>("application/json", br#"{"id":1}"#).unwrap_err();
    assert!(matches!(unknown, CodecError::Malformed { name: "Request", .. }), "{unknown}");
}

#[test]
fn a_roster_names_each_robot_once_and_no_more_than_a_fleet_can_have() {
    let entry = |n: usize| RosterEntry {
        name: Name::new(&format!("xtb-{n}")).unwrap(),
        tags: Vec::new(),
        start_pose: None,
    };
    let roster = |count: usize| Roster { robots: (0..count).map(entry).collect() };
    let read = |roster: &Roster| {
        let json = serde_json::to_vec(roster).unwrap();
        decode::<Roster>("application/json", &json).map(|(roster, _)| roster)
    };
    assert_eq!(read(&roster(0)), Ok(roster(0)));
    assert_eq!(read(&roster(MAX_ROSTER)), Ok(roster(MAX_ROSTER)));
    let too_many = read(&roster(MAX_ROSTER + 1)).unwrap_err();
    assert!(matches!(too_many, CodecError::OutOfRange(_)), "{too_many}");
    let twice = read(&Roster { robots: vec![entry(1), entry(2), entry(1)] }).unwrap_err();
    assert!(twice.to_string().contains("xtb-1 stands in it more than once"), "{twice}");
}

#[test]
fn the_refusal_of_a_very_long_field_fits_into_a_reply() {
    let json = format!(r#"{{"{}":0}}"#, "x".repeat(16_300));
    let error = decode::<Request>("application/json", json.as_bytes()).unwrap_err();
    let reply = Reply::refused(Uuid::nil(), error.code(), error.to_string(), "");
    assert!(encode(&reply, Format::Json).unwrap().len() < 1024, "{error}");
}

#[test]
fn gaps_in_the_sequence_are_counted() {
    let (mut writer, mut reader) = (FrameWriter::default(), FrameReader::default());
    for i in 0..10 {
        let frame = writer.encoder(i);
        if i != 3 && i != 4 {
            reader.from_board(frame.as_bytes(), |_| {});
        }
    }
    assert_eq!((reader.counters().frames, reader.counters().lost), (8, 2));
}

#[test]
fn more_pulses_than_the_encoder_can_give_are_refused() {
    let mut found = None;
    let frame = FrameWriter::default().encoder(MAX_PULSES + 1);
    FrameReader::default().from_board(frame.as_bytes(), |frame| found = Some(frame));
    assert_eq!(found, Some(Err(BoardError::Pulses(MAX_PULSES + 1))));
}
