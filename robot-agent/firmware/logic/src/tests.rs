//! The board as its agent sees it: bytes in, frames and pulses out, with a clock that the test sets.

extern crate std;

use crate::*;
use std::vec;
use std::vec::Vec;
use xtb_board_codec::{
    Frame, NEUTRAL, NO_PULSE, NOT_FITTED, OUTPUTS, Reader, Setup, Writer, ask, flags, kind, words,
};

const IDENTITY: Identity =
    Identity { version: 0x0102, hash: 0x89AB_CDEF, hardware: Hardware::Pico, after_hang: true };
const SETUP: Setup = Setup {
    pwm_period_counts: 55_500,
    tcr_prescaler: 64,
    fqm_window: 0x8000,
    watchdog_ms: 100,
    channels: WIRING,
};
const DRIVE: [u16; OUTPUTS] = [4000, 3600, 4300, 3000, 5000, 3800, 3801, 3802, 3803, 2500];

/// A frame of the board.
#[derive(Debug, Clone, PartialEq)]
struct Said {
    at: Ticks,
    kind: u8,
    numbers: Vec<u16>,
}

/// A board on a bench, with a clock, an agent's pen, and what it has said and done.
struct Bench {
    board: Board,
    now: Ticks,
    wrap: Ticks,
    inputs: Inputs,
    /// Codes of the first multiplexer's sixteen channels, and of the second one's.
    codes: [[u16; 16]; 2],
    selected: u8,
    agent: Writer,
    reader: Reader,
    said: Vec<Said>,
    pulses: Vec<(Ticks, [u16; OUTPUTS])>,
}

impl Bench {
    fn new() -> Self {
        let inputs = Inputs { receiver: true, ..Inputs::default() };
        Self {
            board: Board::new(IDENTITY, Ticks::default()),
            now: Ticks::default(),
            wrap: Ticks::from_us(22_200),
            inputs,
            codes: [[0; 16]; 2],
            selected: 0,
            agent: Writer::default(),
            reader: Reader::default(),
            said: Vec::new(),
            pulses: Vec::new(),
        }
    }

    fn set_up() -> Self {
        let mut bench = Self::new();
        bench.tell_setup(&SETUP);
        bench
    }

    fn tell(&mut self, kind: u8, numbers: &[u16]) {
        let frame = self.agent.frame(kind, numbers.iter().copied());
        self.board.receive(frame.as_bytes(), self.now);
    }

    fn tell_setup(&mut self, setup: &Setup) {
        let bytes = setup.to_bytes();
        let numbers: Vec<u16> =
            bytes.chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]])).collect();
        self.tell(kind::SETUP, &numbers);
    }

    fn pwm(&mut self, motor: u16) {
        let mut pulses = DRIVE;
        pulses[0] = motor;
        self.tell(kind::PWM, &pulses);
    }

    /// Lets time pass in turns of 250 µs, as the firmware's main loop does.
    fn run_us(&mut self, us: u64) {
        let end = self.now.plus(Ticks::from_us(us));
        while self.now < end {
            self.now = self.now.plus(Ticks::from_us(250)).min(end);
            self.turn();
        }
    }

    fn turn(&mut self) {
        if self.now.plus(Ticks::from_us(200)) >= self.wrap {
            let latch = self.board.latch(self.wrap);
            self.pulses.push((self.wrap, latch.pulses));
            let period = u64::from(latch.period_counts) * u64::from(TICKS_A_COUNT);
            self.wrap = self.wrap.plus(Ticks::new(period));
        }
        self.board.turn(self.inputs, self.now);
        if let Some(visit) = self.board.visit(self.now) {
            assert_eq!(visit.channel, self.selected, "the channel has had its time to settle");
            let sum =
                |mux: usize, n: u8| u32::from(self.codes[mux][usize::from(self.selected)]) * u32::from(n);
            self.board.converted(sum(0, visit.first), sum(1, visit.second), self.now);
        }
        self.selected = self.board.selected();
        while let Some(frame) = self.board.transmit() {
            let (said, at) = (&mut self.said, self.now);
            self.reader.read(frame.as_bytes(), |content| {
                let content = content.unwrap();
                let numbers =
                    content.payload().chunks_exact(2).map(|pair| u16::from_le_bytes([pair[0], pair[1]]));
                said.push(Said { at, kind: content.kind, numbers: numbers.collect() });
            });
        }
        assert_eq!(self.reader.losses(), xtb_board_codec::Losses::default());
    }

    fn all(&self, kind: u8) -> Vec<&Said> {
        self.said.iter().filter(|said| said.kind == kind).collect()
    }

    fn status(&self) -> &[u16] {
        &self.all(kind::STATUS).last().unwrap().numbers
    }

    fn pins(&self) -> [u16; OUTPUTS] {
        self.pulses.last().unwrap().1
    }

    /// Lets the truck drive: set up, neutral, then a frame with this motor each 20 ms.
    fn driving(motor: u16) -> Self {
        let mut bench = Self::set_up();
        bench.pwm(NEUTRAL);
        bench.run_us(20_000);
        for _ in 0..5 {
            bench.pwm(motor);
            bench.run_us(20_000);
        }
        assert_eq!(bench.pins()[0], motor);
        bench
    }
}

