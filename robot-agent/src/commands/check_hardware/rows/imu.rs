//! The rows of the inertial unit: a 3DM-G on a line of its own, or a BNO085 at the board.

use super::{Evidence, Row, heard, signed};
use xtb_control::odometry::GYRO_DEG_PER_COUNT;
use xtb_control::vehicle::Imu;
use xtb_protocol::messages::Fault;

/// A truck on a floor pitches and rolls less than this, in degrees.
const LEVEL_DEG: f64 = 30.0;

impl Evidence<'_> {
    /// The unit's line, who is at it, and its angles.
    pub(super) fn gyro(&self) -> Vec<Row> {
        let (readings, hardware) = (&self.readings, &self.settings.hardware);
        let (mut rows, yaw, from) = match self.imu() {
            Imu::ThreeDmG => {
                let firmware = readings.gyro_firmware.map(|version| {
                    let text =
                        format!("version {}.{}.{:02}", version / 1000, version / 100 % 10, version % 100);
                    heard(version, text, None)
                });
                let unanswered = self.of_gyro("no answer to F0: check the wire to the gyro");
                let line = self.line("gyro", readings.gyro_frames, &hardware.gyro, hardware.gyro_baud);
                let rows = vec![line, Row::new("gyro firmware", firmware, unanswered)];
                (rows, readings.gyro.map(|gyro| gyro.yaw), "clockwise from gyro north")
            }
            Imu::Bno085Rvc => {
                let frames = readings.gyro_frames;
                let remedy = self.line_remedy("gyro");
                let well = (frames > 0 && remedy.is_none())
                    .then(|| heard(format!("{frames} samples"), "over the board's line", None));
                let silent = remedy.unwrap_or(self.of_board(Fault::GyroSilent.remedy()));
                let rows = vec![Row::new("BNO085 samples", well, silent)];
                (rows, readings.bno085_yaw_cdeg, "clockwise from where it was switched on")
            }
        };
        rows.extend(self.angles(yaw, from));
        rows
    }

    /// `yaw`: as it came; `from`: where it counts from.
    fn angles(&self, yaw: Option<i16>, from: &str) -> [Row; 3] {
        let (gyro, unit) = (self.readings.gyro, self.unit());
        let remedy = self.of_gyro(Fault::GyroSilent.remedy());
        let lean = |what, counts: Option<i16>| {
            let angle = counts.map(|counts| {
                let deg = f64::from(counts) * GYRO_DEG_PER_COUNT;
                let leans = deg.abs() > LEVEL_DEG;
                let wrong = leans.then_some("put the truck on its wheels; is the gyro mounted level?");
                heard(counts, signed(deg), wrong)
            });
            Row::new(format!("{unit} {what}"), angle, remedy)
        };
        let yaw = yaw.zip(gyro).map(|(raw, gyro)| {
            let deg = (f64::from(gyro.yaw) * GYRO_DEG_PER_COUNT).rem_euclid(360.0);
            heard(raw, format!("{deg:.1}° {from}"), None)
        });
        [
            Row::new(format!("{unit} yaw"), yaw, remedy),
            lean("roll", gyro.map(|gyro| gyro.roll)),
            lean("pitch", gyro.map(|gyro| gyro.pitch)),
        ]
    }

    /// What the rows call the inertial unit.
    pub(super) fn unit(&self) -> &'static str {
        match self.imu() {
            Imu::ThreeDmG => "gyro",
            Imu::Bno085Rvc => "BNO085",
        }
    }

    /// Why something of the unit is missing; `itself` if there is no cause further up.
    fn of_gyro(&self, itself: &'static str) -> &'static str {
        match (self.line_remedy("gyro"), self.imu()) {
            (None, Imu::ThreeDmG) => itself,
            (None, Imu::Bno085Rvc) => self.of_board(itself),
            (Some(_), Imu::ThreeDmG) => "see the gyro line",
            (Some(_), Imu::Bno085Rvc) => "see the BNO085 samples",
        }
    }

    fn imu(&self) -> Imu {
        self.settings.vehicle.imu
    }
}
