//! What stands on the screen.

use super::*;

const SIZES: [(u16, u16); 2] = [(80, 24), (160, 50)];

#[test]
fn every_robot_is_told_apart_in_the_table_at_both_sizes() {
    let scene = fleet();
    for (width, height) in SIZES {
        let shown = screen(&mut cockpit(), &scene, width, height);
        let all = shown.join("\n");
        assert!(shown.iter().all(|line| line.chars().count() == usize::from(width)), "{all}");
        assert!(line(&shown, "0.31").contains("xtb-1"), "{all}");
        let blocked = shown.iter().find(|line| line.contains("xtb-2") && line.contains("obstacle")).unwrap();
        assert!(blocked.contains("goto"), "{blocked}");
        assert!(line(&shown, "LATCHED estop").contains("xtb-3"), "{all}");
        assert!(line(&shown, "STALE for 4.0 s").contains("xtb-4"), "{all}");
        assert!(line(&shown, "MISSING 5.0 s").contains("xtb-5"), "{all}");
        assert!(line(&shown, "xtb-6 ?").contains("MISSING"), "{all}");
        for word in ["6 robots", "1 driving", "1 blocked", "1 LATCHED", "1 STALE", "2 MISSING"] {
            assert!(shown[0].contains(word), "{word}: {}", shown[0]);
        }
    }
}

#[test]
fn an_overloaded_simulator_stands_in_the_title_at_both_sizes() {
    let mut scene = fleet();
    let stats = |factor| SimStats { t_s: 1.0, speed: 1.0, real_time_factor: Some(factor), first: None };
    let said = "simulator runs at 0.19 × real time";
    scene.take(NOW - 1000, &key("sim/stats"), stats(0.19).into());
    let shown = screen(&mut cockpit(), &scene, 160, 50);
    assert!(shown[0].contains(said), "{}", shown[0]);
    scene.take(NOW, &key("sim/stats"), stats(0.99).into());
    assert!(!screen(&mut cockpit(), &scene, 160, 50)[0].contains("simulator"));
    let mut alone = Scene::new(name("lab"));
    alone.take(NOW, &key("xtb-1/alive"), AnyMessage::Alive(true));
    alone.take(NOW, &key("sim/stats"), stats(0.19).into());
    assert!(screen(&mut cockpit(), &alone, 80, 24)[0].contains(said));
}

#[test]
fn what_a_stale_robot_said_is_not_shown_as_if_it_were_so() {
    let scene = fleet();
    for (width, height) in SIZES {
        let mut cockpit = cockpit();
        letter(&mut cockpit, &scene, '4');
        let shown = screen(&mut cockpit, &scene, width, height);
        let all = shown.join("\n");
        assert!(!all.contains("0.77"), "its old speed:\n{all}");
        let row = line(&shown, "STALE for 4.0 s");
        assert!(row.contains(">xtb-4") && row.contains('?') && row.contains("4.0 s"), "{row}");
        assert!(line(&shown, "pose  ").contains("?, 4.0 s ago (-2.00, -2.00) 45°"), "{all}");
        assert!(line(&shown, "battery ").contains('?'), "{all}");
        // On the map it has no heading, but its age.
        let map: Vec<&str> = shown.iter().filter_map(|line| line.split('│').nth(1)).collect();
        let name = if width < 100 { "?4 4.0 s" } else { "?xtb-4 4.0 s" };
        assert!(map.iter().any(|line| line.contains(name)), "{all}");
        assert!(!map.iter().any(|line| line.contains("◇4")), "nor the goal that it had:\n{all}");
    }
}

#[test]
fn the_map_shows_headings_goals_walls_and_zones() {
    let scene = fleet();
    let shown = screen(&mut cockpit(), &scene, 160, 50);
    let all = shown.join("\n");
    for part in ["→xtb-1", "↑xtb-2!", "←xtb-3#", "◇ xtb-1", "chargers", "room"] {
        assert!(all.contains(part), "{part}:\n{all}");
    }
    let dots = |line: &String| line.chars().filter(|sign| ('\u{2801}'..='\u{28ff}').contains(sign)).count();
    assert!(shown.iter().map(dots).max().unwrap() > 60, "a wall is a line:\n{all}");
    // The path of xtb-1 goes on to its right, in its row.
    let row = shown.iter().find(|line| line.contains("→xtb-1")).unwrap();
    let after = row.split("→xtb-1").nth(1).unwrap();
    assert!(dots(&after.chars().take(20).collect()) > 8, "{row}");
}