fn held(pulses: [u16; OUTPUTS]) -> bool {
    pulses[0] == NEUTRAL && pulses[5..9].iter().all(|pulse| *pulse == NEUTRAL)
}

#[test]
fn before_the_set_up_there_is_a_status_each_100_ms_and_nothing_else() {
    let mut bench = Bench::new();
    for _ in 0..50 {
        bench.pwm(4000);
        bench.run_us(20_000);
    }
    assert!(bench.said.iter().all(|said| said.kind == kind::STATUS));
    assert_eq!(bench.said.len(), 10);
    assert_eq!(bench.status(), [0x0102, flags::WATCHDOG, 0, 0]);
    assert!(bench.pulses.iter().all(|(_, pulses)| *pulses == AT_REST));
}

#[test]
fn a_set_up_is_answered_in_the_next_turn_and_everything_begins() {
    let mut bench = Bench::new();
    bench.run_us(30_000);
    assert!(bench.said.is_empty());
    bench.tell_setup(&SETUP);
    bench.run_us(250);
    assert_eq!(bench.status(), [0x0102, flags::READY | flags::WATCHDOG, 0x0156, 0]);
    bench.run_us(1_000_000);
    let count = |kind| bench.all(kind).len();
    assert_eq!((count(kind::ENCODER), count(kind::REMOTE), count(kind::ADC)), (19, 45, 26));
    bench.tell_setup(&SETUP);
    bench.run_us(250);
    assert_eq!(bench.status()[2..], [0x0156, 0], "the same: nothing but an answer");
}

#[test]
fn what_the_board_cannot_carry_out_is_refused_counted_and_answered() {
    let mut bench = Bench::set_up();
    let with = |change: fn(&mut Setup)| {
        let mut setup = SETUP;
        change(&mut setup);
        setup
    };
    let impossible = [
        with(|setup| setup.pwm_period_counts = 12_499),
        with(|setup| setup.tcr_prescaler = 0),
        with(|setup| setup.fqm_window = 3124),
        with(|setup| setup.watchdog_ms = 0),
        with(|setup| setup.channels.swap(1, 2)),
        with(|setup| setup.channels[13] = 0x30),
    ];
    for (i, setup) in impossible.iter().enumerate() {
        bench.tell_setup(setup);
        bench.run_us(250);
        assert_eq!(bench.status()[1] & flags::READY, flags::READY);
        assert_eq!(bench.status()[2..], [0x0156, i as u16 + 1]);
    }
    let possible = with(|setup| (setup.pwm_period_counts, setup.fqm_window) = (12_500, 3125));
    bench.tell_setup(&possible);
    bench.run_us(250);
    assert_eq!(bench.status()[2], possible.checksum());
    bench.run_us(30_000);
    let (last, before) = (bench.pulses[bench.pulses.len() - 1].0, bench.pulses[bench.pulses.len() - 2].0);
    assert_eq!(last.since(before), Ticks::from_ms(5), "the new period");
}

