//! Short scripts for what chance alone would rarely bring about: each with an actor of its own, mixed into
//! the day at a random time.

use crate::change::{Change, End};
use crate::time::{Turn, ms, turns};
use xtb_protocol::codec::{self, Format};
use xtb_protocol::messages::{Body, LinkLoss, Request};
use xtb_sim::faults::{DriveFault, EncoderFault, InjectedLineFault, RangeFinderFault, SensorFaults};
use xtb_sim::receiver::Transmitter;
use xtb_sim::rng::Rng;

/// What an actor does at a time.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Act {
    /// Asks, with the lease that it holds.
    Ask(Body),
    /// Asks without a lease.
    AskBare(Body),
    /// Asks with the first lease that it ever had.
    AskOld(Body),
    /// Sends its last goal again, under the same id.
    Again,
    /// Holds the joystick there, whatever happens.
    Stick { rpm: f64, steering: f64 },
    /// Lets the joystick go: no more setpoints.
    LetGo,
    /// Sends the same setpoint again.
    Repeat,
    /// Calls an emergency stop, once.
    Estop,
    /// Its program dies.
    Die,
}

/// What goes wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Plot {
    StickThroughEstop,
    StickThroughStop,
    StickThroughTakeover,
    HeldBurst,
    RepeatedSetpoint,
    RetryAfterStop,
    StopInTheSameTurn,
    TakenOver,
    CommandWhileLatched,
    ResetTooEarly,
    NoLease,
    OldLease,
    DeadHolder,
    RebootInMidGoal,
    StalledLoop,
    FrozenGyro,
    FrozenFinder,
    BrokenFinder,
    SilentGyro,
    WildEncoder,
    Runaway,
    HeldWheels,
    EmptyBattery,
    FastSticks,
    IntoTheWall,
    IntoTheWallByHand,
}

const PLOTS: [Plot; 30] = [
    Plot::StickThroughEstop,
    Plot::StickThroughStop,
    Plot::StickThroughTakeover,
    Plot::HeldBurst,
    Plot::RepeatedSetpoint,
    Plot::RetryAfterStop,
    Plot::StopInTheSameTurn,
    Plot::TakenOver,
    Plot::CommandWhileLatched,
    Plot::ResetTooEarly,
    Plot::NoLease,
    Plot::OldLease,
    Plot::DeadHolder,
    Plot::RebootInMidGoal,
    Plot::StalledLoop,
    Plot::StalledLoop,
    Plot::StalledLoop,
    Plot::FrozenGyro,
    Plot::FrozenFinder,
    Plot::BrokenFinder,
    Plot::SilentGyro,
    Plot::WildEncoder,
    Plot::Runaway,
    Plot::HeldWheels,
    Plot::EmptyBattery,
    Plot::FastSticks,
    Plot::IntoTheWall,
    Plot::IntoTheWallByHand,
    Plot::IntoTheWallByHand,
    Plot::ResetTooEarly,
];

/// A speed stick for 0.36 m/s, below what the obstacle rule can stop, and a steering stick for the servo's
/// own centre.
const SLOWLY: f64 = 0.2;
const STRAIGHT_ON: f64 = 0.032;
/// Time that an actor needs to get its lease.
const READY: Turn = ms(600);

/// A script with its actor, its robot and its time.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    plot: Plot,
    at: Turn,
    pub(crate) robot: u8,
    /// The actor's number among the people.
    pub(crate) person: u8,
    /// Something between 0 and 1 that each plot uses as it likes.
    part: f64,
    /// Steering of sticks and joysticks, goals' places.
    aside: f64,
}

impl Scene {
    /// At most one for two robots, each with a person of its own after the `people`.
    pub(crate) fn draw(rng: &mut Rng, robots: usize, people: usize, length: Turn) -> Vec<Self> {
        let scenes = 1 + rng.up_to(robots as u64 / 2 + 1);
        let scene = |i: u64| Self {
            plot: PLOTS[rng.up_to(PLOTS.len() as u64 - 1) as usize],
            at: rng.uniform(200.0, f64::from(length.saturating_sub(turns(5.0)).max(300))) as Turn,
            robot: rng.up_to(robots as u64 - 1) as u8,
            person: (people as u64 + i) as u8,
            part: rng.uniform(0.0, 1.0),
            aside: rng.uniform(-1.0, 1.0),
        };
        (0..scenes).map(scene).collect()
    }

    fn goto(&self, policy: LinkLoss) -> Body {
        let (x_m, y_m) = (4.0 * self.aside, 5.0 * self.part);
        Body::Goto { x_m, y_m, yaw_rad: None, via: None, on_link_loss: policy, finish_s: 30.0 }
    }

