//! Pictures of `top` for the documentation, from the real program and a real simulated fleet:
//! writes `top-80x24.svg` and `top-160x50.svg` into a folder. `docs/images/top.sh` makes PNGs of them.
//! A cell's text is centred and has its own weight and opacity: no plot, so the SVG is written by hand.

#![allow(clippy::unwrap_used)] // a picture that cannot be made shall say where

#[path = "../tests/it/cockpit/pty.rs"]
mod pty;

use fleet_tests::processes::{Process, program};
use fleet_tests::screen::{Cell, Screen};
use pty::OnTerminal;
use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Size of a cell in the picture.
const CELL: (usize, usize) = (9, 18);
const PAPER: &str = "#14171c";
const INK: &str = "#d5d9e0";
/// The 16 colours that are used.
const PALETTE: [&str; 16] = [
    "#3b4048", "#e06c75", "#7ec27e", "#e5c07b", "#61afef", "#c678dd", "#56c2cf", "#b6bcc8", "#6b7280",
    "#ff7b85", "#98e098", "#ffd68a", "#7fc4ff", "#dd9af0", "#7fe0ea", "#ffffff",
];

/// So long they draw trails.
const TRAILS: Duration = Duration::from_secs(8);

fn main() {
    let folder = std::env::args().nth(1).unwrap_or_else(|| ".".to_owned());
    let world = concat!(env!("CARGO_MANIFEST_DIR"), "/../worlds/lab.toml");
    let ledger = std::env::temp_dir().join(format!("cockpit-{}.ledger", std::process::id()));
    let mut sim = Command::new(program("fleet-cli"));
    sim.args([
        "--json",
        "sim",
        "--listen",
        "tcp/127.0.0.1:0",
        "--robots",
        "5",
        "--dispatch",
        "--world",
        world,
    ]);
    let (_sim, ready) = Process::start_ready(sim.arg("--ledger").arg(&ledger));
    let endpoint = ready.split('"').find(|part| part.starts_with("tcp/")).unwrap().to_owned();
    let mut traffic = Command::new(program("fleet-cli"));
    traffic.args(["--json", "--connect", &endpoint, "traffic", "serve"]);
    let (_traffic, _) = Process::start_ready(&mut traffic);
    for task in [
        &["dispatch", "patrol", "-3,-2", "3,-3", "3,2", "-3,2", "--robot", "xtb-2"][..],
        &["dispatch", "route", "0,6", "4,0", "--robot", "xtb-3", "--loops", "9"],
        &["dispatch", "patrol", "2,1", "-2,-5", "--robot", "xtb-5"],
        &["goto", "xtb-4", "5.4", "0", "--yaw", "0", "--wait"], // before a wall, for its range finders to see
        &["estop", "xtb-4"],
    ] {
        let mut asking = Command::new(program("fleet-cli"));
        asking.args(["--connect", &endpoint]).args(task).stdout(Stdio::null()).stderr(Stdio::null());
        assert!(asking.status().unwrap().success(), "{task:?}");
    }
    for (columns, rows) in [(80, 24), (160, 50)] {
        let arguments = ["--connect", &endpoint, "--client", "pilot", "--color", "always", "top"];
        let mut top = OnTerminal::start(columns, rows, &arguments);
        top.until("a fleet at work", |text| text.contains("3 driving") && text.contains("1 LATCHED"));
        // A goal for the first one, and the second one selected.
        top.keys("1g\x1b[A\x1b[A\x1b[A\x1b[A\x1b[C\x1b[Cr\r");
        top.until("the goal", |text| text.contains("goto xtb-1") && text.contains("accepted"));
        top.keys("2");
        let moving = |text: &str| text.matches("goto   0.").count() - text.matches("goto   0.0").count();
        let opened = Instant::now();
        // The first one may have arrived, and one may drive astern or wait at the door.
        top.until("a fleet that moves, with trails", |text| {
            let driving = text.contains("3 driving") || text.contains("4 driving");
            opened.elapsed() > TRAILS && text.contains(">xtb-2") && driving && moving(text) >= 2
        });
        let path = Path::new(&folder).join(format!("top-{columns}x{rows}.svg"));
        std::fs::write(&path, svg(&top.screen(), columns.into(), rows.into())).unwrap();
        top.keys("q");
        top.ended();
    }
    let _ = std::fs::remove_file(ledger);
}

