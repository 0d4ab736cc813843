//! What keys ask for.

use super::*;

fn goto(robot: &str, x_m: f64, y_m: f64, yaw_rad: Option<f64>) -> Command {
    Command::Goto { robot: name(robot), x_m, y_m, yaw_rad, take: false }
}

fn outcome(text: &str, held: bool) -> Outcome {
    Outcome { tone: Tone::Bad, text: text.to_owned(), held }
}

/// At the wheel of the selected robot.
fn driving(scene: &Scene) -> Cockpit {
    let mut cockpit = cockpit();
    screen(&mut cockpit, scene, 80, 24);
    let actions = letter(&mut cockpit, scene, 't');
    assert_eq!(actions, [Action::Grip { robot: name("xtb-1"), take: false }]);
    cockpit.grasp(TeleopStatus::Held { max_rpm: 20.0 }, NOW);
    cockpit
}

#[test]
fn stops_need_one_key_in_every_overlay_and_while_something_is_asked() {
    let scene = fleet();
    for over in [None, Some('?'), Some('w'), Some('x')] {
        for (key, command) in [
            ('E', Command::Estop(Target::All)),
            ('S', Command::Stop(Target::All)),
            ('e', Command::Estop(Target::One(name("xtb-3")))),
            ('s', Command::Stop(Target::One(name("xtb-3")))),
        ] {
            let mut cockpit = cockpit();
            letter(&mut cockpit, &scene, '3');
            over.map(|over| letter(&mut cockpit, &scene, over));
            assert_eq!(commands(&letter(&mut cockpit, &scene, key)), [command], "{key} over {over:?}");
        }
    }
}

#[test]
fn an_emergency_stop_is_never_refused_and_begins_anew_each_time() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    for robot in 1..=5 {
        letter(&mut cockpit, &scene, char::from_digit(robot, 10).unwrap());
        press(&mut cockpit, &scene, KeyCode::Right);
        press(&mut cockpit, &scene, KeyCode::Enter);
    }
    let first = letter(&mut cockpit, &scene, 'E');
    let [Action::Do { number, instead: None, .. }] = first[..] else { panic!("{first:?}") };
    for _ in 0..100 {
        let again = letter(&mut cockpit, &scene, 'E');
        assert!(matches!(&again[..], [Action::Do { instead: Some(_), .. }]), "{again:?}");
    }
    assert_eq!(cockpit.commands.under_way().len(), 6, "bounded");
    // The one that was begun anew says nothing any more.
    cockpit.done(number, &outcome("1 of 6 latched", false), NOW);
    assert!(!screen(&mut cockpit, &scene, 80, 24).join("\n").contains("1 of 6"));
}

#[test]
fn the_cursor_goes_where_arrows_say_and_enter_sends_the_robot_there() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    screen(&mut cockpit, &scene, 80, 24);
    assert!(press(&mut cockpit, &scene, KeyCode::Enter).is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "no target");
    letter(&mut cockpit, &scene, '2');
    let (width_m, height_m) = cockpit.view.cell_m();
    for code in [KeyCode::Right, KeyCode::Right, KeyCode::Up] {
        press(&mut cockpit, &scene, code);
    }
    let sent = commands(&press(&mut cockpit, &scene, KeyCode::Enter));
    assert_eq!(sent, [goto("xtb-2", 2.0 * width_m, height_m, None)], "from the robot, a cell each");
    line(&screen(&mut cockpit, &scene, 80, 24), "goto xtb-2");
    // Asked again before it is answered.
    assert!(press(&mut cockpit, &scene, KeyCode::Enter).is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "wait: goto xtb-2");
    letter(&mut cockpit, &scene, '1');
    letter(&mut cockpit, &scene, 'r');
    letter(&mut cockpit, &scene, 'r');
    let sent = commands(&press(&mut cockpit, &scene, KeyCode::Enter));
    assert_eq!(sent, [goto("xtb-1", 2.0 * width_m, height_m, Some(TURN_RAD))]);
    letter(&mut cockpit, &scene, 'u');
    assert_eq!(cockpit.cursor.unwrap().yaw_rad, None);
}