    /// What the actor does, with times since the day began.
    pub(crate) fn script(&self) -> Vec<(Turn, Act)> {
        let (halt, finish) = (self.goto(LinkLoss::Halt), self.goto(LinkLoss::Finish));
        let wander = Body::Wander { for_s: None, on_link_loss: LinkLoss::Finish, finish_s: 30.0 };
        let rpm = if self.part < 0.5 { 20.0 } else { -20.0 };
        let stick = Act::Stick { rpm, steering: self.aside };
        let reset = || Act::Ask(Body::Reset { latch: None });
        let acts: Vec<(Turn, Act)> = match self.plot {
            Plot::StickThroughEstop => {
                vec![(0, stick), (ms(800), Act::Estop), (ms(1400), reset()), (ms(3000), Act::LetGo)]
            }
            Plot::StickThroughStop => {
                vec![(0, stick), (ms(800), Act::Ask(Body::Stop {})), (ms(2500), Act::LetGo)]
            }
            Plot::StickThroughTakeover => {
                vec![(0, stick), (ms(2000), reset()), (ms(2500), reset()), (ms(3500), Act::LetGo)]
            }
            Plot::HeldBurst => vec![(0, stick), (ms(1200), Act::Die)],
            Plot::RepeatedSetpoint => {
                let again = (0..8).map(|i| (ms(1000 + 35 * i), Act::Repeat));
                [(0, stick), (ms(990), Act::LetGo)].into_iter().chain(again).collect()
            }
            Plot::RetryAfterStop => {
                vec![(0, Act::Ask(halt)), (ms(800), Act::Ask(Body::Stop {})), (ms(1200), Act::Again)]
            }
            Plot::StopInTheSameTurn => vec![(0, Act::Ask(finish)), (0, Act::Ask(Body::Stop {}))],
            Plot::TakenOver => vec![(0, Act::Ask(wander))],
            Plot::CommandWhileLatched => {
                let go = Act::Ask(finish);
                vec![(0, Act::Ask(wander)), (ms(500), Act::Estop), (ms(1000), go), (ms(1200), stick)]
            }
            Plot::ResetTooEarly => {
                vec![(0, Act::Ask(wander)), (ms(1500), reset()), (ms(1700), Act::Ask(finish))]
            }
            Plot::NoLease => vec![(0, Act::Ask(Body::Release {})), (ms(200), Act::AskBare(finish))],
            Plot::OldLease => vec![
                (0, Act::Ask(Body::Release {})),
                (ms(300), Act::Ask(Body::Acquire { take: true })),
                (ms(800), Act::AskOld(finish)),
            ],
            Plot::DeadHolder => vec![(0, Act::Ask(halt)), (ms(700), Act::Die)],
            Plot::RebootInMidGoal => vec![(0, Act::Ask(wander)), (ms(1500), Act::AskOld(finish))],
            Plot::StalledLoop => vec![(0, Act::Ask(wander))],
            Plot::FrozenGyro
            | Plot::SilentGyro
            | Plot::WildEncoder
            | Plot::HeldWheels
            | Plot::EmptyBattery => {
                vec![(0, Act::Ask(finish))]
            }
            Plot::FrozenFinder | Plot::BrokenFinder => vec![(0, Act::Ask(wander))],
            Plot::Runaway => vec![(0, stick), (ms(1500), Act::Ask(Body::Stop {})), (ms(1500), Act::LetGo)],
            Plot::FastSticks | Plot::IntoTheWallByHand => vec![(0, Act::Ask(Body::Release {}))],
            Plot::IntoTheWall => vec![(0, Act::Stick { rpm, steering: 0.0 })],
        };
        let take = (self.at, Act::Ask(Body::Acquire { take: true }));
        let start = self.at + READY;
        std::iter::once(take).chain(acts.into_iter().map(|(after, act)| (start + after, act))).collect()
    }

