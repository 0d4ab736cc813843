//! docs/build-a-truck.md and its drawings have the pins of the firmware's source.

#![allow(clippy::unwrap_used)]

#[path = "../examples/wiring/board.rs"]
mod board;
#[path = "../examples/wiring/pins.rs"]
mod pins;
#[path = "../examples/wiring/power.rs"]
mod power;
#[path = "../examples/wiring/svg.rs"]
mod svg;

const DOC: &str = include_str!("../../../docs/build-a-truck.md");
const FIRMWARE: &str = include_str!("../../firmware/README.md");

#[test]
fn the_table_of_pins_is_the_firmwares() {
    let pins = pins::of_firmware();
    for pin in &pins {
        let place = board::place_of(pin.gp).map_or("—".to_owned(), |place| place.to_string());
        let row = format!("| {} | {place} | {} |", pin.gp, pin.what);
        assert!(DOC.contains(&row), "docs/build-a-truck.md has no row\n{row}");
    }
    let rows = DOC.lines().skip_while(|line| !line.starts_with("| GP |")).skip(2);
    assert_eq!(rows.take_while(|line| line.starts_with('|')).count(), pins.len());
}

#[test]
fn no_pin_is_used_twice_and_the_firmwares_own_table_has_them_all() {
    let pins = pins::of_firmware();
    assert!(pins.windows(2).all(|pair| pair[0].gp < pair[1].gp), "{pins:?}");
    let table: Vec<_> = FIRMWARE.lines().skip_while(|line| !line.starts_with("| GP |")).skip(2).collect();
    let named: String = table
        .iter()
        .take_while(|line| line.starts_with('|'))
        .map(|line| {
            line.split('|').nth(1).unwrap_or_default().replace("2–11", "2, 3, 4, 5, 6, 7, 8, 9, 10, 11") + ","
        })
        .collect();
    let mut numbers: Vec<u8> = named.split(',').filter_map(|number| number.trim().parse().ok()).collect();
    numbers.sort_unstable();
    assert_eq!(numbers, pins.iter().map(|pin| pin.gp).collect::<Vec<_>>());
}

#[test]
fn the_drawings_are_those_that_the_program_makes() {
    for (drawn, committed) in [
        (board::draw(&pins::of_firmware()), include_str!("../../../docs/images/wiring.svg")),
        (power::draw(), include_str!("../../../docs/images/power.svg")),
    ] {
        let hint = "cargo run -p xtb-board-emulator --example wiring -- docs/images";
        assert!(drawn == committed, "{hint}");
    }
}