#[test]
fn pulses_change_together_at_the_next_wrap() {
    let mut bench = Bench::driving(4000);
    let next = bench.wrap;
    bench.run_us(1000);
    bench.tell(kind::PWM, &[4100, 3100, 3200, 3300, 3400, 3500, 3600, 3700, 3800, 3900]);
    bench.run_us(22_200);
    let latched = bench.pulses.iter().find(|(wrap, _)| *wrap >= next).unwrap();
    assert_eq!(latched.1, [4100, 3100, 3200, 3300, 3400, 3500, 3600, 3700, 3800, 3900]);
}

#[test]
fn a_frame_with_one_pulse_out_of_range_is_refused_as_a_whole() {
    let mut bench = Bench::driving(4000);
    let before = bench.pins();
    for place in 0..OUTPUTS {
        for bad in [0, 2330, 5273, u16::MAX] {
            let mut pulses = [3751; OUTPUTS];
            pulses[place] = bad;
            bench.tell(kind::PWM, &pulses);
        }
    }
    bench.run_us(23_000);
    assert_eq!(bench.pins(), before);
    bench.run_us(100_000);
    assert_eq!(bench.status()[3], 40);
}

#[test]
fn the_watchdog_holds_motor_and_pistons_and_leaves_the_steering() {
    for phase in 0..100 {
        let mut bench = Bench::driving(4000);
        bench.run_us(phase * 222);
        bench.pwm(4000);
        let heard = bench.now;
        bench.run_us(130_000);
        let (wrap, pulses) = *bench.pulses.iter().find(|(_, pulses)| held(*pulses)).unwrap();
        let after = wrap.since(heard);
        assert!(after >= Ticks::from_ms(100) && after < Ticks::from_us(122_200), "{} µs", after.as_us());
        let mut expected = DRIVE;
        expected[0] = NEUTRAL;
        expected[5..9].fill(NEUTRAL);
        assert_eq!(pulses, expected);
        assert!(bench.pulses.iter().any(|(at, pulses)| *at < wrap && pulses[0] == 4000));
        assert_eq!(bench.status()[1], flags::READY | flags::WATCHDOG);
    }
}

#[test]
fn only_a_neutral_frame_ends_the_watchdog() {
    let mut bench = Bench::driving(4000);
    bench.run_us(130_000);
    assert!(held(bench.pins()));
    for _ in 0..20 {
        bench.pwm(4000);
        bench.tell_setup(&SETUP);
        bench.tell(kind::RESET, &[7]);
        bench.run_us(20_000);
        assert!(held(bench.pins()));
    }
    bench.pwm(NEUTRAL);
    bench.run_us(23_000);
    assert!(!held(bench.pins()), "pistons move again");
    let status = bench.all(kind::STATUS);
    assert_eq!(status.last().unwrap().numbers[1], flags::READY);
    bench.pwm(4000);
    bench.run_us(23_000);
    assert_eq!(bench.pins()[0], 4000);
}

#[test]
fn neither_set_up_nor_reset_nor_question_feeds_the_watchdog() {
    let mut bench = Bench::driving(4000);
    for _ in 0..8 {
        bench.tell_setup(&SETUP);
        bench.tell(kind::RESET, &[1]);
        bench.tell(kind::ASK, &[0]);
        bench.run_us(20_000);
    }
    assert!(held(bench.pins()));
    assert_eq!((bench.pins()[1], bench.status()[1]), (DRIVE[1], flags::READY | flags::WATCHDOG));
}

