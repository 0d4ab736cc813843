//! The pins as the firmware's source has them (`robot-agent/firmware/pico/src/main.rs`).

const SOURCE: &str = include_str!("../../../firmware/pico/src/main.rs");

/// What a pin is for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Pin {
    /// Its GPIO.
    pub(crate) gp: u8,
    pub(crate) what: &'static str,
}

/// Each use: a piece of the source, and what the pins that follow it are for, in their order.
const USES: [(&str, &[&str]); 8] = [
    ("AgentLine::new(", &["UART0 TX → computer's RX", "UART0 RX ← computer's TX"]),
    (
        "outputs::Pins(",
        &[
            "motor (ESC)",
            "steering, front",
            "steering, rear",
            "bumper, front",
            "bumper, rear",
            "piston FL",
            "piston FR",
            "piston RL",
            "piston RR",
            "spare",
        ],
    ),
    ("let stop = Input::new(", &["emergency stop, sense contact"]),
    ("gates::Pins {", &["receiver, speed", "receiver, steering", "receiver, selector", "encoder"]),
    ("let mut leds = [", &["status LED", "LED on the Pico"]),
    ("ImuLine::new(", &["UART1 RX ← inertial unit's TX"]),
    (
        "Analog::new(",
        &[
            "first multiplexer, SIG",
            "second multiplexer, SIG",
            "S0 of both multiplexers",
            "S1 of both multiplexers",
            "S2 of both multiplexers",
            "S3 of both multiplexers",
        ],
    ),
    ("let no_receiver = Input::new(", &["to ground: no receiver"]),
];

/// All of them, by their numbers.
///
/// # Panics
/// If the source is not as it is expected.
pub(crate) fn of_firmware() -> Vec<Pin> {
    let mut pins = Vec::new();
    for (begin, uses) in USES {
        let Some((_, source)) = SOURCE.split_once(begin) else { panic!("the firmware has no {begin}") };
        let mut numbers = source.split("p.PIN_").skip(1).map(|text| {
            let digits: String = text.chars().take_while(char::is_ascii_digit).collect();
            digits.parse().unwrap_or_else(|_| panic!("no number of a pin after {begin}"))
        });
        for what in uses {
            let Some(gp) = numbers.next() else { panic!("no pin for {what}") };
            pins.push(Pin { gp, what });
        }
    }
    pins.sort_by_key(|pin| pin.gp);
    pins
}
