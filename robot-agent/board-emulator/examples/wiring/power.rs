//! Who supplies whom, and what the emergency stop cuts.

use crate::svg::{GROUND, SENSE, SIGNAL, SUPPLY, Svg};

const WARM: &str = "#fbeeea";
const COOL: &str = "#eaf0fb";
const GREEN: &str = "#e3efe3";

pub(crate) fn draw() -> String {
    let mut svg = Svg::new(1400, 730);
    svg.heading((30.0, 40.0), "Power and emergency stop");
    svg.text((30.0, 66.0), "Pressing the stop drops the relay: the ESC has no supply, whatever any program says. Servos and computer stay on.");
    supplies(&mut svg);
    drive(&mut svg);
    stop(&mut svg);
    logic(&mut svg);
    grounds(&mut svg);
    svg.end()
}

/// Battery, fuse, switch, and the rail behind them.
fn supplies(svg: &mut Svg) {
    svg.block((30.0, 150.0), (150.0, 70.0), WARM, &["Battery", "7.2 V NiMH or 2S"]);
    svg.block((220.0, 150.0), (110.0, 70.0), WARM, &["Fuse", "30 A"]);
    svg.block((370.0, 150.0), (140.0, 70.0), WARM, &["Main switch", "within reach"]);
    for (from, to) in [(180.0, 220.0), (330.0, 370.0)] {
        svg.line(&[(from, 185.0), (to, 185.0)], SUPPLY, 4.0);
    }
    svg.line(&[(510.0, 185.0), (620.0, 185.0)], SUPPLY, 4.0);
    svg.line(&[(560.0, 185.0), (560.0, 565.0)], SUPPLY, 4.0);
    svg.dot((560.0, 185.0), SUPPLY);
}

fn drive(svg: &mut Svg) {
    svg.block((620.0, 150.0), (190.0, 70.0), WARM, &["Relay, 40 A", "closed while its coil is fed"]);
    svg.line(&[(810.0, 185.0), (880.0, 185.0)], SUPPLY, 4.0);
    svg.block((880.0, 150.0), (150.0, 70.0), WARM, &["ESC", "without its red lead"]);
    svg.line(&[(1030.0, 185.0), (1110.0, 185.0)], SUPPLY, 4.0);
    svg.block((1110.0, 150.0), (170.0, 70.0), WARM, &["Motor", "encoder on its shaft"]);
}

fn stop(svg: &mut Svg) {
    svg.block(
        (620.0, 300.0),
        (170.0, 90.0),
        "#fff3d6",
        &["Emergency stop", "two contacts that", "open when pressed"],
    );
    svg.line(&[(560.0, 325.0), (620.0, 325.0)], SUPPLY, 2.5);
    svg.dot((560.0, 325.0), SUPPLY);
    svg.line(&[(705.0, 300.0), (705.0, 220.0)], SUPPLY, 2.5);
    svg.text((716.0, 256.0), "contact 1: coil of the relay");
    svg.text((716.0, 276.0), "(with a diode across the coil)");
    svg.line(&[(790.0, 365.0), (1130.0, 365.0), (1130.0, 440.0)], SENSE, 2.5);
    svg.text((806.0, 356.0), "contact 2: GP12 to ground (a report only)");
}

fn logic(svg: &mut Svg) {
    svg.block((620.0, 440.0), (190.0, 70.0), COOL, &["5 V for servos", "BEC, 5 A or more"]);
    svg.line(&[(560.0, 475.0), (620.0, 475.0)], SUPPLY, 4.0);
    svg.dot((560.0, 475.0), SUPPLY);
    svg.block((620.0, 530.0), (190.0, 70.0), COOL, &["5 V for the computer", "converter, 3 to 5 A"]);
    svg.line(&[(560.0, 565.0), (620.0, 565.0)], SUPPLY, 4.0);
    svg.line(&[(810.0, 475.0), (860.0, 475.0)], SUPPLY, 2.5);
    svg.block((860.0, 440.0), (150.0, 70.0), COOL, &["Servos", "steering and others"]);
    svg.line(&[(810.0, 565.0), (860.0, 565.0)], SUPPLY, 2.5);
    svg.block((860.0, 530.0), (150.0, 70.0), COOL, &["Raspberry Pi", "robot-agent"]);
    svg.line(&[(835.0, 565.0), (835.0, 650.0), (1250.0, 650.0), (1250.0, 600.0)], SUPPLY, 2.5);
    svg.dot((835.0, 565.0), SUPPLY);
    svg.text((846.0, 640.0), "VSYS (Schottky); range finders, tilt, encoder, receiver");
    svg.block((1070.0, 440.0), (190.0, 160.0), GREEN, &["Pico", "I/O board,", "multiplexers"]);
    svg.line(&[(1010.0, 565.0), (1070.0, 565.0)], SIGNAL, 2.5);
    svg.small((1040.0, 557.0), "UART");
    svg.line(&[(1070.0, 475.0), (1010.0, 475.0)], SIGNAL, 2.5);
    svg.small((1040.0, 467.0), "pulses");
    svg.line(&[(1200.0, 440.0), (1200.0, 260.0), (955.0, 260.0), (955.0, 220.0)], SIGNAL, 2.5);
    svg.text((1010.0, 252.0), "pulse of the motor");
    svg.line(&[(1240.0, 440.0), (1240.0, 220.0)], SENSE, 2.5);
    svg.text((1250.0, 335.0), "encoder");
}

fn grounds(svg: &mut Svg) {
    svg.line(&[(105.0, 220.0), (105.0, 700.0), (1330.0, 700.0)], GROUND, 4.0);
    svg.text((120.0, 690.0), "One ground for all, joined at one point near the battery's minus: ESC, both 5 V supplies, computer, Pico, every sensor.");

    for (i, text) in [
        "Battery's voltage: divider B, behind the main switch.",
        "Relay, ESC and motor: wires of 2.5 mm² or more,",
        "short, away from the sensors' wires.",
        "1000 µF at the servos' 5 V, 100 µF at the range",
        "finders' 5 V. The relay's coil: for the battery's voltage.",
    ]
    .into_iter()
    .enumerate()
    {
        svg.text((130.0, 290.0 + 26.0 * i as f64), text);
    }
}