#[test]
fn the_status_tells_at_once_when_the_watchdog_begins_and_ends() {
    let mut bench = Bench::driving(4000);
    let before = bench.said.len();
    bench.run_us(130_000);
    let begun: Vec<_> = bench.said[before..]
        .iter()
        .filter(|said| said.kind == kind::STATUS && said.numbers[1] & flags::WATCHDOG != 0)
        .collect();
    let wrap = bench.pulses.iter().find(|(_, pulses)| held(*pulses)).unwrap().0;
    assert!(begun[0].at.as_us().abs_diff(wrap.as_us()) <= 500, "{begun:?}");
}

#[test]
fn the_emergency_stop_is_said_and_holds_until_it_is_released_and_a_neutral_frame_comes() {
    let mut bench = Bench::driving(4000);
    bench.inputs.stop = true;
    bench.run_us(250);
    assert_eq!(bench.status()[1], flags::READY | flags::WATCHDOG | flags::EMERGENCY_STOP);
    for _ in 0..10 {
        bench.pwm(NEUTRAL);
        bench.run_us(20_000);
        bench.pwm(4000);
        bench.run_us(20_000);
    }
    assert!(held(bench.pins()));
    bench.inputs.stop = false;
    for _ in 0..10 {
        bench.pwm(4000);
        bench.run_us(20_000);
        assert!(held(bench.pins()));
    }
    assert_eq!(bench.status()[1], flags::READY | flags::WATCHDOG);
    bench.pwm(NEUTRAL);
    bench.run_us(20_000);
    bench.pwm(4000);
    bench.run_us(23_000);
    assert_eq!(bench.pins()[0], 4000);
}

#[test]
fn no_edge_is_lost_over_windows_and_wraps_of_the_counter() {
    let mut bench = Bench::set_up();
    let (mut edges, mut rate) = (0_u64, 7_u64);
    for _ in 0..1000 {
        rate = (rate * 31 + 17) % 163; // pulses in a step of 13 ms: up to 12.5 kHz
        edges += rate;
        bench.inputs.encoder = edges as u16;
        bench.run_us(13_000);
    }
    bench.run_us(60_000);
    let told: u64 = bench.all(kind::ENCODER).iter().map(|said| u64::from(said.numbers[0])).sum();
    assert_eq!(told, edges);
    let windows = bench.all(kind::ENCODER);
    let last = windows.len() - 1;
    let mean_us = windows[last].at.since(windows[0].at).as_us() / last as u64;
    assert!(mean_us.abs_diff(52_429) <= 2, "{mean_us}");
}

#[test]
fn a_shaft_at_its_limit_loses_nothing_and_a_wild_encoder_is_cut_off() {
    let mut bench = Bench::set_up();
    for pulses in [661_u64, 661, 658] {
        bench.inputs.encoder += pulses as u16;
        bench.run_us(52_450);
    }
    let told: Vec<u16> = bench.all(kind::ENCODER).iter().map(|said| said.numbers[0]).collect();
    assert_eq!(told, [660, 660, 660]);
    bench.inputs.encoder = bench.inputs.encoder.wrapping_add(20_000);
    bench.run_us(52_450 * 3);
    let told: Vec<u16> = bench.all(kind::ENCODER).iter().map(|said| said.numbers[0]).collect();
    assert_eq!(told[3..], [660, 66, 0]);
}

#[test]
fn the_receivers_pulses_are_told_in_time_counts() {
    let mut bench = Bench::set_up();
    let counts = [2500_u16, 3750, 5000]; // 1.0, 1.5, 2.0 ms
    let mut high = [0_u16; 3];
    for _ in 0..20 {
        for (total, counts) in high.iter_mut().zip(counts) {
            *total = total.wrapping_add(counts);
        }
        let gate = |high: u16, is_high: bool| Gate { counts: high, high: is_high };
        bench.inputs.gates = high.map(|high| gate(high.wrapping_sub(1000), true));
        bench.run_us(500);
        bench.inputs.gates = high.map(|high| gate(high, false));
        bench.run_us(21_700);
    }
    assert_eq!(bench.all(kind::REMOTE).last().unwrap().numbers, [625, 938, 1250]);
    bench.run_us(60_000);
    assert_eq!(bench.all(kind::REMOTE).last().unwrap().numbers, [NO_PULSE; 3], "the transmitter is off");
}

