//! What keys do to the cockpit's state, and what they ask of robots.

use super::*;
use xtb_client::dispatcher_client::fleet_stop;
use xtb_control::Mode;

impl Cockpit {
    pub(super) fn press(&mut self, press: Press, scene: &Scene, now_ms: AtMs) -> Vec<Action> {
        let sights = sights(scene, &self.setup.robots, now_ms);
        self.settle(&sights);
        match press {
            Press::EstopAll => return self.stop(Command::Estop(Target::All), now_ms),
            Press::StopAll => return self.stop(Command::Stop(Target::All), now_ms),
            Press::Estop => return self.stop_selected(Command::Estop, now_ms),
            Press::Stop => return self.stop_selected(Command::Stop, now_ms),
            Press::Leave => return self.leave(now_ms),
            _ if self.leaving > 0 => return Vec::new(),
            _ => {}
        }
        if let Some(Modal::Question(question)) = self.over.take_if(|over| matches!(over, Modal::Question(_)))
        {
            return match (press, question.yes) {
                (Press::Yes, Wish::Command(command)) => self.wish(command, now_ms),
                (Press::Yes, Wish::Grip { robot, take }) => self.grip(robot, take, now_ms),
                _ => Vec::new(),
            };
        }
        match press {
            Press::Back if self.over.is_some() => self.over = None,
            Press::Back | Press::Teleop if self.grip.is_some() => {
                return self.let_go(now_ms, "by the driver");
            }
            Press::Back if !self.filter.text.is_empty() => self.filter = Filter::default(),
            Press::Back => return self.leave(now_ms),
            Press::Help => self.toggle(Modal::Help),
            Press::Why => self.toggle(Modal::Why),
            Press::Pane => {
                let has_alerts = scene.alerts().is_some_and(|list| !list.alerts.is_empty());
                self.pane = match self.pane {
                    Pane::Events => Pane::Tasks,
                    Pane::Tasks if has_alerts => Pane::Alerts,
                    Pane::Tasks | Pane::Alerts => Pane::Events,
                };
            }
            Press::Details => self.details = !self.details,
            Press::Acknowledge => return self.acknowledge(scene, now_ms),
            Press::Zoom(nearer) => self.view.zoom(nearer, self.point_of_interest(&sights)),
            Press::Whole => self.view.whole(),
            Press::Follow => self.view.follow(),
            Press::Pan(east, north) => self.view.pan(east, north),
            _ if self.grip.is_some() => self.commands.tell(now_ms, Tone::Warning, LET_GO_FIRST),
            Press::Filter => (self.over, self.filter.typing) = (None, true),
            Press::Step(by) => self.step(&sights, by),
            Press::Number(number) => self.select_number(&sights, number),
            Press::Cursor(right, up, many) => return self.arrow(&sights, right, up, many),
            Press::Home => self.cursor = self.place(&sights).map(|at| Cursor { yaw_rad: None, ..at }),
            Press::Turn(by) => self.turn(f64::from(by)),
            Press::AnyYaw => self.cursor = self.cursor.map(|at| Cursor { yaw_rad: None, ..at }),
            Press::Pause if self.playing.is_some() => return vec![Action::Pause],
            Press::Teleop => {
                return self.selected.clone().map_or_else(Vec::new, |robot| self.grip(robot, false, now_ms));
            }
            Press::Go => return self.go(now_ms),
            Press::SetPose => self.set_pose(&sights, now_ms),
            Press::Reset => self.reset(&sights, scene, now_ms),
            Press::ResetAll => self.reset_all(&sights, scene, now_ms),
            Press::Activate => self.activate(scene, now_ms),
            Press::Cancel => return self.cancel(&sights, now_ms),
            _ => {}
        }
        Vec::new()
    }

