//! The board as an agent sees it.

use super::*;
use xtb_control::VehicleConfig;
use xtb_control::tpu::ResetMask;
use xtb_protocol::board::FromBoard;

struct Bench {
    board: Board,
    writer: FrameWriter,
    noise: Rng,
}

impl Bench {
    fn waiting() -> Self {
        let mut noise = Rng::new(1, 1);
        let board = Board::new(&TruckParameters::default(), &mut noise);
        Self { board, writer: FrameWriter::default(), noise }
    }

    /// Set up, and fed once with a neutral motor.
    fn ready() -> Self {
        let mut bench = Self::waiting();
        bench.set_up(&setup(), 0);
        bench.pwm(&bench.neutral(), 0);
        bench
    }

    fn neutral(&self) -> PwmOutputs {
        PwmOutputs { motor: PwmCount::NEUTRAL, ..*self.board.outputs() }
    }

    fn set_up(&mut self, setup: &TpuSetup, ms: u64) {
        let frame = self.writer.setup(setup);
        self.rx(frame.as_bytes(), ms);
    }

    fn pwm(&mut self, pwm: &PwmOutputs, ms: u64) {
        let frame = self.writer.pwm(pwm);
        self.rx(frame.as_bytes(), ms);
    }

    fn rx(&mut self, bytes: &[u8], ms: u64) {
        self.board.rx(bytes, Stamp::from_ms(ms), &mut self.noise);
    }

    /// Runs without motion and returns what was sent.
    fn run(&mut self, from_ms: u64, to_ms: u64) -> Vec<FromBoard> {
        for ms in (from_ms..to_ms).step_by(5) {
            let (start, end) = (Stamp::from_ms(ms), Stamp::from_ms(ms + 5));
            self.board.latch(start);
            self.board.count(&ShaftTravel { start, end, from_pulses: 0.0, to_pulses: 0.0 });
            self.board.report(end, &mut self.noise);
        }
        self.sent()
    }

    fn sent(&mut self) -> Vec<FromBoard> {
        let (mut bytes, mut frames) = (Vec::new(), Vec::new());
        self.board.outbox().take(&mut bytes);
        FrameReader::default().from_board(&bytes, |frame| frames.push(frame.unwrap()));
        frames
    }

    fn driving(&self) -> PwmOutputs {
        let lift = [PwmCount::MAX; 4];
        let motor = PwmCount::saturating(4000.0);
        PwmOutputs { motor, steer_front: PwmCount::MIN, pistons: lift, ..*self.board.outputs() }
    }
}

fn setup() -> TpuSetup {
    TpuSetup::of(&VehicleConfig::default()).unwrap()
}

fn statuses(frames: &[FromBoard]) -> Vec<BoardStatus> {
    let status = |frame: &FromBoard| match frame {
        FromBoard::Status(status) => Some(*status),
        _ => None,
    };
    frames.iter().filter_map(status).collect()
}

#[test]
fn until_it_is_set_up_it_sends_only_its_status_and_ignores_pulses() {
    let mut bench = Bench::waiting();
    let (driving, at_rest) = (bench.driving(), *bench.board.outputs());
    bench.pwm(&driving, 0);
    let frames = bench.run(0, 1000);
    assert_eq!(frames.len(), 10);
    assert!(statuses(&frames).iter().all(|s| !s.ready && s.watchdog && s.setup_checksum == 0));
    assert_eq!(statuses(&frames).len(), 10);
    assert_eq!(*bench.board.outputs(), at_rest);
    assert!(!bench.board.scan_due(Stamp::from_ms(1000)));
    bench.set_up(&setup(), 1000);
    bench.run(1000, 1200);
    assert_eq!(*bench.board.outputs(), at_rest, "the pulses from before do not count");
}

#[test]
fn a_set_up_is_answered_at_once_and_everything_begins_to_flow() {
    let mut bench = Bench::waiting();
    bench.set_up(&setup(), 0);
    let answer = statuses(&bench.sent());
    assert_eq!((answer.len(), answer[0].ready), (1, true));
    assert_eq!(answer[0].setup_checksum, setup().checksum());
    let frames = bench.run(0, 1000);
    let count = |wanted: fn(&FromBoard) -> bool| frames.iter().filter(|frame| wanted(frame)).count();
    assert_eq!(count(|frame| matches!(frame, FromBoard::Status(_))), 10);
    assert!((44..=46).contains(&count(|frame| matches!(frame, FromBoard::Remote(_)))), "22.2 ms");
    assert!((19..=20).contains(&count(|frame| matches!(frame, FromBoard::Encoder { .. }))), "52.4 ms");
}

