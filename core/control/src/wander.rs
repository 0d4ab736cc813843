//! Wander (§4.6, Fig. 13): ahead; at an obstacle reverse for 6 s while turning; stand for 2 s; ahead.
//!
//! Published, the reversing looks at no obstacle. Ours ends it at one behind and goes on to the pause.

use crate::obstacle::ObstacleState;
use crate::units::{Stamp, Steering};
use crate::vehicle::Wander;

/// Where wander stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Straight ahead at V.
    Ahead,
    /// Astern at full lock since the stamp.
    Reversing(Stamp),
    /// Standing since the stamp.
    Pausing(Stamp),
}

/// The stage's memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WanderStage {
    phase: Phase,
    next_side: f64,
}

impl WanderStage {
    /// A new wander command: ahead, and right at the first obstacle.
    #[must_use]
    pub fn new(config: &Wander) -> Self {
        Self { phase: Phase::Ahead, next_side: if config.sides == "left" { -1.0 } else { 1.0 } }
    }

    /// The present phase.
    #[must_use]
    pub fn phase(&self) -> Phase {
        self.phase
    }

    /// The reference that the phase demands, in rpm.
    #[must_use]
    pub fn reference_rpm(&self, config: &Wander) -> f64 {
        match self.phase {
            Phase::Ahead => config.reference_rpm,
            Phase::Reversing(_) => -config.reference_rpm,
            Phase::Pausing(_) => 0.0,
        }
    }

    /// An obstacle ends the driving in its direction. Returns the new steering if the phase changed.
    pub fn obstacle(&mut self, config: &Wander, now: Stamp, seen: ObstacleState) -> Option<Steering> {
        match self.phase {
            Phase::Ahead if seen.front => {
                self.phase = Phase::Reversing(now);
                let side = self.next_side;
                if config.sides == "alternate" {
                    self.next_side = -side;
                }
                Steering::try_from(side).ok()
            }
            Phase::Reversing(_) if seen.rear && config.rear_check => {
                self.phase = Phase::Pausing(now);
                Some(Steering::CENTRED)
            }
            _ => None,
        }
    }

    /// Looks at the timers, after every sample. Returns the new steering if the phase changed.
    pub fn timers(&mut self, config: &Wander, now: Stamp) -> Option<Steering> {
        match self.phase {
            Phase::Reversing(since) if now.since_s(since) >= config.reverse_s => {
                self.phase = Phase::Pausing(now);
                Some(Steering::CENTRED)
            }
            Phase::Pausing(since) if now.since_s(since) >= config.pause_s => {
                self.phase = Phase::Ahead;
                Some(Steering::CENTRED)
            }
            _ => None,
        }
    }
}
