//! What the table says of a truck that is well, and of one that is not.

use super::*;
use robot_agent::config::SettingLayers;
use xtb_control::controller::{AdcSample, GyroSample};
use xtb_control::{Controller, Sample, Stamp, VehicleConfig};
use xtb_protocol::board::{BoardIdentity, BoardStatus, Firmware, LineCounters};

/// A truck on which everything is well.
struct Truck {
    readings: Readings,
    faults: Vec<FaultState>,
    counted: Counted,
    most_pulses: Option<u16>,
    remote: Option<[Option<u32>; 3]>,
}

fn counts(value: f64) -> AdcCount {
    AdcCount::try_from(value).unwrap()
}

fn well() -> Truck {
    let firmware = Firmware(0x0103);
    let (ready, watchdog, emergency_stop) = (true, false, Some(false));
    let status = BoardStatus { firmware, ready, watchdog, emergency_stop, setup_checksum: 7, rejected: 3 };
    let identity = BoardIdentity {
        firmware,
        hash: 0x1A2B_3C4D,
        model: 1,
        after_hang: false,
        late_periods: 0,
        replaced_samples: 0,
    };
    let adc = AdcSample {
        ir_front: [counts(60.0); SLOTS],
        ir_rear: [counts(300.0); SLOTS],
        tilt: [counts(517.0), counts(512.5)],
        pistons: [counts(512.0); 4],
    };
    let readings = Readings {
        status: Some(status),
        identity: Some(identity),
        set_up: true,
        setup_checksum: 7,
        pulses: Some(0),
        adc: Some(adc),
        battery_mv: Some(7400),
        remote: None,
        gyro: Some(GyroSample { roll: 100, pitch: -100, yaw: -16_384 }),
        bno085_yaw_cdeg: None,
        gyro_firmware: Some(1300),
        board_frames: LineCounters { frames: 90, rejected: 1, lost: 0, repeated: 0 },
        gyro_frames: 80,
        gyro_lost: 0,
        gyro_skipped: 4,
    };
    Truck {
        readings,
        faults: Vec::new(),
        counted: Counted { board_frames: 50, gyro_frames: 60, ..Counted::default() },
        most_pulses: Some(0),
        remote: Some([Some(938), Some(12_937), Some(750)]),
    }
}

impl Truck {
    fn rows(&self) -> Vec<Row> {
        let mut layers = SettingLayers::default();
        let imu = if self.readings.bno085_yaw_cdeg.is_some() { "bno085-rvc" } else { "3dm-g" };
        let text = format!("[hardware]\nkind = \"serial\"\n[vehicle]\nimu = \"{imu}\"\n");
        layers.file("robot.toml", &text).unwrap();
        let mut controller = Controller::new(VehicleConfig::default());
        let mut outputs = controller.outputs(Stamp::ZERO);
        if let Some(adc) = self.readings.adc {
            outputs = controller.step(Stamp::ZERO, &Sample::Adc(adc));
        }
        rows(&Evidence {
            settings: &layers.finish().unwrap(),
            readings: self.readings,
            outputs: &outputs,
            faults: &self.faults,
            counted: self.counted,
            most_pulses: self.most_pulses,
            remote: self.remote,
        })
    }

    fn row(&self, what: &str) -> Row {
        let found = self.rows().into_iter().find(|row| row.what == what);
        found.unwrap_or_else(|| panic!("no row {what}"))
    }

    /// Everything that is not well.
    fn wrong(&self) -> Vec<(String, Verdict)> {
        let rows = self.rows().into_iter().filter(|row| row.verdict != Verdict::Ok);
        rows.map(|row| (row.what, row.verdict)).collect()
    }
}

