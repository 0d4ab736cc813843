//! Every rule that can make a robot stand or refuse, by name, with one switch for all of them.
//!
//! The switch is there for the mutation check of the virtual fleet (`docs/safety.md`): with a rule switched
//! off, at least one seed must show a violation, or the rule is not tested. It is built with the feature
//! `switchable-guards` only, which tests ask for and no program does (a test of the repository's style looks
//! for that): in the programs every rule is in force.

/// A rule.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Guard {
    /// Commands need the present lease.
    LeaseRequired,
    /// A lease that somebody holds is not granted to another who does not take it.
    LeaseExclusive,
    /// A lease of another boot, or of an earlier grant, counts for nothing.
    LeaseFence,
    /// A lease that is not retained becomes free.
    LeaseExpiry,
    /// A goal that halts on link loss ends when its client falls silent.
    LinkLossHalt,
    /// A setpoint lives 200 ms.
    SetpointLifetime,
    /// A setpoint's number must be above the last one's.
    SetpointSequence,
    /// A setpoint must echo a tick of the robot that is at most 300 ms old.
    SetpointEcho,
    /// A joystick that was held through a stop does not drive on.
    Rearm,
    /// The same request is not done twice.
    Idempotency,
    /// What came before a stop cannot begin after it.
    Overtaken,
    /// An emergency stop is latched.
    Estop,
    /// While a latch is set nothing of the network begins.
    LatchHolds,
    /// A latch whose cause is still there cannot be reset.
    ResetInterlock,
    /// What the network asked for ends when the transmitter takes over.
    RemoteTakeover,
    /// Lost lines stop the robot.
    LineLost,
    /// Frozen sensors stop the robot.
    Frozen,
    /// Readings that cannot be stop the robot.
    OutOfRange,
    /// Wheels that run away stop the robot.
    Runaway,
    /// Wheels that do not turn stop the robot.
    Stall,
    /// An empty battery stops the robot.
    Battery,
    /// A control loop that was held up stops the robot.
    LoopStall,
    /// The motor stands in front of an obstacle.
    Obstacle,
    /// The transmitter drives no faster than the obstacle rule can stop.
    OverSpeed,
}

impl Guard {
    /// All of them.
    pub const ALL: [Self; 24] = [
        Self::LeaseRequired,
        Self::LeaseExclusive,
        Self::LeaseFence,
        Self::LeaseExpiry,
        Self::LinkLossHalt,
        Self::SetpointLifetime,
        Self::SetpointSequence,
        Self::SetpointEcho,
        Self::Rearm,
        Self::Idempotency,
        Self::Overtaken,
        Self::Estop,
        Self::LatchHolds,
        Self::ResetInterlock,
        Self::RemoteTakeover,
        Self::LineLost,
        Self::Frozen,
        Self::OutOfRange,
        Self::Runaway,
        Self::Stall,
        Self::Battery,
        Self::LoopStall,
        Self::Obstacle,
        Self::OverSpeed,
    ];
}

/// Which rules are in force: all of them; for tests, all but at most one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Guards {
    #[cfg(feature = "switchable-guards")]
    off: Option<Guard>,
}

#[cfg(not(feature = "switchable-guards"))]
impl Guards {
    /// Whether a rule is in force: always.
    #[must_use]
    pub const fn on(self, _guard: Guard) -> bool {
        true
    }
}

#[cfg(feature = "switchable-guards")]
impl Guards {
    /// All but this one.
    #[must_use]
    pub fn without(guard: Guard) -> Self {
        Self { off: Some(guard) }
    }

    /// Whether a rule is in force.
    #[must_use]
    pub fn on(self, guard: Guard) -> bool {
        self.off != Some(guard)
    }
}
