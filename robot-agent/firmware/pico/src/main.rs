//! The I/O board's firmware for a Raspberry Pi Pico: pins and clocks around `xtb-firmware-logic`.
//!
//! ```text
//!   GP0, 1        UART0 to the robot's computer, 115,200 baud     GP15          encoder (slice 7B, edges)
//!   GP2..=11      ten servo outputs, PWM slices 1..=5             GP18, 19, 20, 22  multiplexers S0..=S3
//!   GP12          emergency stop sense: high = pressed            GP21          UART1 from the inertial unit
//!   GP13, 17, 16  receiver: speed, steering, selector             GP26, 27      outputs of the multiplexers
//!   GP14, 25      status LED                                      GP28          to ground: no receiver
//! ```
//! One loop does everything, in turns that the logic asks for; between them the core sleeps. Only the
//! receiver's selector, for which no PWM slice is left, is timed in an interrupt. A core that hangs is
//! reset by the hardware watchdog.
#![no_std]
#![no_main]

mod analog;
mod clock;
mod gates;
mod image;
mod outputs;
mod serial;

use analog::Analog;
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::watchdog::{ResetReason, Watchdog};
use embassy_time::Duration;
use gates::Gates;
use outputs::Outputs;
use panic_halt as _;
use serial::{AgentLine, ImuLine};
use xtb_firmware_logic::{Board, Hardware, Identity, Inputs, Ticks};

#[cfg(feature = "pico2")]
const HARDWARE: Hardware = Hardware::Pico2;
#[cfg(not(feature = "pico2"))]
const HARDWARE: Hardware = Hardware::Pico;

/// A core that does not come round for so long is reset.
const HANG: Duration = Duration::from_millis(50);
/// Pulses are written this long before the wrap at which they take effect: several times as long as the
/// longest turn (0.11 ms emulated, where the flash costs no time).
const AHEAD: Ticks = Ticks::from_us(400);

#[cortex_m_rt::entry]
fn main() -> ! {
    // Only the first call gets them, and this is it; a program without them waits for the hardware watchdog.
    let Some(core) = cortex_m::Peripherals::take() else { panic!() };
    let p = embassy_rp::init(Default::default());
    let mut watchdog = Watchdog::new(p.WATCHDOG);
    let after_hang = matches!(watchdog.reset_reason(), Some(ResetReason::TimedOut));
    watchdog.start(HANG);

    let mut outputs = Outputs::start(
        outputs::Slices(p.PWM_SLICE1, p.PWM_SLICE2, p.PWM_SLICE3, p.PWM_SLICE4, p.PWM_SLICE5),
        outputs::Pins(
            p.PIN_2, p.PIN_3, p.PIN_4, p.PIN_5, p.PIN_6, p.PIN_7, p.PIN_8, p.PIN_9, p.PIN_10, p.PIN_11,
        ),
    );
    let mut line = AgentLine::new(p.UART0, p.PIN_0, p.PIN_1);
    let mut imu = ImuLine::new(p.UART1, p.PIN_21);
    let gates = Gates::new(
        gates::Slices(p.PWM_SLICE0, p.PWM_SLICE6, p.PWM_SLICE7),
        gates::Pins { speed: p.PIN_13, steering: p.PIN_17, selector: p.PIN_16, encoder: p.PIN_15 },
        core.SYST,
    );
    let mut analog = Analog::new(
        p.ADC,
        p.PIN_26,
        p.PIN_27,
        [
            Output::new(p.PIN_18, Level::Low),
            Output::new(p.PIN_19, Level::Low),
            Output::new(p.PIN_20, Level::Low),
            Output::new(p.PIN_22, Level::Low),
        ],
    );
    let stop = Input::new(p.PIN_12, Pull::Up);
    let no_receiver = Input::new(p.PIN_28, Pull::Up);
    let mut leds = [Output::new(p.PIN_14, Level::Low), Output::new(p.PIN_25, Level::Low)];

    let identity = Identity { version: image::VERSION, hash: image::hash(), hardware: HARDWARE, after_hang };
    let mut board = Board::new(identity, clock::now());
    loop {
        watchdog.feed(HANG);
        if clock::now() >= outputs.wrap().minus(AHEAD) && !outputs.write(&board.latch(outputs.wrap())) {
            board.latch_was_late();
        }
        let now = clock::now();
        line.receive(|bytes| board.receive(bytes, now));
        imu.receive(|byte| board.receive_imu(byte));
        board.turn(
            Inputs {
                encoder: gates.encoder(),
                gates: gates.read(),
                receiver: no_receiver.is_high(),
                stop: stop.is_high(),
            },
            now,
        );
        if let Some(visit) = board.visit(now) {
            let (first, second) = analog.convert(&visit);
            board.converted(first, second, now);
            analog.select(board.selected());
        }
        line.transmit(|| board.transmit());
        for led in &mut leds {
            led.set_level(Level::from(board.led(now)));
        }
        clock::sleep_until(board.next_turn(now).min(outputs.wrap().minus(AHEAD)));
    }
}