#[test]
fn a_pin_that_stays_high_reads_as_long_as_can_be_until_it_falls_or_is_reset() {
    let mut bench = Bench::set_up();
    bench.inputs.gates[0].high = true;
    bench.run_us(60_000);
    let last = |bench: &Bench| bench.all(kind::REMOTE).last().unwrap().numbers.clone();
    assert_eq!(last(&bench), [NO_PULSE - 1, NO_PULSE, NO_PULSE]);
    bench.inputs.gates[0] = Gate { counts: 33_000, high: false };
    bench.run_us(23_000);
    assert_eq!(last(&bench), [NO_PULSE; 3], "that was no pulse");
    bench.inputs.gates[1] = Gate { counts: 3750, high: false };
    bench.tell(kind::RESET, &[2]);
    bench.run_us(23_000);
    assert_eq!(last(&bench), [NO_PULSE; 3], "a channel that starts again has not seen its pulse begin");
}

#[test]
fn without_a_receiver_there_are_no_frames_of_it() {
    let mut bench = Bench::set_up();
    bench.inputs.receiver = false;
    bench.run_us(200_000);
    assert!(bench.all(kind::REMOTE).is_empty());
}

#[test]
fn a_scan_has_nineteen_numbers_in_their_places() {
    let mut bench = Bench::set_up();
    for channel in 0..16 {
        bench.codes[0][channel] = 200 * channel as u16 + 100;
        bench.codes[1][channel] = 4095 - 3 * channel as u16;
    }
    bench.run_us(80_000);
    let numbers = &bench.all(kind::ADC).last().unwrap().numbers;
    for (channel, number) in numbers[..12].iter().enumerate() {
        let volts = f64::from(bench.codes[0][channel]) * 3.3 / 4096.0;
        assert!((f64::from(*number) - volts / 5.0 * 1024.0).abs() <= 0.51, "{channel}: {number}");
    }
    let sum = |codes: u16| codes * 16;
    assert_eq!(numbers[12..14], [sum(2500), sum(2700)]);
    assert_eq!(numbers[14..18], [sum(4059), sum(4056), sum(4053), sum(4050)]);
    assert_eq!(numbers[18], 9346, "2900 of 4096 of 13.2 V");
    bench.codes[0][14] = 300;
    bench.codes[0][12] = 4095;
    bench.run_us(80_000);
    let numbers = &bench.all(kind::ADC).last().unwrap().numbers;
    assert_eq!((numbers[12], numbers[18]), (65_472, NOT_FITTED));
    let scans = bench.all(kind::ADC);
    let mean_us = scans[scans.len() - 1].at.since(scans[0].at).as_us() / (scans.len() as u64 - 1);
    assert!(mean_us.abs_diff(38_000) < 300, "{mean_us}");
}

#[test]
fn a_wide_scan_has_the_range_finders_of_the_second_multiplexer_if_it_was_asked_for() {
    let mut bench = Bench::set_up();
    for channel in 0..16 {
        bench.codes[0][channel] = 200 * channel as u16 + 100;
        bench.codes[1][channel] = 900 + 150 * channel as u16;
    }
    bench.run_us(80_000);
    assert!(bench.all(kind::WIDE_ADC).is_empty(), "an agent that does not know them never asks");
    let usual = bench.all(kind::ADC).last().unwrap().numbers.clone();
    bench.tell(kind::ASK, &[ask::WIDE_SCAN]);
    let before = bench.all(kind::ADC).len();
    bench.run_us(80_000);
    assert_eq!(bench.all(kind::ADC).len(), before, "in place of the usual ones");
    let numbers = &bench.all(kind::WIDE_ADC).last().unwrap().numbers;
    assert_eq!((numbers.len(), &numbers[..19]), (23, &usual[..]));
    for (channel, number) in numbers[19..].iter().enumerate() {
        let volts = f64::from(bench.codes[1][channel]) * 3.3 / 4096.0;
        assert!((f64::from(*number) - volts / 5.0 * 1024.0).abs() <= 0.51, "{channel}: {number}");
    }
    bench.tell(kind::ASK, &[ask::IDENTITY]);
    bench.run_us(80_000);
    assert!(bench.all(kind::ADC).len() > before, "each ask says anew what is wanted");
}

