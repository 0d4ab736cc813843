//! What is wrong with a serial line, by name: what a person has to know to repair it.
//!
//! A line is well while good frames come. When none has come for [`LINE_LOST_MS`], the bytes that
//! came instead tell why:
//!
//! ```text
//!   port not open ────────────► unplugged · busy · no_permission · port_broken   (at once)
//!   no bytes ─────────────────► silent
//!   the other device's frames,
//!   our own echo, or text ────► wrong_device
//!   whole frames, ever the same ► frozen
//!   many beginnings, no ends ─► half_frames
//!   anything else ────────────► garbage
//! ```

use xtb_control::Stamp;

/// A line without a good frame for this long has a fault: more than one status frame of the board (100 ms),
/// and named within 200 ms (docs/safety.md).
pub const LINE_LOST_MS: u64 = 150;
/// A fault's name changes, or ends, only after this time; chosen, not measured.
const STEADY_MS: u64 = 300;
/// Bytes are looked at in windows of this length, the present and the last one: a status frame of the board
/// comes in each.
const WINDOW_MS: u64 = 100;

/// Why a port is not open.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PortTrouble {
    /// There is no such device.
    Unplugged,
    /// Another program holds it.
    Busy,
    /// This user may not open it.
    NoPermission,
    /// Anything else.
    Broken,
}

/// What is wrong with a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LineFault {
    /// The port is not open.
    Port(PortTrouble),
    /// Nothing comes.
    Silent,
    /// Bytes without sense: baud rate, ground, interference.
    Garbage,
    /// Frames begin and do not end: bytes are being lost.
    HalfFrames,
    /// Another device, or the two lines are swapped.
    WrongDevice,
    /// One frame comes again and again: the device hangs.
    Frozen,
}

/// Which device should be at the other end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Device {
    /// The I/O board.
    Board,
    /// The 3DM-G.
    Gyro,
}

/// What came in one window.
#[derive(Debug, Clone, Copy, Default)]
struct Evidence {
    bytes: u32,
    /// Bytes that look like the beginning of a frame.
    starts: u32,
    /// Printable characters and line ends.
    text: u32,
    /// Good frames of another kind.
    foreign: u32,
    /// Whole frames that had come before.
    repeated: u32,
}

/// Watches one line.
#[derive(Debug, Clone)]
pub struct LineWatch {
    device: Device,
    port: Option<PortTrouble>,
    /// Whether anybody has said how the port is.
    known: bool,
    well_at: Stamp,
    window: Evidence,
    before: Evidence,
    window_since: Stamp,
    last_byte: u8,
    /// The fault that is shown, and since when the bytes say something else.
    shown: Option<LineFault>,
    other_since: Option<Stamp>,
    /// Since when good frames come again.
    recovering_since: Option<Stamp>,
}

impl LineWatch {
    /// A line that has just been opened.
    #[must_use]
    pub fn new(device: Device, now: Stamp) -> Self {
        Self {
            device,
            port: None,
            known: false,
            well_at: now,
            window: Evidence::default(),
            before: Evidence::default(),
            window_since: now,
            last_byte: 0,
            shown: None,
            other_since: None,
            recovering_since: None,
        }
    }

    /// The port was read: `None` = it is open. True if it has just been opened, for the first time
    /// or again: from then on it has its time to speak.
    pub fn port(&mut self, now: Stamp, trouble: Option<PortTrouble>) -> bool {
        let opened = trouble.is_none() && (self.port.is_some() || !self.known);
        if opened {
            *self = Self::new(self.device, now);
        }
        (self.port, self.known) = (trouble, true);
        opened
    }

    /// Nobody looked for a while, or the clock jumped: what was not seen meanwhile is no fault.
    pub fn look_anew(&mut self, now: Stamp) {
        *self = Self { port: self.port, known: self.known, ..Self::new(self.device, now) };
    }

    /// Something came; to be told before what is in it.
    pub fn came(&mut self, now: Stamp) {
        if now.since_ms(self.window_since) >= WINDOW_MS {
            self.before = std::mem::take(&mut self.window);
            self.window_since = now;
        }
    }

    /// What came; to be told after the frames in it, as bytes with a good frame are evidence of nothing.
    pub fn bytes(&mut self, now: Stamp, bytes: &[u8]) {
        if self.well_at == now {
            self.last_byte = bytes.last().copied().unwrap_or(self.last_byte);
            return;
        }
        for &byte in bytes {
            let start = match self.device {
                // A COBS code of a short piece, then one of the board's frame types.
                Device::Board => (2..=0x30).contains(&self.last_byte) && (0x11..=0x14).contains(&byte),
                Device::Gyro => byte == xtb_protocol::gyro_3dmg::EULER,
            };
            self.window.bytes += 1;
            self.window.starts += u32::from(start);
            self.window.text += u32::from((b' '..=b'~').contains(&byte) || matches!(byte, b'\r' | b'\n'));
            self.last_byte = byte;
        }
    }

