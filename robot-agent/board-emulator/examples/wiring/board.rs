//! The Pico as it lies, USB up, with what goes to each pin; and what goes to the multiplexers.

use crate::pins::Pin;
use crate::svg::{FADED, GROUND, INK, SENSE, SIGNAL, SUPPLY, Svg};

/// Between two pins of the drawing.
const PITCH: f64 = 40.0;
const TOP: f64 = 110.0;
const LEFT: f64 = 560.0;
const RIGHT: f64 = 840.0;
const WIDTH: u32 = 1400;

/// What a place of the header is.
#[derive(Debug, Clone, Copy)]
enum Place {
    Gp(u8),
    Ground,
    /// Named, and used for this or for nothing.
    Other(&'static str, &'static str),
}

use Place::{Gp, Ground, Other};

/// Places 1 to 20, from the top of the left side down.
const LEFT_SIDE: [Place; 20] = [
    Gp(0),
    Gp(1),
    Ground,
    Gp(2),
    Gp(3),
    Gp(4),
    Gp(5),
    Ground,
    Gp(6),
    Gp(7),
    Gp(8),
    Gp(9),
    Ground,
    Gp(10),
    Gp(11),
    Gp(12),
    Gp(13),
    Ground,
    Gp(14),
    Gp(15),
];
/// Places 40 to 21, from the top of the right side down.
const RIGHT_SIDE: [Place; 20] = [
    Other("VBUS", ""),
    Other("VSYS", "5 V of the computer's supply, through a Schottky diode"),
    Ground,
    Other("3V3_EN", ""),
    Other("3V3", "3.3 V to both multiplexers and the inertial unit"),
    Other("VREF", ""),
    Gp(28),
    Other("AGND", "ground of multiplexers and dividers"),
    Gp(27),
    Gp(26),
    Other("RUN", ""),
    Gp(22),
    Ground,
    Gp(21),
    Gp(20),
    Gp(19),
    Gp(18),
    Ground,
    Gp(17),
    Gp(16),
];

/// Channels of the multiplexers: first, second.
const CHANNELS: [(&str, &str, &str); 6] = [
    (
        "0 – 5",
        "front ranges 1 to 6, left to right (directly)",
        "0, 1: front 7, 8; 2, 3: rear 7, 8 (directly)",
    ),
    ("6 – 11", "rear ranges 1 to 6, left to right (directly)", ""),
    ("12", "tilt x (divider A)", "position of piston FL (divider A)"),
    ("13", "tilt y (divider A)", "position of piston FR (divider A)"),
    ("14", "battery (divider B)", "position of piston RL (divider A)"),
    ("15", "", "position of piston RR (divider A)"),
];

/// The place of a GPIO on the header; `None` = it is not on it.
#[allow(dead_code)] // the drawing knows its places; the test of the document asks
pub(crate) fn place_of(gp: u8) -> Option<usize> {
    let is_it = |place: &Place| matches!(place, Gp(number) if *number == gp);
    let left = LEFT_SIDE.iter().position(is_it).map(|row| row + 1);
    left.or_else(|| RIGHT_SIDE.iter().position(is_it).map(|row| 40 - row))
}

pub(crate) fn draw(pins: &[Pin]) -> String {
    let mut svg = Svg::new(WIDTH, 1320);
    svg.heading((30.0, 40.0), "The I/O board: a Raspberry Pi Pico, seen from above, USB at the top");
    svg.text(
        (30.0, 66.0),
        "GP numbers are those of the firmware's source; the small numbers are places of the header.",
    );
    legend(&mut svg);
    let height = PITCH * 20.0 + 20.0;
    svg.rect((LEFT, TOP - 20.0), (RIGHT - LEFT, height), "#e3efe3", INK);
    svg.rect((660.0, TOP - 36.0), (80.0, 34.0), "#ccc", INK);
    svg.middle((700.0, TOP - 14.0), "USB");
    svg.middle((700.0, TOP + 400.0), "Pico");
    for (row, place) in LEFT_SIDE.into_iter().enumerate() {
        side(&mut svg, pins, place, row, true);
    }
    for (row, place) in RIGHT_SIDE.into_iter().enumerate() {
        side(&mut svg, pins, place, row, false);
    }
    channels(&mut svg, TOP + height + 30.0);
    dividers(&mut svg, TOP + height + 30.0);
    svg.end()
}

fn legend(svg: &mut Svg) {
    for (i, (colour, what)) in
        [(SIGNAL, "digital"), (SENSE, "measured voltage"), (SUPPLY, "supply"), (GROUND, "ground")]
            .into_iter()
            .enumerate()
    {
        let x = 930.0 + 115.0 * i as f64;
        svg.line(&[(x, 36.0), (x + 26.0, 36.0)], colour, 4.0);
        svg.text((x + 32.0, 41.0), if i == 1 { "voltage" } else { what });
    }
}