#[test]
fn without_a_map_the_robots_are_the_bounds() {
    let mut scene = Scene::new(name("lab"));
    for (robot, x_m) in [("xtb-1", -40.0), ("xtb-2", 60.0)] {
        scene.take(NOW, &key(&format!("{robot}/state")), at(robot, x_m, 0.0, 0.0).into());
    }
    let shown = screen(&mut cockpit(), &scene, 160, 50);
    let map: Vec<&str> = shown.iter().filter_map(|line| line.split('│').nth(1)).collect();
    let row = map.iter().find(|line| line.contains("→1")).unwrap();
    assert!(row.contains("→2"), "{row}");
    line(&shown, "no map");
}

#[test]
fn without_colours_the_picture_has_none_and_says_the_same() {
    let scene = fleet();
    for (width, height) in SIZES {
        let mut plain = with(Theme { color: false, ascii: false }, None);
        let without = buffer(&mut plain, &scene, width, height, NOW);
        let colors = without.content.iter().map(|cell| (cell.fg, cell.bg));
        assert!(
            colors.clone().all(|pair| pair == (ratatui::style::Color::Reset, ratatui::style::Color::Reset))
        );
        let texts = |cockpit: &mut Cockpit| screen(cockpit, &scene, width, height);
        assert_eq!(texts(&mut plain), texts(&mut cockpit()));
    }
}

#[test]
fn in_ascii_there_is_nothing_else_in_any_overlay() {
    let scene = fleet();
    for over in [None, Some('?'), Some('w'), Some('x')] {
        let mut cockpit = with(Theme { color: false, ascii: true }, None);
        letter(&mut cockpit, &scene, '3');
        over.map(|over| letter(&mut cockpit, &scene, over));
        for (width, height) in SIZES {
            let shown = screen(&mut cockpit, &scene, width, height).join("\n");
            assert!(shown.is_ascii(), "{shown}");
            assert!(shown.contains("xtb-3") || over == Some('?'), "{shown}");
        }
    }
    let shown = screen(&mut with(Theme { color: false, ascii: true }, None), &scene, 80, 24).join("\n");
    for part in [">1", "^2!", "<3#", "?4"] {
        assert!(shown.contains(part), "{part}:\n{shown}");
    }
}

#[test]
fn no_size_is_too_small_to_draw() {
    let scene = fleet();
    for width in [1, 5, 19, 20, 33, 60, 69, 70, 79] {
        for height in [1, 3, 4, 8, 13, 14, 20] {
            let mut cockpit = cockpit();
            for over in ['?', 'w', 'v'] {
                screen(&mut cockpit, &scene, width, height);
                letter(&mut cockpit, &scene, over);
            }
        }
    }
    let small = screen(&mut cockpit(), &scene, 50, 12).join("\n");
    assert!(small.contains("LATCHED") && small.contains("xtb-6"), "{small}");
}

#[test]
fn a_lost_link_is_a_banner_with_its_age_and_goes_away_by_itself() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    cockpit.link(false, 4_000);
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert!(shown[0].contains("NO LINK to the router for 6.0 s"), "{}", shown[0]);
    cockpit.link(true, 10_000);
    assert!(!screen(&mut cockpit, &scene, 80, 24)[0].contains("NO LINK"));
}

#[test]
fn tasks_take_the_place_of_events_and_the_other_way_round() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    line(&screen(&mut cockpit, &scene, 80, 24), "xtb-5 is missing");
    letter(&mut cockpit, &scene, 'v');
    let shown = screen(&mut cockpit, &scene, 160, 50);
    assert!(line(&shown, "t3 running").contains("goto (1.00, 2.00)"));
    line(&shown, "1 running, 1.0 s old");
    letter(&mut cockpit, &scene, 'v');
    line(&screen(&mut cockpit, &scene, 80, 24), "xtb-5 is missing");
}

#[test]
fn why_explains_the_selected_robot() {
    let (mut cockpit, scene) = (cockpit(), fleet());
    letter(&mut cockpit, &scene, '3');
    letter(&mut cockpit, &scene, 'w');
    let shown = screen(&mut cockpit, &scene, 160, 50).join("\n");
    assert!(shown.contains("emergency stop: estop latched by carol"), "{shown}");
    assert!(shown.contains("fleet-cli reset xtb-3"), "{shown}");
    press(&mut cockpit, &scene, KeyCode::Esc);
    assert!(!screen(&mut cockpit, &scene, 160, 50).join("\n").contains("fleet-cli reset"));
}

#[test]
fn a_large_fleet_scrolls_with_the_selection_and_says_how_many_there_are_more() {
    let mut scene = Scene::new(name("lab"));
    for number in 1..=40 {
        let robot = format!("xtb-{number}");
        scene.take(NOW, &key(&format!("{robot}/state")), at(&robot, 0.0, 0.0, 0.0).into());
    }
    let mut cockpit = cockpit();
    let shown = screen(&mut cockpit, &scene, 80, 24).join("\n");
    assert!(
        shown.contains(">xtb-1 ") && shown.contains("(+33 rows)") && !shown.contains("xtb-30"),
        "{shown}"
    );
    for _ in 0..29 {
        press(&mut cockpit, &scene, KeyCode::Tab);
    }
    let shown = screen(&mut cockpit, &scene, 80, 24).join("\n");
    assert!(shown.contains(">xtb-30") && !shown.contains(" xtb-1 "), "{shown}");
}