    /// A good frame of this device came: what came before says nothing about a fault.
    pub fn good_frame(&mut self, now: Stamp) {
        self.recovering_since =
            self.recovering_since.filter(|_| self.unwell_ms(now) <= LINE_LOST_MS).or(Some(now));
        self.well_at = now;
        (self.window, self.before) = (Evidence::default(), Evidence::default());
    }

    /// A good frame came that this device never sends.
    pub fn foreign_frame(&mut self) {
        self.window.foreign += 1;
    }

    /// A frame of this device came again, unchanged.
    pub fn repeated_frame(&mut self) {
        self.window.repeated += 1;
    }

    /// How long no good frame has come.
    #[must_use]
    pub fn unwell_ms(&self, now: Stamp) -> u64 {
        now.since_ms(self.well_at)
    }

    /// What is wrong, if anything. A name stays until good frames have come for 300 ms, or until
    /// the bytes have said something else for as long: it does not flap.
    pub fn fault(&mut self, now: Stamp) -> Option<LineFault> {
        if let Some(trouble) = self.port {
            self.shown = Some(LineFault::Port(trouble));
            return self.shown;
        }
        if self.unwell_ms(now) <= LINE_LOST_MS {
            let steady = self.recovering_since.is_none_or(|at| now.since_ms(at) >= STEADY_MS);
            if steady {
                (self.shown, self.other_since) = (None, None);
            }
            return self.shown;
        }
        self.recovering_since = None;
        let found = self.diagnosis(now);
        let since = *self.other_since.get_or_insert(now);
        if self.shown.is_none() || self.shown == Some(found) || now.since_ms(since) >= STEADY_MS {
            (self.shown, self.other_since) = (Some(found), None);
        }
        self.shown
    }