#[test]
fn of_a_truck_that_is_well_every_row_is_ok_and_reads_in_units() {
    let truck = well();
    assert_eq!(truck.wrong(), []);
    for (what, raw, reads_as) in [
        ("board line", "90 frames", "/dev/ttyUSB0 at 115200 baud"),
        ("board firmware", "0x0103", "version 1.3, Pico, hash 0x1a2b3c4d"),
        ("emergency stop", "0", "released"),
        ("encoder", "0 pulses", "0.0 rpm at the wheels"),
        ("range front 6", "60", "nothing in range"),
        ("range rear 1", "300", "18.0 cm"),
        ("tilt x (pitch)", "517.0", "0.0°"),
        ("piston RR", "512.0", "20.0 mm"),
        ("battery", "7400 mV", "7.40 V"),
        ("remote speed", "938 ticks", "1.50 ms"),
        ("remote steering", "12937 ticks", "1.50 ms"),
        ("remote selector", "750 ticks", "1.20 ms, manual"),
        ("gyro firmware", "1300", "version 1.3.00"),
        ("gyro yaw", "-16384", "270.0° clockwise from gyro north"),
        ("gyro roll", "100", "+0.5°"),
        ("CRC errors from board", "0 bad, 0 lost", "in 50 frames"),
    ] {
        let row = truck.row(what);
        assert_eq!((row.raw.as_str(), row.reads_as.as_str()), (raw, reads_as), "{what}");
    }
}

#[test]
fn what_cannot_be_right_is_suspicious_and_says_what_to_do() {
    let suspicious = |what: &str, spoil: fn(&mut Truck)| {
        let mut truck = well();
        spoil(&mut truck);
        let row = truck.row(what);
        assert_eq!((row.verdict, row.advice.is_empty()), (Verdict::Suspicious, false), "{row:?}");
        assert_eq!(truck.wrong().len(), 1, "{:?}", truck.wrong());
    };
    suspicious("board watchdog", |truck| truck.readings.status.as_mut().unwrap().watchdog = true);
    suspicious("board firmware", |truck| truck.readings.identity.as_mut().unwrap().after_hang = true);
    suspicious("board firmware", |truck| truck.readings.status.as_mut().unwrap().firmware = Firmware(0x0200));
    suspicious("emergency stop", |truck| {
        truck.readings.status.as_mut().unwrap().emergency_stop = Some(true);
    });
    suspicious("encoder", |truck| truck.most_pulses = Some(9));
    suspicious("range front 3", |truck| truck.readings.adc.as_mut().unwrap().ir_front[2] = counts(0.0));
    suspicious("range rear 6", |truck| truck.readings.adc.as_mut().unwrap().ir_rear[5] = counts(1023.0));
    suspicious("tilt y (roll)", |truck| truck.readings.adc.as_mut().unwrap().tilt[1] = counts(680.0));
    suspicious("tilt x (pitch)", |truck| truck.readings.adc.as_mut().unwrap().tilt[0] = counts(0.0));
    suspicious("piston FL", |truck| truck.readings.adc.as_mut().unwrap().pistons[0] = counts(1020.0));
    suspicious("battery", |truck| truck.readings.battery_mv = Some(6599));
    suspicious("remote speed", |truck| truck.remote.as_mut().unwrap()[0] = None);
    suspicious("remote steering", |truck| truck.remote.as_mut().unwrap()[1] = Some(200));
    suspicious("remote selector", |truck| truck.remote.as_mut().unwrap()[2] = Some(58_275));
    suspicious("gyro roll", |truck| truck.readings.gyro.as_mut().unwrap().roll = 8000);
    suspicious("gyro frames lost", |truck| truck.counted.gyro_lost = 1);
    suspicious("gyro check sums", |truck| truck.counted.gyro_skipped = 11);
    suspicious("CRC errors from board", |truck| truck.counted.board_rejected = 1);
    suspicious("CRC errors to board", |truck| truck.counted.refused_by_board = 1);
}