#[test]
fn the_same_set_up_again_changes_nothing_and_another_one_is_taken() {
    let mut bench = Bench::ready();
    let driving = bench.driving();
    bench.pwm(&driving, 0);
    bench.run(0, 50);
    let mut same = bench.board.clone();
    bench.set_up(&setup(), 50);
    assert_eq!(statuses(&bench.sent()).len(), 1);
    assert_eq!(bench.board.outputs().motor, driving.motor);
    bench.run(50, 60);
    same.latch(Stamp::from_ms(60));
    assert_eq!(bench.board.outputs(), same.outputs());
    let slower = TpuSetup { watchdog_ms: 500, ..setup() };
    bench.set_up(&slower, 60);
    assert_eq!(statuses(&bench.sent())[0].setup_checksum, slower.checksum());
    bench.pwm(&driving, 60);
    bench.run(60, 500);
    assert_eq!(bench.board.outputs().motor, driving.motor, "the watchdog is the set-up's");
    bench.run(500, 600);
    assert_eq!(bench.board.outputs().motor, PwmCount::NEUTRAL);
}

#[test]
fn an_impossible_set_up_is_refused_and_counted() {
    for impossible in [
        TpuSetup { pwm_period_counts: 0, ..setup() },
        TpuSetup { tcr_prescaler: 0, ..setup() },
        TpuSetup { fqm_window: 1, ..setup() },
        TpuSetup { watchdog_ms: 0, ..setup() },
        TpuSetup { channels: [0xFF; 14], ..setup() },
    ] {
        let mut bench = Bench::waiting();
        bench.set_up(&impossible, 0);
        let answer = statuses(&bench.sent())[0];
        assert_eq!((answer.ready, answer.rejected), (false, 1), "{impossible:?}");
    }
}

#[test]
fn a_power_cycle_ends_everything_until_the_next_set_up() {
    let mut bench = Bench::ready();
    let (at_rest, driving) = (*bench.board.outputs(), bench.driving());
    bench.pwm(&driving, 0);
    bench.run(0, 50);
    assert_eq!(*bench.board.outputs(), driving);
    bench.board.power_cycle(Stamp::from_ms(50));
    assert_eq!(*bench.board.outputs(), at_rest);
    assert_eq!(bench.board.neutral_since(), Some(Stamp::from_ms(50)));
    bench.pwm(&driving, 50);
    let frames = bench.run(50, 300);
    assert_eq!(frames.len(), statuses(&frames).len());
    assert!(statuses(&frames).iter().all(|status| !status.ready));
    bench.set_up(&setup(), 300);
    bench.pwm(&bench.neutral(), 300);
    bench.pwm(&driving, 300);
    bench.run(300, 350);
    assert_eq!(*bench.board.outputs(), driving);
}

#[test]
fn a_reset_frame_frees_a_channel_and_a_truck_without_receiver_sends_no_remote_frames() {
    let mut truth = TruckParameters::default();
    truth.receiver.glitch_every_s = 0.1;
    let mut bench = Bench::ready();
    bench.board = Board::new(&truth, &mut bench.noise);
    bench.set_up(&setup(), 0);
    let stuck = |frames: &[FromBoard]| match frames.iter().rfind(|f| matches!(f, FromBoard::Remote(_))) {
        Some(FromBoard::Remote(sample)) => sample.speed.is_some_and(|ticks| ticks > 20_000),
        _ => false,
    };
    assert!(stuck(&bench.run(0, 2000)));
    let mut freed = false;
    for i in 0..5 {
        let frame = bench.writer.reset(ResetMask { speed: true, ..ResetMask::default() });
        bench.rx(frame.as_bytes(), 2000 + 30 * i);
        freed |= !stuck(&bench.run(2000 + 30 * i, 2030 + 30 * i));
    }
    assert!(freed);
    truth.receiver.fitted = false;
    bench.board = Board::new(&truth, &mut bench.noise);
    bench.set_up(&setup(), 0);
    let frames = bench.run(0, 1000);
    assert!(!frames.is_empty() && !frames.iter().any(|f| matches!(f, FromBoard::Remote(_))));
}

