//! `docs/io-board.md` is what firmware is written from: its examples, tables and names are ours.

use xtb_control::controller::{AdcSample, GyroSample, PwmOutputs, RemoteSample};
use xtb_control::tpu::{ResetMask, TpuSetup, WATCHDOG_MS};
use xtb_control::{AdcCount, PwmCount, VehicleConfig};
use xtb_protocol::bno085::Bno085Sample;
use xtb_protocol::board::rates::{Direction, HEAD_ROOM, LineRates};
use xtb_protocol::board::{
    Ask, BoardIdentity, BoardStatus, Firmware, Frame, FrameReader, FrameWriter, MAX_FRAME, MAX_PULSES,
};
use xtb_protocol::gyro_3dmg::{EulerFrame, encode_firmware};
use xtb_protocol::messages::Fault;

const DOC: &str = include_str!("../../../../docs/io-board.md");

/// Fails unless the document says it, wherever its lines break.
fn says(what: &str) {
    let squeezed = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(squeezed(DOC).contains(&squeezed(what)), "docs/io-board.md does not say: {what}");
}

fn spaced(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().join(" ")
}

/// The document has the frame as it goes over the line.
fn shows(frame: &Frame) {
    says(&spaced(frame.as_bytes()));
}

/// A frame that follows `before` others.
fn after(before: usize, write: impl Fn(&mut FrameWriter) -> Frame) -> Frame {
    let mut writer = FrameWriter::default();
    for _ in 0..before {
        writer.encoder(0);
    }
    write(&mut writer)
}

fn setup() -> TpuSetup {
    TpuSetup::of(&VehicleConfig::default()).unwrap()
}

fn board() -> LineRates {
    let vehicle = VehicleConfig::default();
    LineRates::board(vehicle.encoder.window_s, vehicle.remote.period_ms)
}

fn scan() -> AdcSample {
    let count = |counts: u16| AdcCount::try_from(counts).unwrap();
    AdcSample {
        ir_front: [60, 61, 62, 300, 301, 302, 63, 64].map(count),
        ir_rear: [60, 60, 60, 60, 60, 60, 61, 1023].map(count),
        tilt: [517, 512].map(count),
        pistons: [512; 4].map(count),
    }
}

#[test]
fn the_agents_frames() {
    let n = PwmCount::NEUTRAL;
    let pwm = PwmOutputs {
        motor: PwmCount::MAX,
        steer_front: PwmCount::try_from(3710).unwrap(),
        steer_rear: PwmCount::try_from(4179).unwrap(),
        bumper_front: n,
        bumper_rear: n,
        pistons: [n; 4],
        spare: n,
    };
    shows(&after(0, |writer| writer.pwm(&pwm)));
    shows(&after(1, |writer| writer.setup(&setup())));
    says(&format!("{:#06x}", setup().checksum()));
    shows(&after(2, |writer| writer.reset(ResetMask { speed: true, ..ResetMask::default() })));
}

#[test]
fn the_boards_frames() {
    shows(&after(7, |writer| writer.encoder(23)));
    shows(&after(8, |writer| writer.adc(&scan(), Some(7400))));
    let remote = RemoteSample { speed: Some(938), steering: Some(12_937), selector: None };
    shows(&after(9, |writer| writer.remote(&remote)));
    let waiting = BoardStatus {
        firmware: Firmware(0x0102),
        ready: false,
        watchdog: true,
        emergency_stop: None,
        setup_checksum: 0,
        rejected: 0,
    };
    shows(&after(0, |writer| writer.status(&waiting)));
    let setup_checksum = setup().checksum();
    let confirmed = BoardStatus { ready: true, setup_checksum, ..waiting };
    shows(&after(1, |writer| writer.status(&confirmed)));
}

/// What a board and an agent may do without.
#[test]
fn the_optional_frames() {
    shows(&after(6, |writer| writer.wide_adc(&scan(), Some(7400))));
    let firmware = Firmware(0x0101);
    let setup_checksum = setup().checksum();
    let (ready, watchdog, emergency_stop) = (true, true, Some(true));
    let pressed = BoardStatus { firmware, ready, watchdog, emergency_stop, setup_checksum, rejected: 0 };
    shows(&after(2, |writer| writer.status(&pressed)));
    shows(&after(3, |writer| writer.ask(Ask { identity: true, imu: true, wide_scan: false })));
    let identity = BoardIdentity {
        firmware,
        hash: 0x89AB_CDEF,
        model: 1,
        after_hang: true,
        late_periods: 0,
        replaced_samples: 2,
    };
    shows(&after(4, |writer| writer.identity(&identity)));
    let sample = Bno085Sample {
        index: 0xDE,
        bad: 1,
        yaw_cdeg: 1,
        pitch_cdeg: -110,
        roll_cdeg: 2085,
        acceleration_mg: [-371, -20, 977],
    };
    shows(&after(5, |writer| writer.bno085(&sample)));
}

