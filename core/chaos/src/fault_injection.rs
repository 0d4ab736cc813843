//! Carries out what the plan says.

use crate::change::{Change, End, Sender};
use crate::event_log::Happened;
use crate::network::{Message, Parcel};
use crate::scenario::Scenario;
use crate::scripts;
use xtb_sim::faults::SensorFaults;
use xtb_sim::rng::Rng;

impl Scenario {
    pub(super) fn apply(&mut self, change: Change) {
        let now = self.now;
        self.event_log.note(now, about(change), Happened::Changed(change));
        match change {
            Change::KillAgent { robot, turns } => {
                let post = &mut self.posts[usize::from(robot)];
                post.process.kill(now + turns);
                post.oracle.killed();
                self.network.close(End::Robot(robot), turns);
            }
            Change::HoldLoop { robot, turns } => self.posts[usize::from(robot)].process.hold(now + turns),
            Change::FreezeAgent { robot, turns } => {
                self.posts[usize::from(robot)].process.hold(now + turns);
                self.network.hold(End::Robot(robot), turns);
            }
            Change::JumpClock { robot, ms } => {
                let post = &mut self.posts[usize::from(robot)];
                post.process.jump_clock(ms);
                if ms < 0 {
                    post.oracle.clock_went_back(now);
                }
            }
            Change::StickClock { robot, turns } => {
                self.posts[usize::from(robot)].process.stick_clock(now + turns);
            }
            Change::HoldLink { end, turns } => self.network.hold(end, turns),
            Change::CloseLink { end, turns } => self.network.close(end, turns),
            Change::KillRouter { turns } => self.network.kill_router(turns),
            Change::BoardLine { robot, fault } => {
                self.posts[usize::from(robot)].lines.board = fault;
                self.set_lines(robot);
            }
            Change::GyroLine { robot, fault } => {
                self.posts[usize::from(robot)].lines.gyro = fault;
                self.set_lines(robot);
            }
            Change::Plug { robot, board, plugged } => {
                let post = &mut self.posts[usize::from(robot)];
                post.plugged[usize::from(!board)] = plugged;
                post.process.plug(board, plugged);
            }
            Change::PowerCycle { robot } => {
                self.posts[usize::from(robot)].oracle.board_lost();
                self.simulation.trucks_mut()[usize::from(robot)].power_cycle_board();
            }
            Change::Sticks { robot, transmitter } => {
                self.posts[usize::from(robot)].transmitter = transmitter;
                self.simulation.trucks_mut()[usize::from(robot)].set_transmitter(transmitter);
            }
            Change::Sensors { robot, faults } => {
                let post = &mut self.posts[usize::from(robot)];
                (post.sensors, post.sensors_well) = (faults, faults == SensorFaults::default());
                self.simulation.trucks_mut()[usize::from(robot)].set_sensor_faults(faults);
            }
            Change::Drive { robot, fault } => {
                self.posts[usize::from(robot)].drive = fault;
                self.simulation.trucks_mut()[usize::from(robot)].set_drive_fault(fault);
            }
            Change::Battery { robot, left } => {
                self.simulation.trucks_mut()[usize::from(robot)].set_battery_left(left);
            }
            Change::KillPerson { person } => self.people[usize::from(person)].die(),
            Change::FreezePerson { person, turns } => self.people[usize::from(person)].freeze(now + turns),
            Change::Flood { person, robot, a_turn, turns } => {
                self.people[usize::from(person)].flood(robot, a_turn, now + turns);
            }
            Change::Replay { person, messages } => self.replay(person, messages),
            Change::Damaged { person, robot } => self.send_damaged(person, robot),
        }
    }

    fn set_lines(&mut self, robot: u8) {
        let faults = self.posts[usize::from(robot)].lines;
        self.simulation.trucks_mut()[usize::from(robot)].set_line_faults(faults);
    }

    /// Somebody who has listened sends some of it again, under the names of those who sent it first.
    fn replay(&mut self, person: u8, messages: u8) {
        for _ in 0..messages {
            let Some(mut parcel) = self.network.overheard() else { return };
            parcel.by = Sender { person, ..parcel.by };
            self.network.send(parcel);
        }
    }

    fn send_damaged(&mut self, person: u8, robot: u8) {
        let Some(Parcel { message: Message::Ask(request), .. }) = self.network.overheard() else { return };
        let mut rng = Rng::new(u64::from(self.now), u64::from(robot));
        for _ in 0..8 {
            let message = Message::Bytes(scripts::damaged(&request, &mut rng));
            self.network.send(Parcel { by: Sender { person, name: person }, robot, message });
        }
    }
}

/// The robot that a change is about; `None` = everybody.
fn about(change: Change) -> Option<u8> {
    match change {
        Change::KillAgent { robot, .. }
        | Change::HoldLoop { robot, .. }
        | Change::FreezeAgent { robot, .. }
        | Change::JumpClock { robot, .. }
        | Change::StickClock { robot, .. }
        | Change::BoardLine { robot, .. }
        | Change::GyroLine { robot, .. }
        | Change::Plug { robot, .. }
        | Change::PowerCycle { robot }
        | Change::Sticks { robot, .. }
        | Change::Sensors { robot, .. }
        | Change::Drive { robot, .. }
        | Change::Battery { robot, .. }
        | Change::Flood { robot, .. }
        | Change::Damaged { robot, .. }
        | Change::HoldLink { end: End::Robot(robot), .. }
        | Change::CloseLink { end: End::Robot(robot), .. } => Some(robot),
        Change::HoldLink { .. }
        | Change::CloseLink { .. }
        | Change::KillRouter { .. }
        | Change::KillPerson { .. }
        | Change::FreezePerson { .. }
        | Change::Replay { .. } => None,
    }
}
