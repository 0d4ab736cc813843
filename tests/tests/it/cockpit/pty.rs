//! A program on a terminal of its own: keys in, its screen out.

use fleet_tests::processes::{Process, program};
use fleet_tests::screen::Screen;
use rustix::termios::{Winsize, tcsetwinsize};
use serialport::{SerialPort, TTYPort};
use std::fs::File;
use std::io::{Read, Write};
use std::process::Command;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// What the program asks the terminal for: what kind it is.
const WHO_ARE_YOU: &[u8] = b"\x1b[c";
const A_PLAIN_ONE: &[u8] = b"\x1b[?62c";
const PATIENCE: Duration = Duration::from_secs(60);
const LOOK_EVERY: Duration = Duration::from_millis(20);

/// `fleet-cli` on a terminal.
pub(crate) struct OnTerminal {
    pub(crate) process: Process,
    screen: Arc<Mutex<Screen>>,
    keys: TTYPort,
    // While it is open the other end can be read.
    _slave: TTYPort,
}

impl OnTerminal {
    /// Starts it on a terminal of that size, in UTF-8 and 256 colours, in an empty home.
    pub(crate) fn start(columns: u16, rows: u16, arguments: &[&str]) -> Self {
        let (master, slave) = TTYPort::pair().unwrap();
        let name = slave.name().unwrap();
        let line = || File::options().read(true).write(true).open(&name).unwrap();
        let size = Winsize { ws_row: rows, ws_col: columns, ws_xpixel: 0, ws_ypixel: 0 };
        tcsetwinsize(line(), size).unwrap();
        // In a session of its own: else it would ask the terminal of whoever runs this.
        let mut command = Command::new("setsid");
        command.arg(program("fleet-cli")).args(arguments).env_clear();
        command.env("HOME", std::env::temp_dir()).env("PATH", "/usr/bin:/bin");
        command.env("TERM", "xterm-256color").env("LANG", "C.UTF-8");
        command.stdin(line()).stdout(line()).stderr(line());
        let process = Process(command.spawn().unwrap());
        let screen = Arc::new(Mutex::new(Screen::new(columns.into(), rows.into())));
        let keys = master.try_clone_native().unwrap();
        follow(master, Arc::clone(&screen));
        Self { process, screen, keys, _slave: slave }
    }

    /// Types.
    pub(crate) fn keys(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
    }

    /// What stands on it now.
    pub(crate) fn screen(&self) -> Screen {
        self.screen.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits until the screen is as it should be.
    pub(crate) fn until(&self, what: &str, so: impl Fn(&str) -> bool) -> String {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let text = self.screen().text();
            if so(&text) {
                return text;
            }
            assert!(Instant::now() < give_up, "waited in vain for: {what}\n{text}");
            std::thread::sleep(LOOK_EVERY);
        }
    }

    /// Waits until it has ended by itself.
    pub(crate) fn ended(&mut self) -> Option<i32> {
        let give_up = Instant::now() + PATIENCE;
        while self.process.runs() {
            assert!(Instant::now() < give_up, "it does not end\n{}", self.screen().text());
            std::thread::sleep(LOOK_EVERY);
        }
        self.process.0.wait().unwrap().code()
    }
}

/// Until the terminal is closed.
fn follow(mut master: TTYPort, screen: Arc<Mutex<Screen>>) {
    master.set_timeout(Duration::from_millis(200)).unwrap();
    std::thread::spawn(move || {
        let mut bytes = [0; 4096];
        loop {
            match master.read(&mut bytes) {
                Ok(count) => {
                    let written = &bytes[..count];
                    screen.lock().unwrap_or_else(PoisonError::into_inner).write(written);
                    if written.windows(WHO_ARE_YOU.len()).any(|part| part == WHO_ARE_YOU) {
                        let _ = master.write_all(A_PLAIN_ONE);
                    }
                }
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
                Err(_) => return,
            }
        }
    });
}