#[test]
fn the_gyros_frames() {
    let angles = GyroSample { roll: 1, pitch: -2, yaw: 256 };
    says(&spaced(&EulerFrame { angles, ticks: 513 }.encode()));
    says(&spaced(&encode_firmware(1300)));
}

#[test]
fn limits_and_channels() {
    says(&format!("More than {MAX_FRAME} bytes without 0x00"));
    says(&format!("0..={MAX_PULSES}"));
    says(&format!("{WATCHDOG_MS} ms"));
    let pins = VehicleConfig::default().channels.parameters();
    for (i, (pin, code)) in pins.iter().zip(setup().channels).enumerate() {
        let name = pin.name.trim_start_matches("channels.");
        says(&format!("| {} | `{name}` | {} | `{code:02x}` |", 8 + i, pin.value.trim_matches('"')));
    }
}

#[test]
fn what_the_frames_need() {
    for line in [board().with_bno085(), board().with_wide_scans(), LineRates::gyro()] {
        for frame in line.frames() {
            let times = [115_200, 38_400, 9600].map(|baud| format!("{:.1}", frame.time_ms(baud)));
            says(&format!(
                "| {} | {:.0} | {:.0} | {} |",
                frame.bytes,
                frame.bytes_per_s(),
                frame.baud(),
                times.join(" / ")
            ));
        }
    }
    let (from, to) = (Direction::FromDevice, Direction::ToDevice);
    for direction in [from, to] {
        let (sum, need) = (board().sum_baud(direction), board().need_baud(direction));
        says(&format!("{sum:.0} baud, {need} with the quarter"));
    }
    for baud in [9600, 19_200, 28_800, 38_400, 57_600, 115_200] {
        let load = |direction| 100.0 * board().sum_baud(direction) / f64::from(baud);
        let fits = if board().check(baud).is_ok() { "yes" } else { "no" };
        says(&format!("| {baud} | {:.0} % | {:.0} % | {fits} |", load(from), load(to)));
    }
    says(&format!("{}", board().check(9600).unwrap_err()));
    says(&format!("needs {} baud", LineRates::gyro().needs_baud()));
    says(&format!("{} baud with a BNO085", board().with_bno085().need_baud(from)));
    assert_eq!(HEAD_ROOM, 1.25, "the quarter");
}

#[test]
fn every_fault_has_its_line() {
    use Fault::*;
    for fault in [
        BoardUnplugged,
        BoardBusy,
        BoardNoPermission,
        BoardPortBroken,
        BoardSilent,
        BoardGarbage,
        BoardHalfFrames,
        BoardWrongDevice,
        BoardNotSetUp,
        GyroUnplugged,
        GyroBusy,
        GyroNoPermission,
        GyroPortBroken,
        GyroSilent,
        GyroGarbage,
        GyroHalfFrames,
        GyroWrongDevice,
        EncoderSilent,
        ConverterSilent,
        RemoteLost,
        TiltOutOfRange,
    ] {
        says(&format!("`{fault}`"));
        says(fault.remedy());
    }
}

/// What the Python of the document computes, from its own words.
#[test]
fn the_python_examples_are_frames() {
    let mut frames = Vec::new();
    for line in DOC.lines().filter(|line| line.starts_with("assert frame(")) {
        frames.push(line.split('"').nth(1).unwrap_or_else(|| panic!("no hexadecimal in {line}")));
    }
    assert!(frames.len() >= 3, "{frames:?}");
    for hex in frames {
        let bytes: Vec<u8> =
            (0..hex.len()).step_by(2).map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap()).collect();
        let mut good = 0;
        FrameReader::default().from_board(&bytes, |frame| good += u32::from(frame.is_ok()));
        FrameReader::default().to_board(&bytes, |frame| good += u32::from(frame.is_ok()));
        assert_eq!(good, 1, "{hex}");
    }
}
