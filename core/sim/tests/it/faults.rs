//! Broken lines: what arrives, and that it ends with the fault.

use crate::agent::{board_frames, set_up, steps};
use xtb_control::controller::AdcSample;
use xtb_control::vehicle::SLOTS;
use xtb_protocol::board::{BoardError, FrameReader, FrameWriter, FromBoard, LineCounters};
use xtb_protocol::gyro_3dmg::{EulerFrame, GyroFrame, GyroReader, START_CONTINUOUS};
use xtb_sim::{
    EncoderFault, GyroFault, InjectedLineFault, LineFaults, RangeFinderFault, SensorFaults, Simulation,
    TruckParameters, World,
};

/// A truck that is set up, its gyro started, one second under way.
fn running() -> Simulation {
    let mut simulation = Simulation::new(World::default(), &TruckParameters::default(), &["a"], 1).unwrap();
    set_up(&mut simulation, &mut FrameWriter::default());
    simulation.trucks_mut()[0].gyro_rx(&START_CONTINUOUS);
    second(&mut simulation);
    simulation
}

/// Bytes of one second on the board's and on the gyro's line.
fn second(simulation: &mut Simulation) -> (Vec<u8>, Vec<u8>) {
    let (mut board, mut gyro) = (Vec::new(), Vec::new());
    for _ in 0..steps(1.0) {
        simulation.step();
        simulation.trucks_mut()[0].take_board_tx(&mut board);
        simulation.trucks_mut()[0].take_gyro_tx(&mut gyro);
    }
    (board, gyro)
}

fn with_faults(board: InjectedLineFault, gyro: InjectedLineFault) -> (Vec<u8>, Vec<u8>) {
    let mut simulation = running();
    simulation.trucks_mut()[0].set_line_faults(LineFaults { board, gyro });
    second(&mut simulation)
}

fn read_board(bytes: &[u8]) -> (Vec<FromBoard>, LineCounters) {
    let (mut reader, mut frames) = (FrameReader::default(), Vec::new());
    reader.from_board(bytes, |frame| frames.extend(frame.ok()));
    (frames, reader.counters())
}

fn read_gyro(bytes: &[u8]) -> Vec<GyroFrame> {
    let mut frames = Vec::new();
    GyroReader::default().push(bytes, |frame| frames.push(frame));
    frames
}

#[test]
fn a_silent_line_is_silent_and_the_other_one_goes_on() {
    let (board, gyro) = with_faults(InjectedLineFault::Silent, InjectedLineFault::None);
    assert_eq!((board.len(), read_gyro(&gyro).len()), (0, 100));
    let (board, gyro) = with_faults(InjectedLineFault::None, InjectedLineFault::Silent);
    assert_eq!(gyro.len(), 0);
    assert!(read_board(&board).0.len() > 90);
}

#[test]
fn garbage_comes_at_the_same_rate_and_holds_no_frame() {
    let (good_board, good_gyro) = with_faults(InjectedLineFault::None, InjectedLineFault::None);
    let (board, gyro) = with_faults(InjectedLineFault::Garbage, InjectedLineFault::Garbage);
    let near = |garbage: usize, good: usize| garbage.abs_diff(good) < good / 10;
    assert!(near(board.len(), good_board.len()) && near(gyro.len(), good_gyro.len()));
    assert!(read_board(&board).0.is_empty() && read_gyro(&gyro).is_empty());
}

#[test]
fn of_half_frames_none_is_taken_and_the_boards_are_counted() {
    let (board, gyro) = with_faults(InjectedLineFault::HalfFrames, InjectedLineFault::HalfFrames);
    let (frames, counters) = read_board(&board);
    assert!(frames.is_empty() && counters.rejected > 90, "{counters:?}");
    assert!(!gyro.is_empty() && read_gyro(&gyro).is_empty());
}

#[test]
fn on_the_wrong_line_each_device_sends_what_it_sends() {
    let (board_line, gyro_line) = with_faults(InjectedLineFault::WrongDevice, InjectedLineFault::WrongDevice);
    assert_eq!(read_gyro(&board_line).len(), 100, "a gyro in continuous mode");
    assert!(read_board(&board_line).0.is_empty());
    let (frames, _) = read_board(&gyro_line);
    let waiting = |frame: &FromBoard| matches!(frame, FromBoard::Status(status) if !status.ready);
    assert!(frames.len() == 10 && frames.iter().all(waiting), "a board that waits: {frames:?}");
}