/// A place of the header and its wire.
fn side(svg: &mut Svg, pins: &[Pin], place: Place, row: usize, is_left: bool) {
    let y = TOP + PITCH * row as f64;
    let number = if is_left { row + 1 } else { 40 - row };
    let (edge, out, label) = if is_left { (LEFT, -1.0, LEFT - 110.0) } else { (RIGHT, 1.0, RIGHT + 110.0) };
    let (name, what, colour) = match place {
        Ground => ("GND".to_owned(), "ground".to_owned(), GROUND),
        Other(name, what) if name == "AGND" => (name.to_owned(), what.to_owned(), GROUND),
        Other(name, what) => (name.to_owned(), what.to_owned(), SUPPLY),
        Gp(gp) => {
            let what = pins.iter().find(|pin| pin.gp == gp).map_or("", |pin| pin.what);
            let colour = if matches!(gp, 26 | 27) { SENSE } else { SIGNAL };
            (format!("GP{gp}"), what.to_owned(), colour)
        }
    };
    let is_used = !what.is_empty();
    svg.dot((edge, y), if is_used { colour } else { FADED });
    let inner = (edge - out * 14.0, y + 5.0);
    if is_left {
        svg.text(inner, &name)
    } else {
        svg.right(inner, &name)
    }
    svg.small((edge + out * 16.0, y - 6.0), &number.to_string());
    if !is_used {
        return;
    }
    svg.line(&[(edge, y), (label, y)], colour, 2.5);
    let text = with_note(place, &what);
    let at = (label + out * 10.0, y + 5.0);
    if is_left { svg.right(at, &text) } else { svg.text(at, &text) }
}

/// What has to stand between the pin and the thing.
fn with_note(place: Place, what: &str) -> String {
    let note = match place {
        Gp(0 | 1) => "  (3.3 V)",
        Gp(2..=11) => "  · buffer, pull-down 10 kΩ",
        Gp(12) => ", to ground",
        Gp(13 | 16 | 17 | 15) => "  · divider A if it gives 5 V",
        Gp(14) => ", 330 Ω in series",
        Gp(28) => " (open: receiver fitted)",
        _ => "",
    };
    format!("{what}{note}")
}

fn channels(svg: &mut Svg, top: f64) {
    svg.heading((30.0, top + 20.0), "Inputs of the two multiplexers (CD74HC4067 at 3.3 V, EN to ground)");
    let columns = [30.0, 130.0, 500.0];
    for (x, heading) in columns.into_iter().zip(["channel", "first (SIG to GP26)", "second (SIG to GP27)"]) {
        svg.text((x, top + 56.0), heading);
    }
    svg.line(&[(30.0, top + 66.0), (790.0, top + 66.0)], INK, 1.5);
    for (i, (channel, first, second)) in CHANNELS.into_iter().enumerate() {
        let y = top + 92.0 + 32.0 * i as f64;
        for (x, text) in columns.into_iter().zip([channel, first, second]) {
            svg.text((x, y), text);
        }
    }
    let y = top + 92.0 + 32.0 * 6.0;
    svg.text((30.0, y), "Channels without a sensor: to ground. 100 nF from each divider's middle to ground.");
}

fn dividers(svg: &mut Svg, top: f64) {
    svg.heading((880.0, top + 20.0), "Dividers");
    for (x, name, from, upper, lower) in [
        (900.0, "A: 5 V to 3.3 V", "sensor, 0 – 5 V", "5.1 kΩ", "10 kΩ"),
        (1160.0, "B: a quarter", "battery, up to 13.2 V", "30 kΩ", "10 kΩ"),
    ] {
        svg.text((x, top + 56.0), name);
        svg.text((x, top + 86.0), from);
        let wire = x + 40.0;
        svg.line(&[(wire, top + 94.0), (wire, top + 112.0)], SENSE, 2.5);
        svg.rect((wire - 10.0, top + 112.0), (20.0, 44.0), "#fff", INK);
        svg.text((wire + 18.0, top + 139.0), upper);
        svg.line(&[(wire, top + 156.0), (wire, top + 184.0)], SENSE, 2.5);
        svg.line(&[(wire, top + 170.0), (wire + 90.0, top + 170.0)], SENSE, 2.5);
        svg.dot((wire, top + 170.0), SENSE);
        svg.text((wire + 98.0, top + 175.0), "to the pin");
        svg.rect((wire - 10.0, top + 184.0), (20.0, 44.0), "#fff", INK);
        svg.text((wire + 18.0, top + 211.0), lower);
        svg.line(&[(wire, top + 228.0), (wire, top + 250.0)], GROUND, 2.5);
        svg.line(&[(wire - 16.0, top + 250.0), (wire + 16.0, top + 250.0)], GROUND, 4.0);
    }
    svg.text((900.0, top + 284.0), "1 % resistors; the firmware takes A as 0.66 and B as 0.25.");
}
