//! The corpus of the dispatcher's door.

use super::{ID, message, text};
use crate::fuzz::Seed;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    DispatchBody, DispatchRequest, LinkLoss, OnTakeover, TaskId, TaskKind, TaskSpec, Waypoint, Who,
};

fn tasks() -> Vec<TaskSpec> {
    let point = |x_m, yaw_rad| Waypoint { x_m, y_m: -2.0, yaw_rad };
    let points = || vec![point(1.0, None), point(2.5, Some(0.5)), point(4.0, None)];
    let robot = Name::robot("xtb-1").unwrap_or_else(|error| panic!("{error}"));
    let all = TaskSpec {
        priority: 9,
        deadline_ms: Some(1_800_000_000_000),
        who: Who::Robot(robot),
        retries: 0,
        on_link_loss: LinkLoss::Finish,
        finish_s: 60.0,
        on_takeover: OnTakeover::Resume,
        grace_s: 5.0,
        ..TaskSpec::new(TaskKind::Route { points: points(), loops: 3, dwell_s: 0.5 })
    };
    let of = |who, kind| TaskSpec { who, ..TaskSpec::new(kind) };
    vec![
        TaskSpec::new(TaskKind::Goto { to: point(1.5, None) }),
        all,
        of(Who::Tag("red".into()), TaskKind::Patrol { points: points(), dwell_s: 0.0, for_s: Some(600.0) }),
        of(Who::Able("wander".into()), TaskKind::Wander { for_s: 60.0 }),
    ]
}

pub(crate) fn dispatch() -> Vec<Seed> {
    let some = || vec![TaskId::new(1), TaskId::new(u64::MAX)];
    let bodies = [
        ("submit", DispatchBody::Submit { tasks: tasks() }),
        ("cancel", DispatchBody::Cancel { tasks: some() }),
        ("retry", DispatchBody::Retry { tasks: some() }),
        (
            "extend",
            DispatchBody::Extend {
                task: TaskId::new(17),
                after: 2,
                points: vec![Waypoint { x_m: 1.5, y_m: -2.0, yaw_rad: None }],
            },
        ),
        ("show", DispatchBody::Show { task: TaskId::new(17) }),
        ("cancel_all", DispatchBody::CancelAll {}),
        ("activate", DispatchBody::Activate {}),
        ("adopt", DispatchBody::Adopt {}),
        ("status", DispatchBody::Status {}),
    ];
    let seeds = bodies.into_iter().flat_map(|(name, body)| message(name, &DispatchRequest { id: ID, body }));
    let mut seeds: Vec<Seed> = seeds.collect();
    let asked = |body: &str| format!(r#"{{"id":"00112233-4455-6677-8899-aabbccddeeff","body":{body}}}"#);
    let short = asked(r#"{"submit":{"tasks":[{"kind":{"goto":{"to":{"x_m":1,"y_m":2}}}}]}}"#);
    seeds.push(text("far_away.json", &short.replace("1,", "1000.5,")));
    seeds.push(text("unknown_kind.json", &short.replace("goto", "fly")));
    seeds.push(text("short.json", &short));
    seeds.push(text("no_tasks.json", &asked(r#"{"pause":{"tasks":[]}}"#)));
    seeds.push(text("no_id.json", &asked(r#"{"resume":{"tasks":["t1","17","t"]}}"#)));
    seeds
}