#[test]
fn a_lossy_line_loses_whole_frames_and_the_gap_can_be_counted() {
    let (board, gyro) = with_faults(InjectedLineFault::Lossy(0.3), InjectedLineFault::Lossy(0.3));
    let (frames, counters) = read_board(&board);
    assert!(frames.len() > 40 && counters.rejected == 0 && counters.lost > 10, "{counters:?}");
    assert!((50..90).contains(&read_gyro(&gyro).len()));
}

#[test]
fn a_frozen_device_repeats_itself() {
    let (board, gyro) = with_faults(InjectedLineFault::Frozen, InjectedLineFault::Frozen);
    let ((board, counters), gyro) = (read_board(&board), read_gyro(&gyro));
    assert!(board.len() == 1 && counters.repeated > 90 && counters.lost == 0, "{counters:?}");
    assert!(gyro.len() == 100 && gyro.iter().all(|frame| *frame == gyro[0]));
}

/// Scans, windows and gyro frames of one second with these faults of the sensors.
fn with_sensor_faults(
    simulation: &mut Simulation,
    faults: SensorFaults,
) -> (Vec<AdcSample>, Vec<u16>, Vec<EulerFrame>) {
    simulation.trucks_mut()[0].set_sensor_faults(faults);
    let (board, gyro) = second(simulation);
    let (mut scans, mut windows, mut angles) = (Vec::new(), Vec::new(), Vec::new());
    // Windows that cannot be are refused, and told of.
    FrameReader::default().from_board(&board, |frame| match frame {
        Ok(FromBoard::Adc { sample, .. }) => scans.push(sample),
        Ok(FromBoard::Encoder { pulses }) | Err(BoardError::Pulses(pulses)) => windows.push(pulses),
        _ => {}
    });
    for frame in read_gyro(&gyro) {
        if let GyroFrame::Euler(frame) = frame {
            angles.push(frame);
        }
    }
    (scans, windows, angles)
}

#[test]
fn every_broken_sensor_shows_what_it_should_and_is_whole_again() {
    let mut simulation = running();
    let mut faults = SensorFaults::range_finder(2, RangeFinderFault::BrokenWire);
    (faults.range_finders[3], faults.range_finders[SLOTS]) =
        (RangeFinderFault::Short, RangeFinderFault::Frozen);
    (faults.gyro, faults.encoder) = (GyroFault::AnglesFrozen, EncoderFault::Wild);
    let (scans, windows, angles) = with_sensor_faults(&mut simulation, faults);
    let all = |what: fn(&AdcSample, &AdcSample) -> bool| scans.iter().all(|scan| what(scan, &scans[0]));
    assert!(all(|scan, _| scan.ir_front[2].get() == 0.0 && scan.ir_front[3].get() == 1023.0));
    assert!(all(|scan, first| scan.ir_rear[0] == first.ir_rear[0]));
    assert!(!all(|scan, first| scan.ir_rear[1] == first.ir_rear[1]), "the others go on");
    assert!(windows.iter().any(|pulses| *pulses > 660));
    assert!(angles.iter().all(|frame| frame.angles == angles[0].angles));
    assert!(angles.windows(2).all(|pair| pair[0].ticks != pair[1].ticks), "its timer runs");
    let (scans, windows, angles) = with_sensor_faults(&mut simulation, SensorFaults::default());
    assert!(scans.iter().all(|scan| (40.0..100.0).contains(&scan.ir_front[2].get())), "nothing in sight");
    assert!(windows.iter().all(|pulses| *pulses == 0));
    assert!(angles.windows(2).any(|pair| pair[0].angles != pair[1].angles));
}

#[test]
fn a_frozen_converter_repeats_every_channel() {
    let faults = SensorFaults { converter_frozen: true, ..SensorFaults::default() };
    let (scans, ..) = with_sensor_faults(&mut running(), faults);
    assert!(scans.len() > 20 && scans.iter().all(|scan| *scan == scans[0]));
}

#[test]
fn a_fault_that_is_taken_away_leaves_nothing_behind() {
    let mut simulation = running();
    for fault in [
        InjectedLineFault::Silent,
        InjectedLineFault::Garbage,
        InjectedLineFault::HalfFrames,
        InjectedLineFault::WrongDevice,
    ] {
        simulation.trucks_mut()[0].set_line_faults(LineFaults { board: fault, gyro: fault });
        second(&mut simulation);
        simulation.trucks_mut()[0].set_line_faults(LineFaults::default());
        let (board, gyro) = second(&mut simulation);
        assert!(read_board(&board).0.len() > 90, "{fault:?}");
        assert_eq!(read_gyro(&gyro).len(), 100, "{fault:?}");
    }
    assert!(board_frames(&mut simulation.trucks_mut()[0]).is_empty());
}
