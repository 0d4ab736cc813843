//! A program in a terminal of its own: what it draws, the keys that are pressed, how it ends.

use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, Signal};
use rustix::termios::{Winsize, tcsetwinsize};
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::{Read, Write};
use std::process::Command;
use std::time::{Duration, Instant};

/// The size that every terminal has.
const SIZE: Winsize = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// A key that came before the program listened to keys is pressed again after this.
const KEY_AGAIN: Duration = Duration::from_secs(3);
/// Questions to the terminal, and what it answers.
const ANSWERS: [(&[u8], &[u8]); 2] = [(b"\x1b[6n", b"\x1b[1;1R"), (b"\x1b[c", b"\x1b[?62c")];

/// Runs `command` in a terminal until it ends; presses `keys` once it has drawn `shows`. Returns the
/// exit code and everything that was drawn, without the escape sequences.
pub(super) fn run(command: &mut Command, shows: Option<&str>, keys: Option<&str>) -> (i32, String) {
    let (mut near, far) = TTYPort::pair().unwrap();
    let far = File::options().read(true).write(true).open(far.name().unwrap()).unwrap();
    tcsetwinsize(&far, SIZE).unwrap();
    let end = || far.try_clone().unwrap();
    command.stdin(end()).stdout(end()).stderr(end()).env("TERM", "xterm-256color");
    let mut process = Process(command.spawn().unwrap());
    near.set_timeout(LOOK_EVERY).unwrap();
    let (mut drawn, mut buffer) = (Vec::new(), [0; 4096]);
    let (began, mut pressed) = (Instant::now(), None::<Instant>);
    loop {
        if let Ok(read) = near.read(&mut buffer) {
            let new = &buffer[..read];
            drawn.extend_from_slice(new);
            for (_, answer) in
                ANSWERS.iter().filter(|(ask, _)| new.windows(ask.len()).any(|part| part == *ask))
            {
                near.write_all(answer).unwrap();
            }
            continue;
        }
        let text = words(&drawn);
        if let Ok(Some(status)) = process.0.try_wait() {
            return (status.code().unwrap_or(-1), text);
        }
        if let Some(keys) = keys.filter(|_| shows.is_none_or(|shows| text.contains(shows)))
            && pressed.is_none_or(|at| at.elapsed() > KEY_AGAIN)
        {
            near.write_all(keys.as_bytes()).unwrap();
            pressed = Some(Instant::now());
        }
        if began.elapsed() > PATIENCE {
            process.signal(Signal::Kill);
            panic!("does not end; keys were pressed: {}; drawn was\n{text}", pressed.is_some());
        }
    }
}

/// What was drawn; a move of the cursor separates words, a colour does not.
fn words(drawn: &[u8]) -> String {
    let drawn = String::from_utf8_lossy(drawn);
    let mut text = String::new();
    let mut left = drawn.chars();
    while let Some(next) = left.next() {
        if next != '\x1b' {
            text.push(next);
        } else if left.next() == Some('[') {
            // Parameters, then a letter.
            let last = left.find(|c| c.is_ascii_alphabetic() || *c == '~');
            text.push_str(if last == Some('m') { "" } else { " " });
        }
    }
    text
}
