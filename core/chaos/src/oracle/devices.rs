//! What a truck's broken devices demand: for how long each has been broken, and what must stand by now.

use super::{Broken, Invariant};
use crate::time::{Turn, ms};
use xtb_control::PwmCount;
use xtb_control::vehicle::SLOTS;
use xtb_protocol::messages::Latch;
use xtb_sim::faults::{
    DriveFault, EncoderFault, GyroFault, InjectedLineFault, RangeFinderFault, SensorFaults,
};
use xtb_sim::receiver::Transmitter;

/// A line without a good frame: 150 ms, plus the longest time between two frames of a kind, doubled.
const LINE: Turn = ms(260);
/// A device that repeats itself: a quarter of a second and four samples, 38 ms apart at most.
const FROZEN: Turn = ms(450);
/// A range finder that repeats itself while the wheels turn: 50 scans of 38 ms.
const FINDER_FROZEN: Turn = ms(2500);
/// Five scans that cannot be.
const FINDER_BROKEN: Turn = ms(350);
/// Windows of 52 ms with rng instead of pulses: two in a row that cannot be, most of them being so.
const WILD: Turn = ms(1000);
/// A motor that is driven and wheels that do not turn: the limit, and the way to the motor.
const STALL: Turn = ms(1050);
/// Wheels that turn by themselves: coasting may take a second, the rule 300 ms, the windows the rest.
const RUNAWAY: Turn = ms(2500);
/// A battery below its last level for 2 s, in scans of 38 ms.
const BATTERY: Turn = ms(2600);
/// Lower than the level of 6.6 V by more than a converter's count.
const EMPTY_V: f64 = 6.57;
/// Driven by hand, and faster than the obstacle rule can stop: 0.43 m/s and what a window hides.
const FAST_MPS: f64 = 0.5;
const FAST: Turn = ms(200);
/// Ten missing frames of the receiver (233 ms), a scan and the turn.
pub(super) const STICKS: Turn = ms(300);
/// A transmitter that has been on manual for so long has taken over.
const TAKEN_OVER: Turn = ms(400);
/// In parts of a stick's way of 500 µs: the dead band of 30 µs, and two ticks of 1.6 µs by which a pulse may be read
/// nearer to neutral than it is (jitter and rounding).
const NEUTRAL_STICK: f64 = (30.0 + 2.0 * 1.6) / 500.0;
/// Three frames of the receiver: then the agent knows what the selector says.
const NOTICED: Turn = ms(65);
/// A board whose line is whole again is set up by then, and its receiver heard.
const SET_UP: Turn = ms(400);
/// A pulse this far from neutral turns the wheels: the dead band ends at 75 counts.
const DRIVEN_COUNTS: u16 = 100;

/// What is true of a truck, beside its agent.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Truth<'a> {
    pub(crate) transmitter: Transmitter,
    pub(crate) board_line: InjectedLineFault,
    pub(crate) gyro_line: InjectedLineFault,
    /// Board and gyro.
    pub(crate) plugged: [bool; 2],
    pub(crate) sensors: &'a SensorFaults,
    /// None of them is broken.
    pub(crate) sensors_well: bool,
    pub(crate) drive: DriveFault,
    pub(crate) battery_v: f64,
    pub(crate) speed_mps: f64,
    pub(crate) motor: u16,
    /// The agent took a turn just now.
    pub(crate) turned: bool,
}

impl Truth<'_> {
    /// Whether frames of the agent reach the board.
    pub(super) fn reaches(&self) -> bool {
        self.turned && self.plugged[0]
    }

    /// Lines, sensors and battery are as they should be: no clock of theirs runs.
    fn is_calm(&self) -> bool {
        let lines = [self.board_line, self.gyro_line] == [InjectedLineFault::None; 2];
        lines && self.plugged == [true; 2] && self.sensors_well && self.battery_v >= EMPTY_V
    }

    /// Whether all that the board sends reaches the agent.
    fn hears(&self) -> bool {
        self.reaches() && self.board_line == InjectedLineFault::None
    }
}

/// Since when something is so; later than any turn = it is not.
#[derive(Debug, Clone, Copy)]
struct Since(Turn);

impl Default for Since {
    fn default() -> Self {
        Self(Turn::MAX)
    }
}

impl Since {
    /// For how long it has been so, now that it is or is not.
    fn update(&mut self, now: Turn, so: bool) -> Turn {
        self.0 = if so { self.0.min(now) } else { Turn::MAX };
        self.lasts(now)
    }

    /// For how long it has been so.
    fn lasts(self, now: Turn) -> Turn {
        now.saturating_sub(self.0)
    }

    /// Not so for long, as it has not been so for more than `limit` yet.
    fn restart(&mut self, now: Turn, limit: Turn) {
        if self.0 != Turn::MAX && self.lasts(now) <= limit {
            self.0 = now;
        }
    }
}

/// What must stand because of a truck's devices and its transmitter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Demand {
    /// Whatever the network sent is over.
    pub(super) network: Option<&'static str>,
    /// The transmitter must not drive either.
    pub(super) sticks: bool,
}