#[test]
fn a_pose_is_set_after_a_yes_that_says_what_it_does_and_only_of_who_stands() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    screen(&mut cockpit, &scene, 80, 24);
    letter(&mut cockpit, &scene, '3');
    letter(&mut cockpit, &scene, 'p');
    line(&screen(&mut cockpit, &scene, 80, 24), "no point");
    let (width_m, _) = cockpit.view.cell_m();
    press(&mut cockpit, &scene, KeyCode::Right);
    letter(&mut cockpit, &scene, 'p');
    let shown = screen(&mut cockpit, &scene, 160, 50);
    line(&shown, "Does xtb-3 stand at (");
    line(&shown, "forgets");
    let set = commands(&letter(&mut cockpit, &scene, 'y'));
    let yaw_rad = 180_f64.to_radians();
    let expected = |yaw_rad| Command::SetPose {
        robot: name("xtb-3"),
        x_m: 3.0 + width_m,
        y_m: 2.0,
        yaw_rad,
        take: false,
    };
    assert_eq!(set, [expected(yaw_rad)], "the present yaw, unless the cursor has one");
    // One that drives, and one that is not heard.
    for (digit, why) in [('1', "is under way"), ('4', "state unknown")] {
        letter(&mut cockpit, &scene, digit);
        letter(&mut cockpit, &scene, 'p');
        assert!(commands(&letter(&mut cockpit, &scene, 'y')).is_empty());
        line(&screen(&mut cockpit, &scene, 160, 50), why);
    }
}

#[test]
fn the_answer_shows_with_its_age() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    let actions = letter(&mut cockpit, &scene, 's');
    let [Action::Do { number, .. }] = actions[..] else { panic!("{actions:?}") };
    let shown = screen_at(&mut cockpit, &scene, 80, 24, NOW + 1_500);
    assert!(line(&shown, "stop xtb-1: sent").contains("1.5 s"));
    cockpit.done(number, &Outcome { tone: Tone::Good, text: "stopped".into(), held: false }, NOW + 2_000);
    let shown = screen_at(&mut cockpit, &scene, 80, 24, NOW + 15_000);
    assert!(line(&shown, "stop xtb-1: stopped").contains("13 s"));
}

#[test]
fn who_is_held_by_somebody_else_is_taken_after_a_yes_only() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    letter(&mut cockpit, &scene, 'g');
    let actions = press(&mut cockpit, &scene, KeyCode::Enter);
    let [Action::Do { number, .. }] = actions[..] else { panic!("{actions:?}") };
    cockpit.done(number, &outcome("xtb-1 refuses: alice has control", true), NOW);
    line(&screen(&mut cockpit, &scene, 80, 24), "alice has control. Take control?");
    let mut no = cockpit.clone();
    assert!(letter(&mut no, &scene, 'n').is_empty());
    assert!(letter(&mut no, &scene, 'y').is_empty(), "it is asked no longer");
    let taken = commands(&letter(&mut cockpit, &scene, 'y'));
    assert!(matches!(taken[..], [Command::Goto { take: true, .. }]), "{taken:?}");
}

#[test]
fn a_reset_asks_first_and_names_the_latches() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    letter(&mut cockpit, &scene, '1');
    assert!(letter(&mut cockpit, &scene, 'x').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "nothing latched");
    letter(&mut cockpit, &scene, '3');
    assert!(letter(&mut cockpit, &scene, 'x').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "Reset xtb-3? estop by carol");
    assert_eq!(
        commands(&letter(&mut cockpit, &scene, 'y')),
        [Command::Reset { robot: name("xtb-3"), take: false }]
    );
}

#[test]
fn a_reset_of_all_asks_first_and_names_whom() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    assert!(letter(&mut cockpit, &scene, 'X').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "Reset all latched robots? xtb-3");
    let mut no = cockpit.clone();
    assert!(letter(&mut no, &scene, 'n').is_empty());
    assert!(letter(&mut no, &scene, 'y').is_empty(), "it is asked no longer");
    let reset = commands(&letter(&mut cockpit, &scene, 'y'));
    let [Command::ResetAll { robots }] = &reset[..] else { panic!("{reset:?}") };
    assert!(robots.contains(&name("xtb-3")) && !robots.contains(&name("xtb-1")), "{robots:?}");
    // Whose state is unknown is not reset on the strength of what it was.
    assert!(!robots.contains(&name("xtb-4")), "{robots:?}");
}

#[test]
fn a_suspended_dispatcher_is_activated_after_a_yes_and_only_if_it_is_suspended() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    assert!(letter(&mut cockpit, &scene, 'A').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "the dispatcher is not suspended");
    let cause = SuspensionCause::FleetStop { by: Some(name("cli-7")) };
    let suspended = vec![Suspension { cause, since_ms: 4_000, tasks: 3 }];
    scene.take(9_500, &key("dispatch/tasks"), list(Vec::new(), suspended).into());
    assert!(letter(&mut cockpit, &scene, 'A').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "3 open tasks wait");
    assert!(letter(&mut cockpit.clone(), &scene, 'n').is_empty());
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'y')), [Command::Activate]);
}