    /// What else happens.
    pub(crate) fn changes(&self) -> Vec<(Turn, Change)> {
        let (robot, start) = (self.robot, self.at + READY);
        let manual =
            Transmitter { selector_manual: true, speed: 0.0, steering: self.aside, ..Transmitter::default() };
        let sticks = |transmitter| Change::Sticks { robot, transmitter };
        let sensors = |faults| Change::Sensors { robot, faults };
        let drive = |fault| Change::Drive { robot, fault };
        let changes: Vec<(Turn, Change)> = match self.plot {
            Plot::StickThroughTakeover | Plot::TakenOver => {
                vec![(ms(800), sticks(manual)), (ms(1600), sticks(Transmitter::default()))]
            }
            Plot::HeldBurst => {
                vec![(ms(700), Change::HoldLink { end: End::Person(self.person), turns: ms(1300) })]
            }
            Plot::ResetTooEarly => vec![
                (ms(800), Change::BoardLine { robot, fault: InjectedLineFault::Silent }),
                (ms(2500), Change::BoardLine { robot, fault: InjectedLineFault::None }),
            ],
            Plot::RebootInMidGoal => vec![(ms(800), Change::KillAgent { robot, turns: ms(300) })],
            Plot::StalledLoop => {
                vec![(ms(800), Change::HoldLoop { robot, turns: ms(120 + (45.0 * self.part) as u32) })]
            }
            Plot::FrozenGyro => vec![
                (ms(800), Change::GyroLine { robot, fault: InjectedLineFault::Frozen }),
                (ms(4000), Change::GyroLine { robot, fault: InjectedLineFault::None }),
            ],
            Plot::FrozenFinder => {
                let finder = (self.part * 6.0) as usize;
                let frozen = SensorFaults::range_finder(finder, RangeFinderFault::Frozen);
                vec![(0, sensors(frozen)), (ms(7000), sensors(SensorFaults::default()))]
            }
            Plot::BrokenFinder => {
                let finder = (self.part * 12.0) as usize;
                let broken = SensorFaults::range_finder(finder, RangeFinderFault::BrokenWire);
                vec![(ms(1000), sensors(broken)), (ms(4000), sensors(SensorFaults::default()))]
            }
            Plot::SilentGyro => vec![
                (ms(800), Change::GyroLine { robot, fault: InjectedLineFault::Silent }),
                (ms(3000), Change::GyroLine { robot, fault: InjectedLineFault::None }),
            ],
            Plot::IntoTheWallByHand => {
                let speed = if self.part < 0.5 { SLOWLY } else { -SLOWLY };
                let ahead = Transmitter { speed, steering: STRAIGHT_ON, ..manual };
                vec![
                    (ms(500), sticks(manual)),
                    (ms(1000), sticks(ahead)),
                    (ms(20_000), sticks(Transmitter::default())),
                ]
            }
            Plot::WildEncoder => {
                let wild = SensorFaults { encoder: EncoderFault::Wild, ..SensorFaults::default() };
                vec![(ms(1000), sensors(wild)), (ms(4000), sensors(SensorFaults::default()))]
            }
            Plot::Runaway => vec![(ms(1400), drive(DriveFault::Stuck)), (ms(8000), drive(DriveFault::None))],
            Plot::HeldWheels => {
                vec![(ms(1000), drive(DriveFault::Held)), (ms(5000), drive(DriveFault::None))]
            }
            Plot::EmptyBattery => vec![(ms(300), Change::Battery { robot, left: 0.0 })],
            Plot::FastSticks => {
                let fast = Transmitter { speed: 0.6 * self.aside.signum(), steering: 0.0, ..manual };
                vec![
                    (ms(500), sticks(manual)),
                    (ms(1000), sticks(fast)),
                    (ms(4000), sticks(Transmitter::default())),
                ]
            }
            _ => Vec::new(),
        };
        changes.into_iter().map(|(after, change)| (start + after, change)).collect()
    }
}

/// The request that bytes hold, if they hold one.
pub(crate) fn decoded(bytes: &[u8]) -> Option<Request> {
    codec::decode::<Request>(&codec::encoding::<Request>(Format::Postcard), bytes)
        .ok()
        .map(|(request, _)| request)
}

/// The request as it is after it has crossed as bytes.
pub(crate) fn crossed(request: Request) -> Request {
    let bytes = codec::encode(&request, Format::Postcard).unwrap_or_default();
    decoded(&bytes).unwrap_or(request)
}

/// A request as bytes, some of them damaged: cut short, one bit turned, one too many, far too many, or rng.
pub(crate) fn damaged(request: &Request, rng: &mut Rng) -> Vec<u8> {
    let mut bytes = codec::encode(request, Format::Postcard).unwrap_or_default();
    let place = rng.up_to(bytes.len().max(1) as u64 - 1) as usize;
    match rng.up_to(4) {
        0 => bytes.truncate(place),
        1 => {
            if let Some(byte) = bytes.get_mut(place) {
                *byte ^= 1 << rng.up_to(7);
            }
        }
        2 => bytes.push(0),
        3 => bytes.resize(xtb_protocol::wire::MAX_BYTES + 1, 0),
        _ => bytes = (0..rng.up_to(200)).map(|_| rng.up_to(255) as u8).collect(),
    }
    bytes
}