/// The same without the transmitter's part.
#[derive(Debug, Clone, Copy, Default)]
struct Lost {
    network: Option<&'static str>,
    sticks: bool,
    /// The board is.
    board: bool,
}

/// The clocks of one truck's devices. They run on when its agent dies.
#[derive(Debug, Default)]
pub(super) struct Devices {
    off: Since,
    /// As the agent hears it, and as it is.
    manual: Since,
    selected: Since,
    heard: Since,
    board: Since,
    board_frozen: Since,
    gyro: Since,
    gyro_frozen: Since,
    /// Nothing was wrong at the last turn, and no sensor broken.
    calm: bool,
    sensors_well: bool,
    converter: Since,
    finders: [RangeFinderFault; 2 * SLOTS],
    finder_frozen: Since,
    finder_broken: Since,
    wild: Since,
    stalled: Since,
    runaway: Since,
    empty: Since,
    fast: Since,
    /// When the selector was on manual last.
    pub(super) manual_last: Option<Turn>,
    /// Somebody held the lease when it was set to manual.
    taken_from_owner: bool,
    /// The stick was seen neutral since the agent's boot or since the board was lost.
    pub(super) stick_free: bool,
    /// When it was so last.
    at_rest: Option<Turn>,
}

impl Devices {
    /// As a new agent has to find it all out.
    pub(super) fn anew(&self) -> Self {
        Self { manual_last: self.manual_last, ..Self::default() }
    }

    /// No time from before counts for the agent; what it has found to be broken stays so.
    pub(super) fn clock_went_back(&mut self, now: Turn) {
        self.empty.restart(now, BATTERY);
    }

    /// Latches were reset. A reset never moves: a stick that they held must be let go first.
    pub(super) fn reset(&mut self, now: Turn, held_sticks: bool) {
        // A selector that the agent has not seen yet is itself the new command.
        let manual = self.selected.lasts(now) > NOTICED;
        // One that was at rest a moment ago: a frame of it may still come, after the reset.
        let rests = self.at_rest.is_some_and(|at| now - at <= NOTICED);
        self.stick_free &= !(held_sticks && manual) || rests;
        self.taken_from_owner = false;
    }

    /// One turn. What an agent cannot hear it need not obey. `owned`: somebody holds its lease.
    pub(super) fn update(&mut self, now: Turn, truth: &Truth<'_>, owned: bool) -> Demand {
        let calm = truth.is_calm();
        let lost = if std::mem::replace(&mut self.calm, calm) && calm {
            Lost::default()
        } else {
            self.lost(now, truth)
        };
        let (off, taken_over) = self.transmitter(now, truth, lost.board, owned);
        let network = (lost.network)
            .or(off.then_some("the transmitter is off"))
            .or(taken_over.then_some("the transmitter has taken over"));
        Demand { network, sticks: lost.sticks }
    }

    /// What lines, sensors and battery demand.
    fn lost(&mut self, now: Turn, truth: &Truth<'_>) -> Lost {
        let frozen = |fault| fault == InjectedLineFault::Frozen;
        let dead = |fault| {
            !matches!(
                fault,
                InjectedLineFault::None | InjectedLineFault::Lossy(_) | InjectedLineFault::Frozen
            )
        };
        let board = self.board.update(now, dead(truth.board_line) || !truth.plugged[0]) > LINE;
        // A device that is unplugged repeats nothing: that it does shows some time after it is plugged in, and to an
        // agent that was held up some time after it looks again.
        let board_repeats = truth.reaches() && frozen(truth.board_line);
        let board_frozen = self.board_frozen.update(now, board_repeats) > FROZEN;
        let gyro = self.gyro.update(now, dead(truth.gyro_line) || !truth.plugged[1]) > LINE;
        let hears_gyro = truth.turned && truth.plugged[1] && truth.gyro_line == InjectedLineFault::None;
        let gyro_repeats = (truth.turned && truth.plugged[1] && frozen(truth.gyro_line))
            || (hears_gyro && truth.sensors.gyro != GyroFault::None);
        let gyro_frozen = self.gyro_frozen.update(now, gyro_repeats) > FROZEN;
        let sensors = self.sensors(now, truth);
        let measured = truth.hears() && !truth.sensors.battery_unmeasured && !truth.sensors.converter_frozen;
        let empty = self.empty.update(now, measured && truth.battery_v < EMPTY_V) > BATTERY;
        let network = (board.then_some("the board's line is broken"))
            .or(board_frozen.then_some("the board repeats one frame"))
            .or(gyro.then_some("the gyro's line is broken"))
            .or(gyro_frozen.then_some("the gyro repeats one frame"))
            .or(sensors)
            .or(empty.then_some("the battery is empty"));
        let board = board || board_frozen;
        Lost { network, sticks: board || gyro_frozen || sensors.is_some() || empty, board }
    }