#[test]
fn a_sum_is_the_mean_of_its_scan_and_no_moment_of_it() {
    let mut bench = Bench::set_up();
    let scan_ended = |bench: &mut Bench| {
        let scans = bench.all(kind::ADC).len();
        while bench.all(kind::ADC).len() == scans {
            bench.run_us(250);
        }
    };
    scan_ended(&mut bench);
    for after_ms in [18, 24, 30] {
        bench.codes = [[1000; 16]; 2];
        bench.run_us(after_ms * 1000);
        bench.codes = [[3000; 16]; 2];
        scan_ended(&mut bench);
        let numbers = &bench.all(kind::ADC).last().unwrap().numbers;
        // Eight rounds in the last 27.6 ms, after the ranges.
        let left = (38.0 - after_ms as f64) / 27.6;
        for sum in &numbers[12..18] {
            let part = (f64::from(*sum) / 16.0 - 1000.0) / 2000.0;
            assert!((part - left).abs() < 0.15, "{part} of {left} after {after_ms} ms");
        }
    }
}

/// The example of the data sheet.
const RVC: [u8; 19] = [
    0xAA, 0xAA, 0xDE, 0x01, 0x00, 0x92, 0xFF, 0x25, 0x08, 0x8D, 0xFE, 0xEC, 0xFF, 0xD1, 0x03, 0x00, 0x00,
    0x00, 0xE7,
];

#[test]
fn the_inertial_units_frames_go_on_if_they_were_asked_for() {
    let mut bench = Bench::set_up();
    let feed = |bench: &mut Bench, bytes: &[u8]| bytes.iter().for_each(|byte| bench.board.receive_imu(*byte));
    feed(&mut bench, &RVC);
    bench.run_us(1000);
    assert!(bench.all(kind::IMU).is_empty(), "an agent that does not know them never asks");
    bench.tell(kind::ASK, &[ask::IMU]);
    let mut bad = RVC;
    bad[7] ^= 1;
    feed(&mut bench, &[&[7, 0xAA][..], &bad[..], &RVC[1..5], &RVC[..]].concat());
    bench.run_us(1000);
    let said = bench.all(kind::IMU);
    let signed: Vec<i16> = said[0].numbers[1..].iter().map(|number| *number as i16).collect();
    assert_eq!(said.len(), 1);
    assert_eq!(signed, [1, -110, 2085, -371, -20, 977]);
    assert_eq!(said[0].numbers[0] & 0xFF, 0xDE);
    assert!(said[0].numbers[0] >> 8 > 0, "bad frames are counted");
    bench.tell(kind::ASK, &[0]);
    feed(&mut bench, &RVC);
    bench.run_us(1000);
    assert_eq!(bench.all(kind::IMU).len(), 1);
}

#[test]
fn which_firmware_it_is_is_told_when_asked_also_before_the_set_up() {
    let mut bench = Bench::new();
    bench.tell(kind::ASK, &[ask::IDENTITY]);
    bench.run_us(1000);
    assert_eq!(bench.all(kind::IDENTITY)[0].numbers, [0x0102, 0xCDEF, 0x89AB, 0x0101, 0, 0]);
    bench.run_us(200_000);
    assert_eq!(bench.all(kind::IDENTITY).len(), 1);
}