    /// What the bytes of the last moments say.
    fn diagnosis(&self, now: Stamp) -> LineFault {
        let seen = |part: fn(&Evidence) -> u32| part(&self.window) + part(&self.before);
        let bytes = if now.since_ms(self.window_since) > 2 * WINDOW_MS { 0 } else { seen(|e| e.bytes) };
        // One of the board's frames proves it (CRC-32), and one that waits for its set-up sends only
        // ten a second; the gyro's check sum is weak, but there are a hundred.
        let (half_from, foreign_from) = match self.device {
            Device::Board => (bytes / 40, 2),
            Device::Gyro => (bytes / 20, 1),
        };
        if bytes == 0 {
            LineFault::Silent
        } else if seen(|e| e.repeated) > 1 {
            LineFault::Frozen
        } else if seen(|e| e.foreign) >= foreign_from || (bytes > 20 && seen(|e| e.text) > bytes * 19 / 20) {
            LineFault::WrongDevice
        } else if seen(|e| e.starts) > half_from.max(1) {
            LineFault::HalfFrames
        } else {
            LineFault::Garbage
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_control::AdcCount;
    use xtb_control::controller::{AdcSample, GyroSample};
    use xtb_control::vehicle::SLOTS;
    use xtb_protocol::board::FrameWriter;
    use xtb_protocol::gyro_3dmg::EulerFrame;

    fn hear(watch: &mut LineWatch, now: Stamp, bytes: &[u8]) {
        watch.came(now);
        watch.bytes(now, bytes);
    }

    /// What the watch says after a second of `chunk(i)` every 10 ms.
    fn fault_of(device: Device, mut chunk: impl FnMut(u64) -> Vec<u8>) -> Option<LineFault> {
        let mut watch = LineWatch::new(device, Stamp::ZERO);
        for i in 0..100 {
            let bytes = chunk(i);
            hear(&mut watch, Stamp::from_ms(10 * i), &bytes);
        }
        watch.fault(Stamp::from_ms(1000))
    }

    fn noise(i: u64) -> Vec<u8> {
        let mut x = i.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
        (0..20)
            .map(|_| {
                x ^= x << 13;
                x ^= x >> 7;
                x ^= x << 17;
                (x >> 24) as u8
            })
            .collect()
    }

    fn adc_frame(writer: &mut FrameWriter) -> Vec<u8> {
        let count = AdcCount::try_from(300.0).unwrap();
        let side = [count; SLOTS];
        let sample = AdcSample { ir_front: side, ir_rear: side, tilt: [count; 2], pistons: [count; 4] };
        writer.adc(&sample, None).as_bytes().to_vec()
    }

    #[test]
    fn noise_text_and_silence_have_their_names() {
        for device in [Device::Board, Device::Gyro] {
            assert_eq!(fault_of(device, noise), Some(LineFault::Garbage));
            assert_eq!(fault_of(device, |_| Vec::new()), Some(LineFault::Silent));
            let nmea = |_| b"$GPGGA,123519,4807.038,N\r\n".to_vec();
            assert_eq!(fault_of(device, nmea), Some(LineFault::WrongDevice));
        }
    }

    #[test]
    fn one_frame_again_and_again_is_frozen_and_not_half_a_frame() {
        let mut writer = FrameWriter::default();
        let frame = adc_frame(&mut writer);
        let mut watch = LineWatch::new(Device::Board, Stamp::ZERO);
        for ms in (0..=160).step_by(40) {
            hear(&mut watch, Stamp::from_ms(ms), &frame);
            watch.repeated_frame();
        }
        assert_eq!(watch.fault(Stamp::from_ms(160)), Some(LineFault::Frozen));
    }

    #[test]
    fn frames_cut_in_the_middle_are_half_frames() {
        let mut writer = FrameWriter::default();
        let half = |_| {
            let mut frame = writer.encoder(23).as_bytes().to_vec();
            frame.truncate(5);
            frame.extend(&adc_frame(&mut writer)[..23]);
            frame
        };
        assert_eq!(fault_of(Device::Board, half), Some(LineFault::HalfFrames));
        let angles = GyroSample { roll: 1, pitch: 2, yaw: 3 };
        let half = |i| EulerFrame { angles, ticks: i as u16 }.encode()[..6].to_vec();
        assert_eq!(fault_of(Device::Gyro, half), Some(LineFault::HalfFrames));
    }

    #[test]
    fn a_port_that_is_not_open_is_a_fault_at_once_and_reopening_is_noticed() {
        let mut watch = LineWatch::new(Device::Board, Stamp::ZERO);
        watch.port(Stamp::from_ms(5), Some(PortTrouble::Busy));
        assert_eq!(watch.fault(Stamp::from_ms(5)), Some(LineFault::Port(PortTrouble::Busy)));
        assert!(watch.port(Stamp::from_ms(900), None));
        assert_eq!(watch.fault(Stamp::from_ms(901)), None, "it gets its time to speak");
        assert_eq!(watch.fault(Stamp::from_ms(1051)), Some(LineFault::Silent));
    }

    #[test]
    fn a_line_that_is_opened_late_gets_its_time_too() {
        let mut watch = LineWatch::new(Device::Board, Stamp::ZERO);
        assert!(watch.port(Stamp::from_ms(5000), None));
        assert!(!watch.port(Stamp::from_ms(5005), None));
        assert_eq!(watch.fault(Stamp::from_ms(5150)), None);
        assert_eq!(watch.fault(Stamp::from_ms(5151)), Some(LineFault::Silent));
    }

    #[test]
    fn one_frame_of_a_waiting_board_tells_that_the_gyros_line_has_the_wrong_device() {
        let mut watch = LineWatch::new(Device::Gyro, Stamp::ZERO);
        hear(&mut watch, Stamp::from_ms(110), &[7; 16]);
        watch.foreign_frame();
        assert_eq!(watch.fault(Stamp::from_ms(151)), Some(LineFault::WrongDevice));
    }

    #[test]
    fn steady_good_frames_end_every_fault() {
        let mut watch = LineWatch::new(Device::Gyro, Stamp::ZERO);
        hear(&mut watch, Stamp::from_ms(400), &noise(1));
        assert_eq!(watch.fault(Stamp::from_ms(400)), Some(LineFault::Garbage));
        for ms in (401..=700).step_by(10) {
            watch.good_frame(Stamp::from_ms(ms));
            assert_eq!(watch.fault(Stamp::from_ms(ms)), Some(LineFault::Garbage));
        }
        watch.good_frame(Stamp::from_ms(702));
        assert_eq!(watch.fault(Stamp::from_ms(702)), None);
    }

    #[test]
    fn a_good_frame_now_and_then_does_not_make_a_fault_come_and_go() {
        let mut watch = LineWatch::new(Device::Board, Stamp::ZERO);
        hear(&mut watch, Stamp::from_ms(200), &noise(1));
        assert_eq!(watch.fault(Stamp::from_ms(200)), Some(LineFault::Garbage));
        for i in 1..50 {
            hear(&mut watch, Stamp::from_ms(200 + 40 * i), &noise(i));
            if i.is_multiple_of(4) {
                watch.good_frame(Stamp::from_ms(200 + 40 * i));
            }
            assert_eq!(watch.fault(Stamp::from_ms(200 + 40 * i)), Some(LineFault::Garbage), "{i}");
        }
    }
}
