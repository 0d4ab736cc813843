//! What is measured: names, units, and the reference that each figure stands beside.

/// A fixed work that figures are compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// Integers, floating-point numbers and branches, within the first-level cache.
    Compute,
    /// Reads that each wait for the one before, over 8 MiB.
    Memory,
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Figure {
    /// Samples into the first-level controller.
    ControllerStep,
    /// Bytes of board and gyro into a whole robot, frames out.
    RobotTurn,
    /// A robot alone in the simulator.
    OneRobot,
    /// Ten that wander.
    TenRobots,
    /// A hundred that wander.
    HundredRobots,
    /// A thousand that wander.
    ThousandRobots,
    /// Ten with planned goals, which hear each other and plan.
    TenWithGoals,
    /// Frames of the I/O board, written and read.
    BoardFrame,
    /// A state, written and read.
    StateMessage,
    /// Single plans in the open room of docs/navigation.md.
    PlanOpen,
    /// Single plans in the cluttered room.
    PlanCluttered,
    /// Single plans in the room of doors and dead ends.
    PlanDoors,
    /// A scan into the obstacle layer.
    ObstacleScan,
    /// Traffic control's plan for five robots at a door.
    JointPlan,
    /// `plan` for twenty cars.
    PlanTwenty,
    /// The dispatcher gives tasks to robots.
    Assignment,
    /// Rectangles drawn on a map.
    MapRaster,
    /// Fault scenarios of a fleet.
    BadDays,
}

impl Figure {
    /// All of them, in the order of the table.
    pub const ALL: [Self; 18] = [
        Self::ControllerStep,
        Self::RobotTurn,
        Self::OneRobot,
        Self::TenRobots,
        Self::HundredRobots,
        Self::ThousandRobots,
        Self::TenWithGoals,
        Self::BoardFrame,
        Self::StateMessage,
        Self::PlanOpen,
        Self::PlanCluttered,
        Self::PlanDoors,
        Self::ObstacleScan,
        Self::JointPlan,
        Self::PlanTwenty,
        Self::Assignment,
        Self::MapRaster,
        Self::BadDays,
    ];

    /// Its name in tables and files.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// What its work is counted in.
    #[must_use]
    pub fn unit(self) -> &'static str {
        self.words().1
    }

    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::ControllerStep => ("controller step", "step"),
            Self::RobotTurn => ("robot turn", "turn"),
            Self::OneRobot => ("simulator, 1 robot", "robot-second"),
            Self::TenRobots => ("simulator, 10 robots", "robot-second"),
            Self::HundredRobots => ("simulator, 100 robots", "robot-second"),
            Self::ThousandRobots => ("simulator, 1000 robots", "robot-second"),
            Self::TenWithGoals => ("simulator, 10 robots, planned goals", "robot-second"),
            Self::BoardFrame => ("board frame, encode and decode", "frame"),
            Self::StateMessage => ("state message, encode and decode", "message"),
            Self::PlanOpen => ("single plan, open room", "plan"),
            Self::PlanCluttered => ("single plan, cluttered room", "plan"),
            Self::PlanDoors => ("single plan, doors and dead ends", "plan"),
            Self::ObstacleScan => ("obstacle layer update", "scan"),
            Self::JointPlan => ("joint plan of traffic control, 5 robots", "plan"),
            Self::PlanTwenty => ("offline plan, 20 cars", "schedule"),
            Self::Assignment => ("assignment, 100 robots, 300 tasks", "round"),
            Self::MapRaster => ("map raster", "rectangle"),
            Self::BadDays => ("fault scenarios", "fleet-second"),
        }
    }

    /// What it is compared with: what does not fit into the caches is slowed by other things than the rest.
    #[must_use]
    pub fn reference(self) -> Reference {
        match self {
            Self::ThousandRobots | Self::MapRaster => Reference::Memory,
            _ => Reference::Compute,
        }
    }

    /// Whether the short form has it too.
    #[must_use]
    pub fn is_short(self) -> bool {
        self != Self::ThousandRobots
    }
}
