//! The work of each figure: always the same, from seeds; what it needs is made before it is measured.

mod driving;
mod planning;

use fleet_tests::ratios::Figure;
use xtb_nav::rooms::RoomKind;

/// One measurement's work.
pub(crate) struct Work {
    /// So many of [`Figure::unit`].
    pub(crate) units: f64,
    pub(crate) run: Box<dyn FnMut()>,
}

impl Work {
    fn new(units: f64, run: impl FnMut() + 'static) -> Self {
        Self { units, run: Box::new(run) }
    }

    pub(crate) fn of(figure: Figure) -> Self {
        match figure {
            Figure::ControllerStep => driving::controller_steps(),
            Figure::RobotTurn => driving::robot_turns(),
            // Steps of 5 ms, as many at a time as nobody has to hear of anybody.
            Figure::OneRobot => driving::wanderers(1, 4000),
            Figure::TenRobots => driving::wanderers(10, 1000),
            Figure::HundredRobots => driving::wanderers(100, 80),
            Figure::ThousandRobots => driving::wanderers(1000, 40),
            Figure::TenWithGoals => driving::drivers(10, 400),
            Figure::BoardFrame => driving::board_frames(),
            Figure::StateMessage => driving::state_messages(),
            Figure::PlanOpen => planning::single_plans(RoomKind::Open),
            Figure::PlanCluttered => planning::single_plans(RoomKind::Cluttered),
            Figure::PlanDoors => planning::single_plans(RoomKind::Doors),
            Figure::ObstacleScan => planning::obstacle_scans(),
            Figure::JointPlan => planning::joint_plans(),
            Figure::PlanTwenty => planning::offline_plan(),
            Figure::Assignment => planning::assignments(),
            Figure::MapRaster => planning::rectangles(),
            Figure::BadDays => driving::scenarios(),
        }
    }
}