#[test]
fn cancel_ends_the_task_or_else_the_goal() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    letter(&mut cockpit, &scene, '2');
    let task = Command::CancelTask { robot: name("xtb-2"), task: TaskId::new(3) };
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'c')), [task]);
    letter(&mut cockpit, &scene, '1');
    let goal = Command::Cancel { robot: name("xtb-1"), goal: Uuid::from_u128(7), take: false };
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'c')), [goal]);
    // What a stale robot had is not known to be so now.
    letter(&mut cockpit, &scene, '4');
    assert!(letter(&mut cockpit, &scene, 'c').is_empty());
}

#[test]
fn a_task_that_has_left_the_robot_is_neither_its_task_nor_cancelled() {
    for state in [TaskState::Queued, TaskState::Paused, TaskState::Done] {
        let (mut cockpit, mut scene) = (cockpit(), fleet());
        // As a list says it that still names the last robot.
        let task = TaskView { robot: Some(name("xtb-1")), ..fake::task(3, state) };
        scene.take(9_500, &key("dispatch/tasks"), list(vec![task], Vec::new()).into());
        letter(&mut cockpit, &scene, '1');
        let shown = screen(&mut cockpit, &scene, 100, 30);
        assert!(line(&shown, "  task ").contains("none"), "{state:?}: {}", line(&shown, "  task "));
        let goal = Command::Cancel { robot: name("xtb-1"), goal: Uuid::from_u128(7), take: false };
        assert_eq!(commands(&letter(&mut cockpit, &scene, 'c')), [goal], "{state:?}");
    }
}

#[test]
fn what_a_dispatcher_that_is_gone_had_given_a_robot_is_not_known() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    scene.take(9_500, &key("dispatch/alive"), AnyMessage::Alive(false));
    letter(&mut cockpit, &scene, '2');
    assert!(
        !commands(&letter(&mut cockpit, &scene, 'c'))
            .iter()
            .any(|command| matches!(command, Command::CancelTask { .. }))
    );
}

#[test]
fn the_wheel_is_held_to_run() {
    let scene = fleet();
    let mut cockpit = driving(&scene);
    assert_eq!(cockpit.drive(NOW), None, "watching is not commanding");
    press(&mut cockpit, &scene, KeyCode::Up);
    press(&mut cockpit, &scene, KeyCode::Left);
    assert_eq!(cockpit.drive(NOW), Some(StickPosition { throttle: 1.0, steering: -1.0 }));
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert!(shown[0].contains("DRIVING xtb-1: 20 rpm, steering -1.00"), "{}", shown[0]);
    for code in [KeyCode::Up, KeyCode::Left] {
        cockpit.input(&typed(code, KeyEventKind::Release), &scene, NOW);
    }
    assert_eq!(cockpit.drive(NOW), Some(StickPosition::default()));
    assert_eq!(cockpit.drive(NOW + 1_000), None);
}

#[test]
fn lost_focus_stops_and_every_way_out_lets_go() {
    let scene = fleet();
    type Way = fn(&mut Cockpit, &Scene) -> Vec<Action>;
    let out: [(&str, Way); 8] = [
        ("focus", |cockpit, scene| cockpit.input(&Input::FocusLost, scene, NOW)),
        ("t", |cockpit, scene| letter(cockpit, scene, 't')),
        ("Esc", |cockpit, scene| press(cockpit, scene, KeyCode::Esc)),
        ("q", |cockpit, scene| letter(cockpit, scene, 'q')),
        ("signal", |cockpit, _| cockpit.leave(NOW)),
        ("s", |cockpit, scene| letter(cockpit, scene, 's')),
        ("e", |cockpit, scene| letter(cockpit, scene, 'e')),
        ("E", |cockpit, scene| letter(cockpit, scene, 'E')),
    ];
    for (way, out) in out {
        let mut cockpit = driving(&scene);
        press(&mut cockpit, &scene, KeyCode::Up);
        assert!(cockpit.drive(NOW).is_some());
        let actions = out(&mut cockpit, &scene);
        assert_eq!(actions.iter().filter(|action| **action == Action::LetGo).count(), 1, "{way}");
        assert_eq!(cockpit.drive(NOW), None, "{way}: not one more");
        assert!(!cockpit.is_over(), "{way}: it has not ended yet");
        cockpit.grasp(TeleopStatus::Ended(Some(true)), NOW);
        line(&screen(&mut cockpit, &scene, 80, 24), "xtb-1 confirmed the stop; control released");
    }
}