#[test]
fn pulses_take_effect_when_a_period_ends() {
    let mut bench = Bench::ready();
    bench.board.latch(Stamp::from_ms(50));
    let pwm = bench.driving();
    bench.pwm(&pwm, 50);
    assert_eq!(bench.board.outputs().motor, PwmCount::NEUTRAL);
    bench.board.latch(Stamp::from_ms(73));
    assert_eq!(*bench.board.outputs(), pwm);
    assert_eq!(bench.board.neutral_since(), None);
}

#[test]
fn the_watchdog_goes_neutral_100_ms_after_the_last_good_frame_and_keeps_the_steering() {
    let mut bench = Bench::ready();
    let pwm = bench.driving();
    bench.pwm(&pwm, 50);
    let mut broken = FrameWriter::default().pwm(&pwm).as_bytes().to_vec();
    broken[4] ^= 0x40;
    let mut neutral_at = None;
    for ms in (55..400).step_by(5) {
        bench.rx(&broken, ms);
        bench.board.latch(Stamp::from_ms(ms));
        if ms >= 75 && bench.board.outputs().motor == PwmCount::NEUTRAL {
            neutral_at.get_or_insert(ms);
        }
    }
    let neutral_at = neutral_at.unwrap();
    assert!((150..=180).contains(&neutral_at), "{neutral_at} ms");
    assert_eq!(bench.board.outputs().steer_front, PwmCount::MIN);
    assert_eq!(bench.board.outputs().pistons, [PwmCount::NEUTRAL; 4]);
    assert!(bench.board.counters().rejected > 50);
    let since = bench.board.neutral_since().unwrap();
    assert!(since <= Stamp::from_ms(neutral_at) && since >= Stamp::from_ms(150));
}

#[test]
fn a_starved_board_hears_only_a_neutral_frame() {
    let mut bench = Bench::ready();
    let (pwm, neutral) = (bench.driving(), bench.neutral());
    bench.pwm(&pwm, 20);
    bench.run(20, 50);
    assert_eq!(bench.board.outputs().motor, pwm.motor);
    // What a dead process left on the way comes when the watchdog's time is over: before the period
    // that stops the motor ends, and after.
    for ms in [125, 150, 200, 300, 400] {
        bench.pwm(&pwm, ms);
        bench.run(ms, ms + 25);
        assert_eq!(bench.board.outputs().motor, PwmCount::NEUTRAL, "{ms} ms");
        assert_eq!(bench.board.outputs().pistons, [PwmCount::NEUTRAL; 4], "{ms} ms");
    }
    bench.pwm(&neutral, 450);
    bench.pwm(&pwm, 455);
    bench.run(455, 480);
    assert_eq!(bench.board.outputs().motor, pwm.motor, "neutral once, and it drives again");
}

#[test]
fn after_a_set_up_the_first_frame_has_to_be_neutral() {
    let mut bench = Bench::waiting();
    bench.set_up(&setup(), 0);
    let pwm = bench.driving();
    bench.pwm(&pwm, 0);
    bench.run(0, 50);
    assert_eq!(bench.board.outputs().motor, PwmCount::NEUTRAL);
    bench.pwm(&bench.neutral(), 50);
    bench.pwm(&pwm, 50);
    bench.run(50, 75);
    assert_eq!(bench.board.outputs().motor, pwm.motor);
}

#[test]
fn windows_carry_the_fraction_of_a_pulse() {
    let mut bench = Bench::ready();
    bench.sent();
    let step = |i: u64| ShaftTravel {
        start: Stamp::from_ms(5 * i),
        end: Stamp::from_ms(5 * (i + 1)),
        from_pulses: 2.21 * i as f64,
        to_pulses: 2.21 * (i + 1) as f64,
    };
    (0..2000).for_each(|i| bench.board.count(&step(i)));
    let pulses = |frame: &FromBoard| match frame {
        FromBoard::Encoder { pulses } => f64::from(*pulses),
        _ => panic!("nothing else was sent"),
    };
    let windows: Vec<f64> = bench.sent().iter().map(pulses).collect();
    assert!((190..=191).contains(&windows.len()), "{}", windows.len());
    // 442 pulses/s are 23.17 a window; the first one is cut short by the board's own start.
    assert!(windows[1..].iter().all(|p| (23.0..=24.0).contains(p)), "{windows:?}");
    let mean = windows[1..].iter().sum::<f64>() / (windows.len() - 1) as f64;
    assert!((mean - 23.173).abs() < 0.01, "{mean}");
}
