//! Ports that come, go, hang and are fought for, on ptys.

use super::*;
use rustix::io::ioctl_fionread;
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::{ErrorKind, Read, Write};
use std::os::unix::fs::{OpenOptionsExt, symlink};
use std::path::PathBuf;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Far longer than anything here takes, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(20);
const FRAME: [u8; 28] = [0x55; 28];

/// Turns, as the control loop would, until something is there.
fn eventually<T>(what: &str, mut turn: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = turn() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "not within {PATIENCE:?}: {what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Two sockets that cables can be plugged into; nothing in them at first.
struct Sockets {
    folder: TempDir,
}

/// The far end of a plugged cable; dropped without [`Sockets::unplug`], it only falls silent.
struct Cable {
    link: PathBuf,
    far_end: TTYPort,
}

impl Sockets {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    fn settings(&self, name: &str) -> PortSettings {
        PortSettings { path: self.folder.path().join(name).display().to_string(), baud: 115_200 }
    }

    fn start(&self) -> SerialHardware {
        SerialHardware::start(self.settings("board"), self.settings("gyro")).expect("threads")
    }

    fn plug(&self, name: &str) -> Cable {
        let (mut far_end, slave) = TTYPort::pair().expect("a pty");
        far_end.set_timeout(Duration::ZERO).expect("a timeout");
        let link = self.folder.path().join(name);
        symlink(slave.name().expect("its path"), &link).expect("a link");
        Cable { link, far_end }
    }

    /// As a USB device goes: its path first (another test may be given the same pty again).
    fn unplug(&self, cable: Cable) {
        std::fs::remove_file(&cable.link).expect("the link");
    }
}

impl Cable {
    /// What has arrived at the far end so far.
    fn arrived(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        let mut buffer = [0; 4096];
        while let Ok(n @ 1..) = self.far_end.read(&mut buffer) {
            all.extend(&buffer[..n]);
        }
        all
    }
}

/// The next bytes of the board's line, however they are cut; an error for the caller to judge.
fn read_board(hardware: &mut SerialHardware) -> Option<io::Result<Vec<u8>>> {
    let mut buffer = [0; 64];
    match hardware.read_board(&mut buffer) {
        Ok(0) => None,
        result => Some(result.map(|n| buffer[..n].to_vec())),
    }
}

fn why_closed(hardware: &mut SerialHardware) -> Option<ErrorKind> {
    hardware.read_board(&mut [0; 64]).err().map(|error| error.kind())
}

#[test]
fn a_line_that_is_there_at_the_start_is_open_at_once() {
    let sockets = Sockets::new();
    let (mut board, mut gyro) = (sockets.plug("board"), sockets.plug("gyro"));
    let mut hardware = sockets.start();
    assert_eq!(hardware.closed().next(), None);
    hardware.write_board(&FRAME).expect("an open line");
    hardware.write_gyro(&[0x10, 0x00, 0x0E]).expect("an open line");
    assert_eq!(eventually("the frame", || Some(board.arrived()).filter(|all| all.len() >= 28)), FRAME);
    let command = eventually("the command", || Some(gyro.arrived()).filter(|all| all.len() >= 3));
    assert_eq!(command, [0x10, 0x00, 0x0E]);
    board.far_end.write_all(b"up").expect("a pty");
    let got = eventually("bytes", || read_board(&mut hardware)).expect("an open line");
    assert!(b"up".starts_with(&got), "{got:?}");
}

#[test]
fn a_missing_line_says_so_and_opens_by_itself_while_the_other_works() {
    let sockets = Sockets::new();
    let _gyro = sockets.plug("gyro");
    let mut hardware = sockets.start();
    let path = sockets.settings("board").path;
    assert_eq!(hardware.closed().map(|error| error.path.as_str()).collect::<Vec<_>>(), [path.as_str()]);
    for error in [
        hardware.read_board(&mut [0; 8]).expect_err("no board"),
        hardware.write_board(&FRAME).expect_err("no board"),
    ] {
        assert_eq!(error.kind(), ErrorKind::NotFound);
        assert_eq!(error.to_string(), format!("{path}: no such device"));
    }
    assert_eq!(hardware.read_gyro(&mut [0; 8]).expect("an open line"), 0);

    let mut board = sockets.plug("board");
    eventually("the line", || hardware.write_board(&FRAME).ok());
    assert_eq!(eventually("the frame", || Some(board.arrived()).filter(|all| all.len() >= 28)), FRAME);
    assert_eq!(hardware.closed().next(), None);
}

#[test]
fn an_unplugged_line_is_noticed_by_the_next_read_and_comes_back_on_another_device() {
    let sockets = Sockets::new();
    let _gyro = sockets.plug("gyro");
    let mut board = sockets.plug("board");
    let mut hardware = sockets.start();
    for round in 0..3 {
        assert_eq!(why_closed(&mut hardware), None, "round {round}");
        board.far_end.write_all(b"these bytes are lost, or still read").expect("a pty");
        sockets.unplug(board);
        // Bytes that came before it went may still be read; nothing is written.
        let error = eventually("the error", || read_board(&mut hardware)?.err());
        assert_eq!(error.kind(), ErrorKind::NotFound, "round {round}: {error}");
        assert!(hardware.closed().next().is_some());

        board = sockets.plug("board");
        eventually("the line", || hardware.read_board(&mut [0; 8]).ok());
    }
}

#[test]
fn a_silent_unplugged_line_is_gone_at_once() {
    let sockets = Sockets::new();
    let board = sockets.plug("board");
    let mut hardware = sockets.start();
    assert_eq!(why_closed(&mut hardware), None);
    sockets.unplug(board);
    assert_eq!(why_closed(&mut hardware), Some(ErrorKind::NotFound));
}

#[test]
fn an_unplugged_line_is_noticed_by_a_write_too() {
    let sockets = Sockets::new();
    let board = sockets.plug("board");
    let mut hardware = sockets.start();
    hardware.write_board(&FRAME).expect("an open line");
    sockets.unplug(board);
    let error = hardware.write_board(&FRAME).expect_err("it is gone");
    assert_eq!(error.kind(), ErrorKind::NotFound);
}

#[test]
fn what_waited_in_the_port_is_thrown_away() {
    let sockets = Sockets::new();
    let mut board = sockets.plug("board");
    let noctty = rustix::fs::OFlags::NOCTTY.bits().cast_signed();
    let path = sockets.settings("board").path;
    let watcher = File::options().read(true).write(true).custom_flags(noctty).open(path).expect("the port");
    board.far_end.write_all(b"old").expect("a pty");
    eventually("the old bytes", || (ioctl_fionread(&watcher).ok()? == 3).then_some(()));
    let mut hardware = sockets.start();
    board.far_end.write_all(b"new").expect("a pty");
    let got = eventually("bytes", || read_board(&mut hardware)).expect("an open line");
    assert!(b"new".starts_with(&got), "{got:?}");
}

#[test]
fn two_agents_never_share_a_line() {
    let sockets = Sockets::new();
    let mut board = sockets.plug("board");
    let mut first = sockets.start();
    let mut second = sockets.start();
    assert_eq!(why_closed(&mut first), None);
    let error = second.read_board(&mut [0; 8]).expect_err("the first has it");
    assert_eq!(error.kind(), ErrorKind::ResourceBusy);
    assert!(error.to_string().ends_with("/board: in use by another program"), "{error}");
    for _ in 0..3 {
        let third = sockets.start();
        assert_eq!(third.closed().next().map(|error| error.kind), Some(ErrorKind::ResourceBusy));
    }
    // To refuse them has cost the first nothing.
    first.write_board(&FRAME).expect("an open line");
    assert_eq!(eventually("the frame", || Some(board.arrived()).filter(|all| all.len() >= 28)), FRAME);

    drop(first);
    eventually("the line", || second.read_board(&mut [0; 8]).ok());
}

#[test]
fn programs_that_use_serialport_are_kept_out_and_respected() {
    let sockets = Sockets::new();
    let _board = sockets.plug("board");
    let path = sockets.settings("board").path;
    let mut hardware = sockets.start();
    assert_eq!(probe(&path).expect_err("ours").kind, ErrorKind::ResourceBusy);
    serialport::new(&path, 115_200).open().expect_err("the agent has it");
    assert_eq!(why_closed(&mut hardware), None);
    drop(hardware);

    probe(&path).expect("free");
    let other = serialport::new(&path, 115_200).open().expect("free");
    let mut hardware = sockets.start();
    assert_eq!(why_closed(&mut hardware), Some(ErrorKind::ResourceBusy));
    drop(other);
    eventually("the line", || hardware.read_board(&mut [0; 8]).ok());
}

#[test]
fn a_board_that_takes_no_bytes_holds_nobody_up_and_does_not_get_old_frames() {
    let sockets = Sockets::new();
    let mut board = sockets.plug("board");
    let mut hardware = sockets.start();
    let began = Instant::now();
    let mut frames = 0_u32;
    let error = loop {
        match hardware.write_board(&FRAME) {
            Ok(()) => frames += 1,
            Err(error) => break error,
        }
        assert!(began.elapsed() < PATIENCE, "{frames} frames and still room");
    };
    // Full: given up soon, and the line stays open.
    assert_eq!(error.kind(), ErrorKind::TimedOut);
    assert!(error.to_string().ends_with("/board: accepts no data"), "{error}");
    let last = Instant::now();
    let _ = hardware.write_board(&FRAME);
    assert!(last.elapsed() < Duration::from_secs(1), "a write took {:?}", last.elapsed());
    assert_eq!(why_closed(&mut hardware), None);

    // It takes bytes again. Most old ones are gone, and a delimiter stands before the first new frame.
    let mut all = Vec::new();
    let new = [0xAA; 28];
    eventually("a new frame", || {
        all.extend(board.arrived());
        if all.ends_with(&new) {
            return Some(());
        }
        let _ = hardware.write_board(&new);
        None
    });
    let at = all.iter().position(|&byte| byte == 0xAA).expect("a new frame");
    assert!(all[..at].contains(&BOARD_DELIMITER), "an old frame's end ran into a new frame");
    assert!(at < frames as usize * FRAME.len(), "all of {frames} old frames came");
}