#[test]
fn one_pulse_is_no_motion_and_what_is_not_fitted_is_fine() {
    let mut truck = well();
    (truck.most_pulses, truck.remote, truck.readings.battery_mv) = (Some(1), None, None);
    let fine = ["battery", "remote speed", "remote steering", "remote selector"];
    assert_eq!(truck.wrong(), fine.map(|what| (what.to_owned(), Verdict::NotFitted)));
}

#[test]
fn a_board_of_before_says_neither_who_it_is_nor_whether_its_stop_is_pressed() {
    let mut truck = well();
    truck.readings.identity = None;
    let status = truck.readings.status.as_mut().unwrap();
    (status.firmware, status.emergency_stop) = (Firmware(0), None);
    assert_eq!(truck.wrong(), [("emergency stop".to_owned(), Verdict::NotFitted)]);
    let firmware = truck.row("board firmware");
    assert_eq!((firmware.reads_as.as_str(), firmware.verdict), ("version unknown", Verdict::Ok));
}

#[test]
fn a_pressed_emergency_stop_explains_the_watchdog() {
    let mut truck = well();
    let status = truck.readings.status.as_mut().unwrap();
    (status.emergency_stop, status.watchdog) = (Some(true), true);
    assert_eq!(truck.row("board watchdog").reads_as, "motor stopped: emergency stop");
}

#[test]
fn a_bno085_has_rows_under_its_own_name_and_no_line() {
    let mut truck = well();
    (truck.readings.bno085_yaw_cdeg, truck.readings.gyro_firmware) = (Some(9000), None);
    assert_eq!(truck.wrong(), []);
    for (what, raw, reads_as) in [
        ("BNO085 samples", "80 samples", "over the board's line"),
        ("BNO085 yaw", "9000", "270.0° clockwise from where it was switched on"),
        ("BNO085 pitch", "-100", "-0.5°"),
        ("BNO085 check sums", "0 bytes skipped", "in 60 frames"),
    ] {
        let row = truck.row(what);
        assert_eq!((row.raw.as_str(), row.reads_as.as_str()), (raw, reads_as), "{what}");
    }
    truck.faults = vec![FaultState { fault: Fault::GyroSilent, age_ms: 0, detail: None }];
    assert_eq!(truck.row("BNO085 samples").advice, Fault::GyroSilent.remedy());
}

#[test]
fn a_line_with_a_fault_is_missing_with_its_remedy_and_so_is_what_hangs_on_it() {
    let mut truck = well();
    truck.faults = vec![FaultState { fault: Fault::GyroBusy, age_ms: 0, detail: None }];
    (truck.readings.gyro, truck.readings.gyro_firmware, truck.counted.gyro_frames) = (None, None, 0);
    let missing = [
        "gyro line",
        "gyro firmware",
        "gyro yaw",
        "gyro roll",
        "gyro pitch",
        "gyro frames lost",
        "gyro check sums",
    ];
    assert_eq!(truck.wrong(), missing.map(|what| (what.to_owned(), Verdict::Missing)));
    assert_eq!(truck.row("gyro line").advice, Fault::GyroBusy.remedy());
    assert_eq!(truck.row("gyro pitch").advice, "see the gyro line");
    let mut truck = well();
    (truck.readings.adc, truck.readings.battery_mv) = (None, None);
    assert_eq!(truck.wrong().len(), 12 + 2 + 4 + 1);
}

#[test]
fn a_board_that_is_not_set_up_has_a_line_that_works() {
    let mut truck = well();
    truck.faults = vec![FaultState { fault: Fault::BoardNotSetUp, age_ms: 0, detail: None }];
    (truck.readings.set_up, truck.readings.pulses, truck.remote) = (false, None, None);
    let (line, setup) = (truck.row("board line"), truck.row("board set-up"));
    assert_eq!((line.verdict, setup.verdict), (Verdict::Ok, Verdict::Missing));
    for what in ["encoder", "remote speed"] {
        let row = truck.row(what);
        assert_eq!((row.verdict, row.advice.as_str()), (Verdict::Missing, "see the board set-up"));
    }
}