fn svg(screen: &Screen, columns: usize, rows: usize) -> String {
    let (width, height) = (columns * CELL.0 + 16, rows * CELL.1 + 16);
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' font-size='15' \
         font-family='DejaVu Sans Mono, monospace'><rect width='100%' height='100%' fill='{PAPER}'/>"
    );
    for (row, cells) in screen.rows().enumerate() {
        for (column, cell) in cells.iter().enumerate() {
            draw(&mut svg, *cell, (8 + column * CELL.0, 8 + row * CELL.1));
        }
    }
    svg + "</svg>\n"
}

fn draw(svg: &mut String, cell: Cell, (x, y): (usize, usize)) {
    let style = cell.style;
    let color = style.color.and_then(|color| PALETTE.get(usize::from(color))).copied().unwrap_or(INK);
    let (width, height) = CELL;
    let ink = if style.reversed { PAPER } else { color };
    let faint = if style.dim { " opacity='0.6'" } else { "" };
    if style.reversed {
        let _ = write!(svg, "<rect x='{x}' y='{y}' width='{width}' height='{height}' fill='{color}'/>");
    }
    if style.underlined {
        let _ = write!(
            svg,
            "<rect x='{x}' y='{}' width='{width}' height='1' fill='{ink}'{faint}/>",
            y + height - 2
        );
    }
    let (middle_x, middle_y) = (x as f64 + width as f64 / 2.0, y as f64 + height as f64 / 2.0);
    match cell.sign {
        ' ' => {}
        // Fonts differ most in these: as dots and lines they fit in any.
        dots @ '\u{2800}'..='\u{28ff}' => {
            const PLACES: [(f64, f64); 8] = [
                (0.0, 0.0),
                (0.0, 1.0),
                (0.0, 2.0),
                (1.0, 0.0),
                (1.0, 1.0),
                (1.0, 2.0),
                (0.0, 3.0),
                (1.0, 3.0),
            ];
            let bits = dots as u32 - 0x2800;
            for (bit, (right, down)) in PLACES.iter().enumerate().filter(|(bit, _)| bits >> bit & 1 == 1) {
                let _ = bit;
                let (cx, cy) = (x as f64 + 2.25 + right * 4.5, y as f64 + 2.25 + down * 4.5);
                let _ = write!(svg, "<circle cx='{cx}' cy='{cy}' r='1.5' fill='{ink}'{faint}/>");
            }
        }
        '─' | '│' | '┌' | '┐' | '└' | '┘' => {
            let (right, bottom) = (x + width, y + height);
            let line = |x1: f64, y1: f64, x2: f64, y2: f64| {
                format!("<path d='M{x1} {y1}L{x2} {y2}' stroke='{ink}'{faint}/>")
            };
            let (left, right, top, bottom) = (x as f64, right as f64, y as f64, bottom as f64);
            let [west, east, north, south] = match cell.sign {
                '─' => [true, true, false, false],
                '│' => [false, false, true, true],
                '┌' => [false, true, false, true],
                '┐' => [true, false, false, true],
                '└' => [false, true, true, false],
                _ => [true, false, true, false],
            };
            for (there, (to_x, to_y)) in [
                (west, (left, middle_y)),
                (east, (right, middle_y)),
                (north, (middle_x, top)),
                (south, (middle_x, bottom)),
            ] {
                if there {
                    svg.push_str(&line(middle_x, middle_y, to_x, to_y));
                }
            }
        }
        sign => {
            let weight = if style.bold { " font-weight='bold'" } else { "" };
            let sign = match sign {
                '<' => "&lt;".to_owned(),
                '>' => "&gt;".to_owned(),
                '&' => "&amp;".to_owned(),
                other => other.to_string(),
            };
            let base = y + 13;
            let _ = write!(
                svg,
                "<text x='{middle_x}' y='{base}' text-anchor='middle' fill='{ink}'{weight}{faint}>{sign}</text>"
            );
        }
    }
}
