//! Many robots: who stands first, and how one is found.

use super::*;

/// 24 robots: the 7th is latched, the 13th stale, the 20th blocked; every second one has the tag `red`.
fn crowd() -> Scene {
    let mut scene = Scene::new(name("lab"));
    for number in 1..=24 {
        let robot = format!("xtb-{number}");
        let tags = if number % 2 == 0 { vec!["red".to_owned()] } else { Vec::new() };
        scene.expect(RosterEntry { name: name(&robot), tags, start_pose: None });
        scene.take(0, &key(&format!("{robot}/alive")), AnyMessage::Alive(true));
        let mut state = at(&robot, f64::from(number), 0.0, 0.0);
        if number == 7 {
            state.latches = vec![fake::latch(Latch::Estop, "carol", false)];
            state.stopped_because = vec![StopReason::Estop];
        }
        if number == 20 {
            state = under_way(state, GoalStatus::Blocked);
            state.stopped_because = vec![StopReason::ObstacleFront];
        }
        let heard_ms = if number == 13 { NOW - 4_000 } else { NOW - 50 };
        scene.take(heard_ms, &key(&format!("{robot}/state")), state.into());
    }
    scene.set_aliases([(name("xtb-9"), "Red Fox".to_owned())].into());
    scene
}

/// The names of the table's rows, the selected one with its mark.
fn rows(shown: &[String]) -> Vec<String> {
    let table = shown.iter().map(|line| line.chars().skip(36).collect::<String>());
    let row = |line: String| {
        let name = line.split_whitespace().next()?.to_owned();
        name.trim_start_matches('>').strip_prefix("xtb-").is_some().then_some(name)
    };
    let mut found: Vec<String> = table.filter_map(row).collect();
    found.pop(); // the selected one's facts
    found
}

fn write(cockpit: &mut Cockpit, scene: &Scene, text: &str) {
    text.chars().for_each(|c| assert!(letter(cockpit, scene, c).is_empty(), "{c} of {text}"));
}

#[test]
fn at_80_by_24_those_in_trouble_stand_first_of_24() {
    let scene = crowd();
    let shown = screen(&mut cockpit(), &scene, 80, 24);
    assert_eq!(rows(&shown)[..4], ["xtb-7", "xtb-13", "xtb-20", ">xtb-1"], "{}", shown.join("\n"));
    line(&shown, "why (+17 rows)");
    for word in ["24 robots", "1 LATCHED", "1 STALE", "1 blocked"] {
        assert!(shown[0].contains(word), "{}", shown[0]);
    }
}

#[test]
fn two_digits_find_one_of_24_and_it_stays_selected() {
    let (mut cockpit, scene) = (cockpit(), crowd());
    screen(&mut cockpit, &scene, 80, 24);
    write(&mut cockpit, &scene, "/17");
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert_eq!(rows(&shown), [">xtb-17"], "{}", shown.join("\n"));
    line(&shown, "/17_");
    line(&shown, "why (1 of 24)");
    press(&mut cockpit, &scene, KeyCode::Enter);
    assert_eq!(commands(&letter(&mut cockpit, &scene, 's')), [Command::Stop(Target::One(name("xtb-17")))]);
    press(&mut cockpit, &scene, KeyCode::Esc);
    assert!(!cockpit.is_over() && cockpit.leaving == 0, "Esc ends the filter before it quits");
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert!(rows(&shown).contains(&">xtb-17".to_owned()), "{}", shown.join("\n"));
}

#[test]
fn names_aliases_tags_and_states_are_found_together_or_alone() {
    let scene = crowd();
    let found = |text: &str| {
        let mut cockpit = cockpit();
        write(&mut cockpit, &scene, &format!("/{text}"));
        let sights = robot_view::sights(&scene, &[], NOW);
        cockpit.listed(&sights).iter().map(|sight| sight.name.to_string()).collect::<Vec<_>>()
    };
    assert_eq!(found("latched"), ["xtb-7"]);
    assert_eq!(found("blocked @red"), ["xtb-20"]);
    assert_eq!(found("fox"), ["xtb-9"]);
    assert_eq!(found("@re").len(), 12);
    assert_eq!(found("2")[..2], ["xtb-2", "xtb-20"], "the number itself, then what has it in its name");
    assert_eq!(found("sta"), ["xtb-13"], "a state from three letters on");
}

#[test]
fn while_the_filter_is_written_stops_of_all_work_and_small_letters_are_text() {
    let (mut cockpit, scene) = (cockpit(), crowd());
    write(&mut cockpit, &scene, "/stale");
    assert_eq!(cockpit.filter.text, "stale");
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'E')), [Command::Estop(Target::All)]);
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'S')), [Command::Stop(Target::All)]);
    assert_eq!(cockpit.filter.text, "stale");
    press(&mut cockpit, &scene, KeyCode::Backspace);
    assert_eq!(cockpit.filter.text, "stal");
}

#[test]
fn no_letter_of_a_filter_answers_a_question_that_comes_up_meanwhile() {
    let (mut cockpit, scene) = (cockpit(), crowd());
    letter(&mut cockpit, &scene, '3');
    press(&mut cockpit, &scene, KeyCode::Right);
    let actions = press(&mut cockpit, &scene, KeyCode::Enter);
    let [Action::Do { number, .. }] = actions[..] else { panic!("{actions:?}") };
    write(&mut cockpit, &scene, "/");
    let held = Outcome { tone: Tone::Bad, text: "alice has control".into(), held: true };
    cockpit.done(number, &held, NOW);
    write(&mut cockpit, &scene, "y");
    assert!(!screen(&mut cockpit, &scene, 80, 24).join("\n").contains("any other key = no"));
    press(&mut cockpit, &scene, KeyCode::Esc);
    line(&screen(&mut cockpit, &scene, 80, 24), "any other key = no");
    assert_eq!(commands(&letter(&mut cockpit, &scene, 'y')).len(), 1);
}

#[test]
fn a_robot_that_fits_no_longer_keeps_the_selection_and_its_row() {
    let (mut cockpit, mut scene) = (cockpit(), crowd());
    write(&mut cockpit, &scene, "/latched");
    press(&mut cockpit, &scene, KeyCode::Enter);
    scene.take(NOW, &key("xtb-7/state"), at("xtb-7", 7.0, 0.0, 0.0).into());
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert_eq!(rows(&shown), [">xtb-7"], "{}", shown.join("\n"));
    line(&shown, "why (0 of 24)");
}

#[test]
fn an_alias_stands_beside_the_name_where_there_is_room() {
    let scene = crowd();
    let shown = screen(&mut cockpit(), &scene, 160, 50);
    line(&shown, "xtb-9 Red Fox");
    let mut cockpit = cockpit();
    letter(&mut cockpit, &scene, '9');
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert_eq!(shown.iter().filter(|line| line.contains("xtb-9 Red Fox")).count(), 1, "{}", shown.join("\n"));
}
