//! Which of a page's commands are taken on. Pure.
//!
//! Bounded: what finds no room is answered `overloaded`, not queued. Emergency stops have room of their
//! own. One page sends a robot one command at a time that takes its control, and a stop overtakes that:
//! what was asked before a stop does not begin after it.

use super::commands::Command;
use std::collections::BTreeMap;
use tokio::sync::oneshot;
use xtb_client::{Error, ErrorKind};
use xtb_protocol::Name;
use xtb_protocol::messages::RejectCode;

/// Commands of one page that are under way.
pub(super) const MOST: usize = 32;
/// Emergency stops of one page that are under way.
pub(super) const MOST_ESTOPS: usize = 64;

/// What is under way for one page.
#[derive(Debug, Default)]
pub(super) struct Orders {
    usual: usize,
    estops: usize,
    /// Commands that take a robot's control, and how they are told of a stop.
    going: BTreeMap<Name, oneshot::Sender<()>>,
    /// A reset of all that is going on.
    resetting_all: Option<oneshot::Sender<()>>,
}

/// A command that was taken on; it is given back when it has ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Ticket {
    estop: bool,
    takes: Option<Name>,
    resets_all: bool,
}

impl Orders {
    /// Takes a command on, or says why not. With it comes word of a stop.
    pub(super) fn admit(
        &mut self,
        command: &Command,
        driving: Option<&Name>,
    ) -> Result<(Ticket, oneshot::Receiver<()>), Error> {
        let estop = matches!(command, Command::Estop { .. });
        let (open, most) = if estop { (&mut self.estops, MOST_ESTOPS) } else { (&mut self.usual, MOST) };
        if *open >= most {
            let message = format!("{most} commands of this page are not answered yet");
            return Err(Error::new(ErrorKind::Refused(RejectCode::Overloaded), message)
                .hint("wait for their answers; for robots that are out of reach this takes some seconds"));
        }
        let takes = match command {
            Command::Goto { robot, .. } | Command::SetPose { robot, .. } | Command::Reset { robot, .. } => {
                Some(robot)
            }
            _ => None,
        };
        if let Some(robot) = takes.filter(|robot| driving == Some(*robot)) {
            let message = format!("this page is driving {robot} by hand");
            return Err(Error::new(ErrorKind::Refused(RejectCode::Busy), message).hint("end that first"));
        }
        if let Some(robot) = takes.filter(|robot| self.going.contains_key(*robot)) {
            let message = format!("the last command to {robot} is not answered yet");
            return Err(Error::new(ErrorKind::Refused(RejectCode::Busy), message).hint("wait for its answer"));
        }
        let resets_all = matches!(command, Command::ResetAll { .. });
        if let Some(robot) = driving.filter(|_| resets_all) {
            let message = format!("this page is driving {robot} by hand");
            return Err(Error::new(ErrorKind::Refused(RejectCode::Busy), message).hint("end that first"));
        }
        if resets_all && self.resetting_all.is_some() {
            let message = "the last reset of all robots is not answered yet";
            return Err(Error::new(ErrorKind::Refused(RejectCode::Busy), message).hint("wait for its answer"));
        }
        *open += 1;
        let (halt, halted) = oneshot::channel();
        if let Some(robot) = takes {
            self.going.insert(robot.clone(), halt);
        } else if resets_all {
            self.resetting_all = Some(halt);
        }
        Ok((Ticket { estop, takes: takes.cloned(), resets_all }, halted))
    }

    /// A stop comes: what is on its way to this robot, or to all, does not begin any more.
    pub(super) fn halt(&mut self, robot: Option<&Name>) {
        if let Some(halt) = self.resetting_all.take() {
            let _ = halt.send(());
        }
        let all = std::mem::take(&mut self.going);
        for (name, halt) in all {
            if robot.is_none_or(|robot| *robot == name) {
                // Who has ended meanwhile needs no word.
                let _ = halt.send(());
            } else {
                self.going.insert(name, halt);
            }
        }
    }

