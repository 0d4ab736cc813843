//! A program in a terminal of its own: what it draws, the keys that are pressed, how it ends.

use fleet_tests::PATIENCE;
use fleet_tests::processes::{Process, Signal};
use rustix::termios::{Winsize, tcsetwinsize};
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::{Read, Write};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// The size that every terminal has.
const SIZE: Winsize = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Some programs ask the terminal a question, and wait this long for the answer: keys come after it.
const KEY_AGAIN: Duration = Duration::from_secs(3);

/// Runs `command` in a terminal until it ends; presses `keys` once it has drawn `shows`. Returns the
/// exit code and everything that was drawn, without the escape sequences.
pub(super) fn run(command: &mut Command, shows: Option<&str>, keys: Option<&str>) -> (i32, String) {
    let (mut near, far) = TTYPort::pair().unwrap();
    let far = File::options().read(true).write(true).open(far.name().unwrap()).unwrap();
    tcsetwinsize(&far, SIZE).unwrap();
    let end = || far.try_clone().unwrap();
    command.stdin(end()).stdout(end()).stderr(end()).env("TERM", "xterm-256color");
    let mut process = Process(command.spawn().unwrap());
    let drawn = Arc::<Mutex<Vec<u8>>>::default();
    near.set_timeout(LOOK_EVERY).unwrap();
    let (began, mut pressed): (_, Option<Instant>) = (Instant::now(), None);
    let mut buffer = [0; 4096];
    loop {
        if let Ok(read) = near.read(&mut buffer) {
            drawn.lock().unwrap().extend_from_slice(&buffer[..read]);
            if buffer[..read].windows(4).any(|part| part == b"\x1b[6n") {
                near.write_all(b"\x1b[1;1R").unwrap();
            }
            if buffer[..read].windows(3).any(|part| part == b"\x1b[c") {
                near.write_all(b"\x1b[?62c").unwrap();
            }
            continue;
        }
        let text = words(&drawn.lock().unwrap());
        if let Ok(Some(status)) = process.0.try_wait() {
            return (status.code().unwrap_or(-1), text);
        }
        if let Some(keys) = keys
            && shows.is_none_or(|shows| text.contains(shows))
            && pressed.is_none_or(|at| at.elapsed() > KEY_AGAIN)
        {
            near.write_all(keys.replace("^C", "\x03").as_bytes()).unwrap();
            pressed = Some(Instant::now());
        }
        if began.elapsed() > PATIENCE {
            process.signal(Signal::Kill);
            panic!("it did not end; keys were {}, and drawn was\n{text}", if pressed.is_some() { "pressed" } else { "not pressed" });
        }
    }
}

/// What was drawn, each escape sequence a blank.
fn words(drawn: &[u8]) -> String {
    let drawn = String::from_utf8_lossy(drawn);
    let mut text = String::new();
    let mut left = drawn.chars().peekable();
    while let Some(next) = left.next() {
        if next != '\x1b' {
            text.push(next);
            continue;
        }
        let introducer = left.next();
        if introducer == Some('[') {
            // Parameters, then one letter; where to go on is a new word, a colour is not.
            let last = left.find(|c| c.is_ascii_alphabetic() || *c == '~');
            if last != Some('m') {
                text.push(' ');
            }
        }
    }
    text
}