#[test]
fn the_answer_to_a_set_up_is_the_next_frame_whatever_waits() {
    let mut bench = Bench::set_up();
    while bench.board.visit(bench.now).is_some() || bench.all(kind::ADC).is_empty() {
        bench.run_us(250);
    }
    bench.tell(kind::ASK, &[ask::IDENTITY | ask::IMU]);
    RVC.iter().for_each(|byte| bench.board.receive_imu(*byte));
    bench.tell_setup(&SETUP);
    let first = bench.board.transmit().map(|frame| kind_of(&frame));
    assert_eq!(first, Some(kind::STATUS));
}

fn kind_of(frame: &Frame) -> u8 {
    let mut kind = 0;
    Reader::default().read(frame.as_bytes(), |content| kind = content.unwrap().kind);
    kind
}

#[test]
fn a_regular_status_lets_a_frame_come_in_first_but_not_for_ever() {
    let mut bench = Bench::new();
    bench.run_us(99_000);
    bench.board.receive(&[5, 5, 5], bench.now);
    assert_eq!(bench.board.next_turn(bench.now).since(bench.now), Ticks::from_us(50));
    bench.run_us(4000);
    assert!(bench.said.is_empty());
    bench.run_us(4000);
    assert_eq!(bench.said.len(), 1);
}

#[test]
fn random_bytes_are_refused_and_the_next_good_frame_is_obeyed() {
    let mut bench = Bench::driving(4000);
    let (mut random, mut bytes) = (1_u64, vec![0_u8; 1_000_000]);
    for byte in &mut bytes {
        random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        *byte = (random >> 56) as u8;
    }
    for piece in bytes.chunks(233) {
        bench.board.receive(piece, bench.now);
        bench.now = bench.now.plus(Ticks::from_us(20_250));
        bench.turn();
        assert!(held(bench.pins()) || bench.pins()[0] == 4000);
    }
    bench.board.receive(&[0], bench.now);
    bench.pwm(NEUTRAL);
    bench.run_us(20_000);
    bench.pwm(3900);
    bench.run_us(23_000);
    assert_eq!(bench.pins()[0], 3900);
    bench.run_us(100_000);
    assert!(bench.status()[3] > 1000, "{}", bench.status()[3]);
}

#[test]
fn a_frame_with_a_wrong_check_sum_is_not_obeyed() {
    let mut bench = Bench::driving(4000);
    let before = bench.pins();
    let mut writer = Writer::default();
    for place in 2..24 {
        let frame = writer.frame(kind::PWM, [4000 + place; OUTPUTS]);
        let mut bytes = frame.as_bytes().to_vec();
        let place = usize::from(place);
        bytes[place] ^= if bytes[place] == 0x10 { 0x20 } else { 0x10 };
        bench.board.receive(&bytes, bench.now);
    }
    bench.run_us(23_000);
    assert_eq!(bench.pins(), before);
}

#[test]
fn unknown_types_and_wrong_lengths_are_refused() {
    let mut bench = Bench::set_up();
    bench.tell(0x10, &[3750; 9]);
    bench.tell(0x18, &[3750; 10]);
    bench.tell(0x19, &[]);
    bench.tell(0x1A, &[1, 1]);
    bench.tell(0x20, &[3750; 10]);
    bench.tell(kind::STATUS, &[0; 4]);
    bench.run_us(101_000);
    assert_eq!(bench.status()[3], 6);
    assert_eq!(words::<1>(&[1, 0]), Some([1]));
}

#[test]
fn the_led_blinks_slowly_waits_fast_and_is_steady_when_driving() {
    let changes = |bench: &Bench, at_ms: u64| bench.board.led(bench.now.plus(Ticks::from_ms(at_ms)));
    let count = |bench: &Bench| (0..1000).filter(|ms| changes(bench, *ms) != changes(bench, ms + 1)).count();
    assert_eq!(count(&Bench::new()), 2);
    assert_eq!(count(&Bench::set_up()), 10);
    assert!(count(&Bench::driving(4000)) == 0 && changes(&Bench::driving(4000), 0));
}
