//! What command lines submit.

use super::*;
use crate::cli::Cli;
use crate::commands::Verb;
use crate::commands::dispatch::DispatchVerb;
use xtb_protocol::messages::{LinkLoss, OnTakeover};

fn terms(line: &str) -> TermArgs {
    let line = format!("fleet-cli dispatch goto 1 2 {line}");
    let cli = Cli::read(line.split_whitespace().map(Into::into)).unwrap();
    let Verb::Dispatch(dispatch) = cli.verb else { panic!() };
    let DispatchVerb::Goto(goto) = dispatch.verb else { panic!() };
    goto.terms
}

fn kind() -> TaskKind {
    TaskKind::Wander { for_s: 1.0 }
}

#[test]
fn without_options_a_task_has_the_protocols_values() {
    assert_eq!(spec(kind(), &terms(""), 1000), TaskSpec::new(kind()));
}

#[test]
fn options_say_who_and_until_when() {
    let line = "--tag @red --priority 9 --deadline 60 --retries 0 --on-takeover fail --grace 5 \
        --on-link-loss finish --finish 60";
    let spec = spec(kind(), &terms(line), 1000);
    assert_eq!((spec.who, spec.priority, spec.deadline_ms), (Who::Tag("red".into()), 9, Some(61_000)));
    assert_eq!((spec.retries, spec.on_takeover, spec.grace_s), (0, OnTakeover::Fail, 5.0));
    assert_eq!((spec.on_link_loss, spec.finish_s), (LinkLoss::Finish, 60.0));
}

#[test]
fn the_submitted_task_is_json_with_its_id_first() {
    let spec = TaskSpec::new(kind());
    let line = serde_json::to_string(&Submitted { id: TaskId::new(17), spec: &spec }).unwrap();
    assert!(line.starts_with(r#"{"id":"t17","spec":{"kind":{"wander""#), "{line}");
}