    /// A command has ended.
    pub(super) fn ended(&mut self, ticket: Ticket) {
        let open = if ticket.estop { &mut self.estops } else { &mut self.usual };
        *open = open.saturating_sub(1);
        if ticket.resets_all && self.resetting_all.as_ref().is_some_and(oneshot::Sender::is_closed) {
            self.resetting_all = None;
        }
        if let Some(robot) = &ticket.takes {
            // One that was halted has left already, and a newer one may have taken its place.
            if self.going.get(robot).is_some_and(oneshot::Sender::is_closed) {
                self.going.remove(robot);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake::name;

    fn goto(robot: &str) -> Command {
        let robot = name(robot);
        Command::Goto { robot, x_m: 0.0, y_m: 0.0, yaw_rad: None, via: None, take: false }
    }

    fn stop() -> Command {
        Command::Stop { robot: None }
    }

    #[test]
    fn a_stop_of_anybody_overtakes_a_reset_of_all() {
        let mut orders = Orders::default();
        let refused = orders.admit(&Command::ResetAll { shown: None }, Some(&name("xtb-1"))).unwrap_err();
        assert!(refused.message.contains("driving xtb-1 by hand"), "{refused}");
        let (ticket, mut halted) = orders.admit(&Command::ResetAll { shown: None }, None).unwrap();
        assert!(orders.admit(&Command::ResetAll { shown: None }, None).is_err(), "one at a time");
        assert!(halted.try_recv().is_err());
        orders.halt(Some(&name("xtb-2")));
        assert!(halted.try_recv().is_ok());
        drop(halted);
        let (next, halted) = orders.admit(&Command::ResetAll { shown: None }, None).unwrap();
        orders.ended(ticket);
        assert!(orders.admit(&Command::ResetAll { shown: None }, None).is_err(), "the newer one goes on");
        drop(halted);
        orders.ended(next);
        assert!(orders.admit(&Command::ResetAll { shown: None }, None).is_ok());
    }

    #[test]
    fn what_finds_no_room_is_refused_and_an_emergency_stop_has_room_of_its_own() {
        let mut orders = Orders::default();
        let tickets: Vec<_> = (0..MOST).map(|_| orders.admit(&stop(), None).unwrap().0).collect();
        assert_eq!(orders.admit(&stop(), None).unwrap_err().kind.code(), "overloaded");
        let estop = Command::Estop { robot: None };
        for _ in 0..MOST_ESTOPS {
            assert!(orders.admit(&estop, None).is_ok());
        }
        assert_eq!(orders.admit(&estop, None).unwrap_err().kind.code(), "overloaded");
        tickets.into_iter().for_each(|ticket| orders.ended(ticket));
        assert!(orders.admit(&stop(), None).is_ok());
    }

    #[test]
    fn a_robot_gets_one_command_at_a_time_and_none_while_it_is_driven() {
        let mut orders = Orders::default();
        let (ticket, halted) = orders.admit(&goto("xtb-1"), None).unwrap();
        assert_eq!(orders.admit(&goto("xtb-1"), None).unwrap_err().kind.code(), "busy");
        assert!(orders.admit(&goto("xtb-2"), None).is_ok());
        drop(halted);
        orders.ended(ticket);
        assert!(orders.admit(&goto("xtb-1"), None).is_ok());
        let failure = orders.admit(&goto("xtb-3"), Some(&name("xtb-3"))).unwrap_err();
        assert!(failure.message.contains("by hand"), "{failure}");
    }

    #[test]
    fn a_stop_overtakes_what_was_asked_before_it() {
        let mut orders = Orders::default();
        let (first, mut first_halted) = orders.admit(&goto("xtb-1"), None).unwrap();
        let (_second, mut second_halted) = orders.admit(&goto("xtb-2"), None).unwrap();
        orders.halt(Some(&name("xtb-1")));
        assert!(first_halted.try_recv().is_ok());
        assert!(second_halted.try_recv().is_err());
        let (_again, _halted) = orders.admit(&goto("xtb-1"), None).unwrap();
        orders.ended(first);
        assert!(orders.admit(&goto("xtb-1"), None).is_err(), "the newer one is still on its way");
        orders.halt(None);
        assert!(second_halted.try_recv().is_ok());
    }
}
