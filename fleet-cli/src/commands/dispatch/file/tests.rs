//! Files of tasks, right and wrong.

use super::*;

const NOW_MS: u64 = 1_000_000;

fn parse(text: &str, now_ms: u64) -> Result<Vec<TaskSpec>> {
    let dock: MapPlace = serde_json::from_str(r#"{"name":"dock-1","x_m":3,"y_m":4}"#).unwrap();
    entries(text).and_then(|entries| specs(text, entries, now_ms, &[dock]))
}

#[test]
fn a_point_may_be_a_place() {
    let text = "[[task]]\ngoto = \"dock-1\"\n[[task]]\nroute = [\"dock-1\", [1, 2]]\n";
    let specs = parse(text, NOW_MS).unwrap();
    let dock = Waypoint { x_m: 3.0, y_m: 4.0, yaw_rad: None };
    assert_eq!(specs[0].kind, TaskKind::Goto { to: dock });
    assert_eq!(specs[1].kind.points()[0], dock);
    assert!(said("[[task]]\ngoto = \"dock-2\"\n").contains("there is no place \"dock-2\""));
}

fn said(text: &str) -> String {
    let failure = parse(text, NOW_MS).unwrap_err();
    assert_eq!(failure.kind, ErrorKind::Config);
    failure.message
}

#[test]
fn a_file_says_who_does_what_until_when() {
    let text = r#"
        [[task]]
        goto = [4, 2.0, 90]
        robot = "xtb-1"
        priority = 7
        deadline_s = 60

        [[task]]
        route = [[0, 0], [1, 0]]
        loops = 2
        dwell_s = 1.5
        tag = "@red"
        on_takeover = "resume"

        [[task]]
        patrol = [[0, 0], [1, 0]]
        for_s = 600

        [[task]]
        wander_for_s = 30
        able = "wander"
    "#;
    let specs = parse(text, NOW_MS).unwrap();
    let to = Waypoint { x_m: 4.0, y_m: 2.0, yaw_rad: Some(std::f64::consts::FRAC_PI_2) };
    assert_eq!(specs[0].kind, TaskKind::Goto { to });
    assert_eq!((specs[0].priority, specs[0].deadline_ms), (7, Some(NOW_MS + 60_000)));
    assert_eq!(specs[0].who, Who::Robot(Name::new("xtb-1").unwrap()));
    assert!(matches!(specs[1].kind, TaskKind::Route { loops: 2, dwell_s: 1.5, .. }));
    assert_eq!((&specs[1].who, specs[1].on_takeover), (&Who::Tag("red".into()), OnTakeover::Resume));
    assert!(matches!(specs[2].kind, TaskKind::Patrol { for_s: Some(600.0), .. }));
    assert_eq!(specs[2], TaskSpec::new(specs[2].kind.clone()));
    assert_eq!(specs[3].kind, TaskKind::Wander { for_s: 30.0 });
    assert_eq!(specs[3].who, Who::Able("wander".into()));
}

#[test]
fn errors_name_line_and_task() {
    let first = "[[task]]\ngoto = [1, 2]\n\n";
    for (second, line, what) in [
        ("[[task]]\ngto = [1, 2]\n", 5, "unknown field `gto`"),
        ("[[task]]\ngoto = [1]\n", 4, "1 numbers"),
        ("[[task]]\ngoto = [1, \"a\"]\n", 5, "a point is [x, y]"),
        ("[[task]]\nroute = [[0, 0], [0, 2000]]\n", 4, "point 2: Y = 2000 m"),
        ("[[task]]\npriority = 3\n", 4, "is missing"),
        ("[[task]]\ngoto = [1, 2]\nwander_for_s = 3\n", 4, "give only one of"),
        ("[[task]]\ngoto = [1, 2]\nloops = 3\n", 4, "loops can only be used with route"),
        ("[[task]]\ngoto = [1, 2]\npriority = 10\n", 4, "priority"),
        ("[[task]]\ngoto = [1, 2]\nrobot = \"all\"\n", 4, "reserved"),
        ("[[task]]\ngoto = [1, 2]\nrobot = \"a\"\ntag = \"b\"\n", 4, "give only one of"),
        ("[[task]]\ngoto = [1, 2]\ndeadline_s = -1\n", 4, "deadline_s"),
        ("[[task]]\ngoto = [1, nan]\n", 4, "Y = NaN"),
        ("[[task]]\ngoto = [1, 2\n", 5, "unclosed array"),
    ] {
        let said = said(&format!("{first}{second}"));
        assert!(said.starts_with(&format!("line {line}, task 2: ")), "{second}: {said}");
        assert!(said.contains(what), "{second}: {said}");
    }
}

#[test]
fn a_file_without_tasks_or_with_too_many_is_refused() {
    assert!(said("").contains("the file has no task"));
    assert!(said("[[tasks]]\ngoto = [1, 2]\n").starts_with("line 1: unknown field `tasks`"));
    assert!(said(&"[[task]]\ngoto = [1, 2]\n".repeat(501)).starts_with("the file has 501 tasks"));
}

#[test]
fn the_example_in_configs_can_be_submitted() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/tasks.toml");
    let text = std::fs::read_to_string(&path).unwrap();
    assert_eq!(parse(&text, NOW_MS).unwrap().len(), 5);
}