    /// Whether a key steers the robot that is driven.
    pub(super) fn steers(&mut self, key: &KeyEvent, now_ms: AtMs) -> bool {
        let Some(Grip::Driving { keyboard, .. }) = &mut self.grip else { return false };
        if key.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT) {
            return false;
        }
        let wheel = match key.code {
            KeyCode::Up => TeleopKey::Ahead,
            KeyCode::Down => TeleopKey::Astern,
            KeyCode::Left => TeleopKey::Left,
            KeyCode::Right => TeleopKey::Right,
            KeyCode::Char(' ') => TeleopKey::Stop,
            _ => return false,
        };
        let touch = match key.kind {
            KeyEventKind::Press => Touch::Press,
            KeyEventKind::Repeat => Touch::Repeat,
            KeyEventKind::Release => Touch::Release,
        };
        keyboard.key(Stamp::from_ms(now_ms), wheel, touch);
        true
    }

    /// Somebody is always selected, if there is anybody.
    pub(super) fn settle(&mut self, sights: &[ShownRobot<'_>]) {
        let there = |name: &Name| sights.iter().any(|sight| sight.name == name);
        if !self.selected.as_ref().is_some_and(there) {
            self.selected = sights.first().map(|sight| sight.name.clone());
        }
    }

    /// The selected robot.
    pub(super) fn sight<'a>(&self, sights: &'a [ShownRobot<'a>]) -> Option<&'a ShownRobot<'a>> {
        sights.iter().find(|sight| Some(sight.name) == self.selected.as_ref())
    }

    pub(super) fn toggle(&mut self, over: Modal) {
        self.over = if self.over.as_ref() == Some(&over) { None } else { Some(over) };
    }

    /// Asks for a yes, unless the person is asked for another one already.
    pub(super) fn ask(&mut self, question: Question) {
        if self.leaving == 0 && !matches!(self.over, Some(Modal::Question(_))) {
            self.over = Some(Modal::Question(question));
        }
    }

    /// In the table's order.
    pub(super) fn step(&mut self, sights: &[ShownRobot<'_>], by: isize) {
        let sights = self.listed(sights);
        let at = sights.iter().position(|sight| Some(sight.name) == self.selected.as_ref());
        let Some(at) = at else { return };
        let count = isize::try_from(sights.len()).unwrap_or(1);
        let next = (isize::try_from(at).unwrap_or(0) + by).rem_euclid(count);
        let next = usize::try_from(next).ok().and_then(|next| sights.get(next));
        self.selected = next.map(|sight| sight.name.clone());
    }

    /// The robot with this number in its name; else the one in this row.
    pub(super) fn select_number(&mut self, sights: &[ShownRobot<'_>], digit: usize) {
        let number = if digit == 0 { 10 } else { digit };
        let named = |sight: &&ShownRobot<'_>| {
            let name = sight.name.as_str();
            let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
            name[stem.len()..].parse() == Ok(number)
        };
        let found = sights.iter().find(named).or_else(|| sights.get(number - 1));
        if let Some(found) = found {
            self.selected = Some(found.name.clone());
        }
    }

    /// Where the selected robot is now, if that is known.
    pub(super) fn place(&self, sights: &[ShownRobot<'_>]) -> Option<Cursor> {
        let pose = &self.sight(sights)?.state?.pose;
        Some(Cursor { x_m: pose.x_m, y_m: pose.y_m, yaw_rad: None })
    }

    /// What one looks at: the cursor, else the selected robot.
    pub(super) fn point_of_interest(&self, sights: &[ShownRobot<'_>]) -> Option<(f64, f64)> {
        self.cursor.or_else(|| self.place(sights)).map(|at| (at.x_m, at.y_m))
    }

    /// Moves the cursor; winds a recording.
    pub(super) fn arrow(&mut self, sights: &[ShownRobot<'_>], right: i8, up: i8, many: bool) -> Vec<Action> {
        if self.playing.is_some() {
            let seek_s = f64::from(right) * if many { SEEK_S.1 } else { SEEK_S.0 };
            return if seek_s == 0.0 { Vec::new() } else { vec![Action::Seek(seek_s)] };
        }
        let middle = || {
            let (x_m, y_m) = self.view.centre();
            Cursor { x_m, y_m, yaw_rad: None }
        };
        let mut cursor = self.cursor.or_else(|| self.place(sights)).unwrap_or_else(middle);
        let (width_m, height_m) = self.view.cell_m();
        let cells = f64::from(if many { MANY_CELLS } else { 1 });
        cursor.x_m += f64::from(right) * cells * width_m;
        cursor.y_m += f64::from(up) * cells * height_m;
        self.cursor = Some(cursor);
        self.view.reveal((cursor.x_m, cursor.y_m));
        Vec::new()
    }

    pub(super) fn turn(&mut self, by: f64) {
        if let Some(cursor) = &mut self.cursor {
            cursor.yaw_rad = Some(cursor.yaw_rad.map_or(0.0, |yaw| wrap_rad(yaw + by * TURN_RAD)));
        }
    }

    /// Whether robots may be asked for anything; says why not.
    fn may(&mut self, now_ms: AtMs) -> bool {
        if let Some(why) = self.setup.read_only {
            self.commands.tell(now_ms, Tone::Warning, format!("commands disabled: {why}"));
        }
        self.setup.read_only.is_none()
    }

    /// Carries a wish out beside the screen.
    pub(super) fn wish(&mut self, command: Command, now_ms: AtMs) -> Vec<Action> {
        if !self.may(now_ms) {
            return Vec::new();
        }
        match self.commands.begin(now_ms, &command) {
            Begun::As(number, instead) => vec![Action::Do { number, command, instead }],
            Begun::No => Vec::new(),
        }
    }

    /// A stop also takes the hand off the wheel.
    pub(super) fn stop(&mut self, command: Command, now_ms: AtMs) -> Vec<Action> {
        let mut actions = self.wish(command, now_ms);
        actions.extend(self.let_go(now_ms, "stop requested"));
        actions
    }

    pub(super) fn stop_selected(&mut self, command: fn(Target) -> Command, now_ms: AtMs) -> Vec<Action> {
        match self.selected.clone() {
            Some(robot) => self.stop(command(Target::One(robot)), now_ms),
            None => {
                self.commands.tell(now_ms, Tone::Warning, "no robot selected: S and E act on all");
                Vec::new()
            }
        }
    }

    pub(super) fn grip(&mut self, robot: Name, take: bool, now_ms: AtMs) -> Vec<Action> {
        if !self.may(now_ms) {
            return Vec::new();
        }
        self.grip = Some(Grip::Asking(robot.clone()));
        vec![Action::Grip { robot, take }]
    }

    /// Takes the hand off the wheel, if it is there.
    pub(super) fn let_go(&mut self, now_ms: AtMs, why: &str) -> Vec<Action> {
        match self.grip.take() {
            Some(Grip::Ending(robot)) => {
                self.grip = Some(Grip::Ending(robot));
                Vec::new()
            }
            Some(grip) => {
                let robot = grip.robot().clone();
                self.commands.tell(now_ms, Tone::Plain, format!("{robot}: driving ended, {why}"));
                self.grip = Some(Grip::Ending(robot));
                vec![Action::LetGo]
            }
            None => Vec::new(),
        }
    }

    pub(super) fn go(&mut self, now_ms: AtMs) -> Vec<Action> {
        match (self.selected.clone(), self.cursor) {
            (Some(robot), Some(Cursor { x_m, y_m, yaw_rad })) => {
                self.wish(Command::Goto { robot, x_m, y_m, yaw_rad, take: false }, now_ms)
            }
            (None, _) => {
                self.commands.tell(now_ms, Tone::Warning, "no robot to send");
                Vec::new()
            }
            (_, None) => {
                self.commands.tell(now_ms, Tone::Warning, "no target: set the cursor with the arrow keys");
                Vec::new()
            }
        }
    }

    /// Asks first, and says what it does. A robot that is under way would refuse.
    pub(super) fn set_pose(&mut self, sights: &[ShownRobot<'_>], now_ms: AtMs) {
        let Some(sight) = self.sight(sights) else { return };
        let robot = sight.name.clone();
        let warn = |cockpit: &mut Self, text: String| cockpit.commands.tell(now_ms, Tone::Warning, text);
        let Some(state) = sight.state else {
            return warn(self, format!("{robot}: state unknown, its pose is not set"));
        };
        let is_driven = state.mode == Mode::Teleop;
        if is_driven || state.goal.as_ref().is_some_and(|goal| !goal.status.is_final()) {
            return warn(self, format!("{robot} is under way: s stops it, then its pose can be set"));
        }
        let Some(Cursor { x_m, y_m, yaw_rad }) = self.cursor else {
            return warn(self, "no point: set the cursor with the arrow keys to where it stands".to_owned());
        };
        let yaw_rad = yaw_rad.unwrap_or(state.pose.yaw_rad);
        let degrees = yaw_rad.to_degrees();
        let text = format!(
            "Does {robot} stand at ({x_m:.2}, {y_m:.2}), yaw {degrees:.0}°? It does not move, and forgets where it \
             believed to be: this counts as known to a few centimetres until pose fixes correct it"
        );
        self.ask(Question {
            text,
            yes: Wish::Command(Command::SetPose { robot, x_m, y_m, yaw_rad, take: false }),
        });
    }

    pub(super) fn reset(&mut self, sights: &[ShownRobot<'_>], scene: &Scene, now_ms: AtMs) {
        let Some(sight) = self.sight(sights) else { return };
        let robot = sight.name.clone();
        let latches: Vec<String> = match sight.state {
            Some(state) => state.latches.iter().map(xtb_client::text::robot::latch).collect(),
            None => vec!["state unknown".to_owned()],
        };
        if latches.is_empty() {
            return self.commands.tell(now_ms, Tone::Plain, format!("{robot}: nothing latched"));
        }
        let next = after_reset(scene, "; the dispatcher may assign it a task at once");
        let text = format!("Reset {robot}? {}{next}", latches.join("; "));
        self.ask(Question { text, yes: Wish::Command(Command::Reset { robot, take: false }) });
    }

    /// All that are seen to have anything latched; whose state is unknown is left out, and named.
    pub(super) fn reset_all(&mut self, sights: &[ShownRobot<'_>], scene: &Scene, now_ms: AtMs) {
        let latched = |sight: &&ShownRobot<'_>| sight.state.is_some_and(|state| !state.latches.is_empty());
        let robots: Vec<Name> = sights.iter().filter(latched).map(|sight| sight.name.clone()).collect();
        let unknown = sights.iter().filter(|sight| sight.state.is_none()).map(|sight| sight.name.as_str());
        let unknown = unknown.collect::<Vec<_>>().join(", ");
        let left_out = if unknown.is_empty() { unknown } else { format!("; unknown: {unknown}") };
        if robots.is_empty() {
            return self.commands.tell(now_ms, Tone::Plain, format!("no robot is latched{left_out}"));
        }
        let next = after_reset(scene, "; the dispatcher may assign them tasks at once");
        let names = robots.iter().map(Name::as_str).collect::<Vec<_>>().join(", ");
        let text = format!("Reset all latched robots? {names}{left_out}{next}");
        self.ask(Question { text, yes: Wish::Command(Command::ResetAll { robots }) });
    }

    /// Asks first: robots may drive at once.
    pub(super) fn activate(&mut self, scene: &Scene, now_ms: AtMs) {
        let Some(stop) = fleet_stop(scene.suspended()) else {
            let why = match scene.suspended() {
                _ if !scene.dispatcher() => "no dispatcher".to_owned(),
                [] => "the dispatcher is not suspended".to_owned(),
                [other, ..] => {
                    format!("the dispatcher is active; {}: {}", other.text(), other.cause.remedy())
                }
            };
            return self.commands.tell(now_ms, Tone::Plain, why);
        };
        let text = format!("Activate the dispatcher? Robots may start at once: {}", stop.text());
        self.ask(Question { text, yes: Wish::Command(Command::Activate) });
    }

    /// The dispatcher's task if it has one, else its goal.
    pub(super) fn cancel(&mut self, sights: &[ShownRobot<'_>], now_ms: AtMs) -> Vec<Action> {
        let Some(sight) = self.sight(sights) else { return Vec::new() };
        let robot = sight.name.clone();
        if let Some(task) = sight.task {
            return self.wish(Command::CancelTask { robot, task: task.id }, now_ms);
        }
        let goal = sight.state.and_then(|state| state.goal.as_ref()).filter(|goal| !goal.status.is_final());
        match goal {
            Some(goal) => self.wish(Command::Cancel { robot, goal: goal.id, take: false }, now_ms),
            None => {
                self.commands.tell(now_ms, Tone::Warning, format!("{robot} has no known goal"));
                Vec::new()
            }
        }
    }
}

/// What may follow a reset.
fn after_reset(scene: &Scene, tasks: &'static str) -> &'static str {
    match (scene.dispatcher(), fleet_stop(scene.suspended())) {
        (false, _) => "",
        (true, None) => tasks,
        (true, Some(_)) => "; the dispatcher is suspended and assigns no task",
    }
}