    fn sensors(&mut self, now: Turn, truth: &Truth<'_>) -> Option<&'static str> {
        // Nothing was broken and nothing is: no clock runs.
        if std::mem::replace(&mut self.sensors_well, truth.sensors_well) && truth.sensors_well {
            return None;
        }
        let (finders, none) = (&truth.sensors.range_finders, &SensorFaults::default().range_finders);
        // Of another one it shows anew.
        let same = std::mem::replace(&mut self.finders, *finders) == *finders;
        let faulty = same && finders != none;
        let any = |one: RangeFinderFault| faulty && finders.contains(&one);
        // Scans that do not arrive show nothing.
        let heard = truth.hears();
        let turning = truth.speed_mps.abs() > 0.05;
        let converter = self.converter.update(now, heard && truth.sensors.converter_frozen) > FROZEN;
        let frozen = heard && turning && any(RangeFinderFault::Frozen);
        let finder_frozen = self.finder_frozen.update(now, frozen) > FINDER_FROZEN;
        let broken = heard && (any(RangeFinderFault::BrokenWire) || any(RangeFinderFault::Short));
        // A converter that hangs shows what it saw before the wire broke.
        let broken =
            self.finder_broken.update(now, broken && !truth.sensors.converter_frozen) > FINDER_BROKEN;
        let wild = self.wild.update(now, heard && truth.sensors.encoder == EncoderFault::Wild) > WILD;
        (converter.then_some("the converter repeats one frame"))
            .or(finder_frozen.then_some("a range finder repeats one reading"))
            .or(broken.then_some("a range finder's wire is broken"))
            .or(wild.then_some("the encoder reports impossible values"))
    }

    /// Whether it is off for certain, and whether it has taken over for certain.
    fn transmitter(&mut self, now: Turn, truth: &Truth<'_>, board_lost: bool, owned: bool) -> (bool, bool) {
        let Transmitter { on, speed, selector_manual, .. } = truth.transmitter;
        let heard = on && truth.hears();
        let before = self.manual_last;
        if on && selector_manual {
            self.manual_last = Some(now);
        }
        // What may have been heard counts: a line that loses some frames brings others.
        let lossy = matches!(truth.board_line, InjectedLineFault::Lossy(_));
        let may_be_heard = heard || (on && truth.reaches() && lossy);
        if board_lost {
            self.stick_free = false;
        } else if may_be_heard && speed.abs() < NEUTRAL_STICK {
            self.stick_free = true;
            self.at_rest = Some(now);
        }
        let off = self.off.update(now, !on) > STICKS;
        let manual = self.manual.update(now, selector_manual && heard);
        let selected = self.selected.update(now, on && selector_manual);
        if selected == 0 && on && selector_manual {
            self.taken_from_owner = before.is_none_or(|before| now - before > TAKEN_OVER);
        }
        let well = self.heard.update(now, truth.hears());
        let settles = well <= SET_UP && well.abs_diff(selected) <= SET_UP;
        if selected <= NOTICED || settles {
            self.taken_from_owner &= owned && heard;
        }
        (off, manual > TAKEN_OVER)
    }

    /// What must not be, whoever drives. `latched` says whether a latch stands in the last state.
    pub(super) fn check(
        &mut self,
        now: Turn,
        truth: &Truth<'_>,
        by_hand: bool,
        latched: impl Fn(Latch) -> bool,
    ) -> Result<(), Broken> {
        let counts = truth.motor.abs_diff(PwmCount::NEUTRAL.get());
        let reached = truth.hears();
        let no_pulses = truth.speed_mps == 0.0 || truth.sensors.encoder == EncoderFault::BrokenWire;
        let driven = reached && counts > DRIVEN_COUNTS;
        if self.stalled.update(now, driven && no_pulses && truth.drive != DriveFault::Stuck) > STALL {
            let detail = format!("driven at {} counts for 1 s without a pulse", truth.motor);
            return Err((Invariant::Devices, detail));
        }
        let counted = truth.sensors.encoder == EncoderFault::None;
        let by_itself = reached && counts == 0 && truth.speed_mps.abs() > 0.1 && counted;
        if self.runaway.update(now, by_itself) > RUNAWAY && !latched(Latch::Runaway) {
            let detail = format!("{:.2} m/s without a command, but no latch is set", truth.speed_mps);
            return Err((Invariant::Devices, detail));
        }
        let taken = self.manual.lasts(now) > TAKEN_OVER + ms(100);
        if taken && self.taken_from_owner && !latched(Latch::RemoteTakeover) {
            let detail = "the transmitter took over from the network, but no latch is set".to_owned();
            return Err((Invariant::Latched, detail));
        }
        let same_way = (truth.speed_mps > 0.0) == (truth.motor > PwmCount::NEUTRAL.get());
        let fast = driven && by_hand && same_way && truth.speed_mps.abs() > FAST_MPS && !no_pulses;
        if self.fast.update(now, fast && truth.sensors.encoder == EncoderFault::None) > FAST {
            let detail = format!("driven by hand at {:.2} m/s", truth.speed_mps);
            return Err((Invariant::Devices, detail));
        }
        Ok(())
    }
}