#[test]
fn focus_that_is_lost_while_control_is_asked_for_ends_that_too() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    letter(&mut cockpit, &scene, 't');
    assert_eq!(cockpit.input(&Input::FocusLost, &scene, NOW), [Action::LetGo]);
    cockpit.grasp(TeleopStatus::Held { max_rpm: 20.0 }, NOW);
    press(&mut cockpit, &scene, KeyCode::Up);
    assert_eq!(cockpit.drive(NOW), None, "it comes too late");
}

#[test]
fn while_it_drives_another_robot_cannot_be_selected() {
    let scene = fleet();
    let mut cockpit = driving(&scene);
    for code in [KeyCode::Tab, KeyCode::Char('3'), KeyCode::Enter, KeyCode::Char('x')] {
        assert!(press(&mut cockpit, &scene, code).is_empty());
    }
    assert_eq!(cockpit.selected, Some(name("xtb-1")));
    line(&screen(&mut cockpit, &scene, 80, 24), LET_GO_FIRST);
}

#[test]
fn leaving_waits_for_answers_unless_the_person_insists() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    let actions = letter(&mut cockpit, &scene, 'E');
    let [Action::Do { number, .. }] = actions[..] else { panic!("{actions:?}") };
    letter(&mut cockpit, &scene, 'q');
    assert!(!cockpit.is_over());
    assert!(screen(&mut cockpit, &scene, 80, 24)[0].contains("QUITTING: 1 not answered yet"));
    let mut insisting = cockpit.clone();
    letter(&mut insisting, &scene, 'q');
    assert!(insisting.is_over());
    assert!(insisting.last_words().unwrap().contains("E-STOP ALL"));
    assert!(commands(&press(&mut cockpit, &scene, KeyCode::Enter)).is_empty(), "nothing new but stops");
    cockpit.done(number, &outcome("5 of 6 latched", false), NOW);
    assert!(cockpit.is_over() && cockpit.last_words().is_none());
}

#[test]
fn read_only_sends_nothing_and_says_so() {
    let (mut cockpit, scene) = (with(Theme { color: true, ascii: false }, Some("--read-only")), fleet());
    letter(&mut cockpit, &scene, 'g');
    for key in ['s', 'S', 'e', 'E', 't', 'c'] {
        assert!(letter(&mut cockpit, &scene, key).is_empty(), "{key}");
    }
    assert!(press(&mut cockpit, &scene, KeyCode::Enter).is_empty());
    letter(&mut cockpit, &scene, '3');
    letter(&mut cockpit, &scene, 'x');
    assert!(letter(&mut cockpit, &scene, 'y').is_empty());
    line(&screen(&mut cockpit, &scene, 80, 24), "commands disabled: --read-only");
}

#[test]
fn a_recording_is_paused_and_wound() {
    let (mut cockpit, scene) =
        (with(Theme { color: true, ascii: false }, Some("playing a recording")), fleet());
    cockpit.playing(Playing { at_s: 1.0, length_s: 60.0, speed: 1.0, stands: None });
    assert_eq!(letter(&mut cockpit, &scene, ' '), [Action::Pause]);
    assert_eq!(press(&mut cockpit, &scene, KeyCode::Left), [Action::Seek(-SEEK_S.0)]);
    assert_eq!(press(&mut cockpit, &scene, KeyCode::Right), [Action::Seek(SEEK_S.0)]);
    assert!(press(&mut cockpit, &scene, KeyCode::Up).is_empty());
}

#[test]
fn requests_under_way_are_bounded() {
    let mut scene = Scene::new(name("lab"));
    for number in 1..=30 {
        let robot = format!("xtb-{number}");
        scene.take(NOW, &key(&format!("{robot}/state")), at(&robot, 0.0, 0.0, 0.0).into());
    }
    let mut cockpit = cockpit();
    let mut sent = 0;
    for _ in 0..30 {
        letter(&mut cockpit, &scene, 'g');
        sent += press(&mut cockpit, &scene, KeyCode::Enter).len();
        press(&mut cockpit, &scene, KeyCode::Tab);
    }
    assert_eq!(sent, commands::MOST_UNDER_WAY);
    line(&screen(&mut cockpit, &scene, 80, 24), "wait: 16 requests are not answered yet");
    assert_eq!(letter(&mut cockpit, &scene, 'E').len(), 1, "a stop has room");
}