#[test]
fn only_the_robots_that_were_named_are_shown() {
    let scene = fleet();
    let look = Theme { color: false, ascii: false };
    let robots = vec![name("xtb-3"), name("xtb-9")];
    let setup = Setup { robots, look, reporting: Reporting::Presses, read_only: None };
    let shown = screen(&mut Cockpit::new(setup), &scene, 160, 50);
    assert!(shown[0].contains("1 robot "), "{}", shown[0]);
    assert!(!shown.join("\n").contains("xtb-1"), "{}", shown.join("\n"));
}

#[test]
fn a_recording_shows_where_it_is() {
    let (mut cockpit, scene) =
        (with(Theme { color: true, ascii: false }, Some("playing a recording")), fleet());
    cockpit.playing(Playing { at_s: 12.34, length_s: 60.0, speed: 2.0, stands: Some("PAUSED".into()) });
    let shown = screen(&mut cockpit, &scene, 80, 24);
    assert!(shown[0].contains("RECORDING 12.3 of 60.0 s, 2x, PAUSED"), "{}", shown[0]);
    assert!(shown[23].contains("space pause"), "{}", shown[23]);
}

#[test]
fn a_suspended_dispatcher_stands_in_the_title_and_says_what_ends_it() {
    let (mut cockpit, mut scene) = (cockpit(), fleet());
    let cause = SuspensionCause::FleetStop { by: Some(name("cli-7")) };
    let suspended = vec![Suspension { cause, since_ms: 4_000, tasks: 3 }];
    scene.take(9_500, &key("dispatch/tasks"), list(Vec::new(), suspended).into());
    let shown = screen(&mut cockpit, &scene, 160, 50);
    assert!(shown[0].contains("dispatcher SUSPENDED"), "{}", shown[0]);
    letter(&mut cockpit, &scene, 'v');
    let shown = screen(&mut cockpit, &scene, 200, 50);
    line(&shown, "the dispatcher is suspended: emergency stop of all robots by cli-7; 3 open tasks wait");
    line(&shown, "`fleet-cli dispatch activate`");
    letter(&mut cockpit, &scene, '3');
    letter(&mut cockpit, &scene, 'x');
    line(&screen(&mut cockpit, &scene, 160, 50), "the dispatcher is suspended and assigns");
    scene.take(9_600, &key("dispatch/alive"), AnyMessage::Alive(false));
    let shown = screen(&mut cockpit, &scene, 160, 50);
    assert!(
        !shown[0].contains("SUSPENDED"),
        "what a dispatcher that is gone had suspended is unknown: {}",
        shown[0]
    );
}

#[test]
fn at_80_by_24_the_keys_and_the_goal_are_whole_or_end_in_an_ellipsis() {
    let scene = fleet();
    let shown = screen(&mut cockpit(), &scene, 80, 24);
    let keys = " ? keys  Tab robot  Enter go  t drive  x reset  s S stop  e E E-STOP  q quit";
    assert_eq!(shown[23].trim_end(), keys);
    let goal = line(&shown, "m to go");
    assert!(goal.trim_end().ends_with("goal    running (1.50, …), 1.50 m to go"), "{goal}");
    let wide = screen(&mut cockpit(), &scene, 160, 50);
    line(&wide, "goal    running (1.50, 3.00), 1.50 m to go");
    for key in ["arrows cursor", "c cancel", "w why", "v tasks"] {
        assert!(wide[49].contains(key), "{}", wide[49]);
    }
}

#[test]
fn stop_keys_and_quit_are_shown_at_every_width_that_has_room_for_them() {
    let scene = fleet();
    let playing = || {
        let mut cockpit = with(Theme { color: true, ascii: false }, Some("playing a recording"));
        cockpit.playing(Playing { at_s: 1.0, length_s: 60.0, speed: 1.0, stands: None });
        cockpit
    };
    let reading = || with(Theme { color: true, ascii: false }, Some("--read-only"));
    for width in [20, 30, 40, 69, 70, 79, 80, 120] {
        let keys = |mut cockpit: Cockpit| screen(&mut cockpit, &scene, width, 24)[23].clone();
        for (cockpit, needed) in [
            (cockpit(), ["e E E-STOP", "q quit"]),
            (playing(), ["space pause", "q quit"]),
            (reading(), ["? keys", "q quit"]),
        ] {
            let shown = keys(cockpit);
            assert!(needed.iter().all(|key| shown.contains(key)), "{width}: {shown}");
        }
        assert!(width < 30 || keys(cockpit()).contains("s S stop"), "{width}");
    }
}
