//! The verbs of tasks, as people and scripts use them: `fleet-cli` from outside, a dispatcher in a process of its
//! own, simulated robots.

use crate::commands::{Sim, agent, fleet_cli, sim};
use fleet_tests::PATIENCE;
use fleet_tests::dispatch::Serve;
use fleet_tests::processes::{Process, Signal};
use serde_json::{Value, json};
use std::io::Read;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Between two looks at a command that goes on.
const LOOK_EVERY: Duration = Duration::from_millis(20);

struct Lab {
    sim: Sim,
    serve: Option<Serve>,
    folder: TempDir,
}

/// What a command came to: its exit code, and the lines of JSON that it printed.
#[derive(Debug)]
struct Answer {
    code: i32,
    lines: Vec<Value>,
}

impl Answer {
    fn new(code: Option<i32>, printed: &str) -> Self {
        let line = |line: &str| serde_json::from_str(line).unwrap_or_else(|error| panic!("{error}: {line}"));
        Self { code: code.unwrap(), lines: printed.lines().map(line).collect() }
    }

    fn ok(self) -> Vec<Value> {
        assert_eq!(self.code, 0, "{self:?}");
        self.lines
    }

    /// The error's code, message and hint, and the exit code.
    fn error(&self) -> (i32, &str, &str, &str) {
        let error = &self.lines.last().unwrap()["error"];
        let text = |field: &str| error[field].as_str().unwrap_or_else(|| panic!("no {field}: {self:?}"));
        (self.code, text("code"), text("message"), text("hint"))
    }
}

/// A command that goes on beside the test.
struct Beside(Process);

impl Beside {
    fn end(mut self) -> Answer {
        let give_up = Instant::now() + PATIENCE;
        while self.0.runs() {
            assert!(Instant::now() < give_up, "the command does not end");
            std::thread::sleep(LOOK_EVERY);
        }
        let mut printed = String::new();
        self.0.0.stdout.take().unwrap().read_to_string(&mut printed).unwrap();
        Answer::new(self.0.0.wait().unwrap().code(), &printed)
    }
}

impl Lab {
    /// Robots without a dispatcher.
    fn without(arguments: &[&str]) -> Self {
        Self { sim: sim(arguments), serve: None, folder: tempfile::tempdir().unwrap() }
    }

    fn new(robots: usize) -> Self {
        let mut lab = Self::without(&["--robots", &robots.to_string(), "--speed", "8"]);
        lab.serve();
        lab
    }

    fn serve(&mut self) {
        self.serve = Some(Serve::start(&self.sim.endpoint, &self.ledger()));
    }

    fn ledger(&self) -> PathBuf {
        self.folder.path().join("lab.ledger")
    }

    fn command(&self, line: &str) -> Command {
        // A busy machine takes its time to connect.
        let mut command = fleet_cli(&["--timeout", "30", "--connect", &self.sim.endpoint]);
        command.args(line.split(' ')).stdin(Stdio::null());
        command
    }

    fn run(&self, line: &str) -> Answer {
        let output = self.command(line).output().unwrap();
        Answer::new(output.status.code(), &String::from_utf8_lossy(&output.stdout))
    }

    fn beside(&self, line: &str) -> Beside {
        let mut command = self.command(line);
        Beside(Process(command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap()))
    }

    /// `dispatch` with the ledger named.
    fn ledger_verb(&self, verb: &str) -> Answer {
        self.run(&format!("dispatch {verb} --ledger {}", self.ledger().display()))
    }

    fn file(&self, text: &str) -> String {
        let path = self.folder.path().join("tasks.toml");
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    }

    /// The ids of what a command line submitted.
    fn submit(&self, line: &str) -> Vec<String> {
        let lines = self.run(&format!("dispatch {line}")).ok();
        lines.iter().map(|line| line["id"].as_str().unwrap().to_owned()).collect()
    }

    fn tasks(&self) -> Vec<Value> {
        let lines = self.run("tasks").ok();
        assert_eq!(lines.len(), 1, "the list is one object");
        lines[0]["tasks"].as_array().unwrap().clone()
    }

    /// A task as the list has it, once it is in this state.
    fn until(&self, id: &str, state: &str) -> Value {
        let give_up = Instant::now() + PATIENCE;
        loop {
            let tasks = self.tasks();
            let task = tasks.iter().find(|task| task["id"] == id);
            if let Some(task) = task.filter(|task| task["state"] == state) {
                return task.clone();
            }
            assert!(Instant::now() < give_up, "{id} is not {state}: {task:?}; {:?}", self.run("list").lines);
        }
    }

    /// Exit code, and what `cancel` or one of its like says of the only task.
    fn change(&self, line: &str) -> (i32, Value) {
        let answer = self.run(line);
        assert_eq!(answer.lines.len(), 1, "{answer:?}");
        (answer.code, answer.lines[0].clone())
    }
}

#[test]
fn a_file_is_submitted_as_a_whole_or_not_at_all() {
    let lab = Lab::new(2);
    let first = "[[task]]\ngoto = [0.0, 1.2]\n\n";
    let far = lab.file(&format!("{first}[[task]]\ngoto = [2000, 0]\n"));
    let refused = lab.run(&format!("dispatch submit {far}"));
    let (code, _, message, hint) = refused.error();
    assert!(code == 2 && message.contains("tasks.toml, line 4, task 2: "), "{refused:?}");
    assert!(hint.contains("dispatch submit --help"), "{hint}");
    let stranger = lab.file(&format!("{first}[[task]]\ngoto = [1, 0]\nrobot = \"xtb-9\"\n"));
    let refused = lab.run(&format!("dispatch submit {stranger}"));
    let (code, name, message, _) = refused.error();
    assert_eq!((code, name), (1, "unknown_robot"), "{refused:?}");
    assert!(message.contains("task 2") && message.contains("xtb-9"), "{message}");
    assert!(lab.tasks().is_empty(), "something was taken of what was refused");

    let good = lab.file(&format!("{first}[[task]]\nroute = [[2, 1], [2, 0]]\nrobot = \"xtb-2\"\n"));
    assert_eq!(lab.submit(&format!("submit {good}")), ["t1", "t2"]);
    let listed = lab.tasks();
    assert_eq!(listed.iter().map(|task| &task["id"]).collect::<Vec<_>>(), ["t1", "t2"]);
    assert_eq!(listed[1]["spec"]["who"], json!({"robot": "xtb-2"}));
    lab.until("t1", "done");
    assert_eq!(lab.until("t2", "done")["legs_done"], 2);
}

#[test]
fn after_an_emergency_stop_of_all_nothing_is_assigned_until_the_dispatcher_is_activated() {
    let mut lab = Lab::new(2);
    lab.submit("patrol 0,1 0,2.5");
    lab.until("t1", "running");
    lab.run("estop --all").ok();
    lab.until("t1", "queued");
    let serve = lab.serve.as_mut().unwrap();
    serve.kill();
    serve.restart();
    let give_up = Instant::now() + PATIENCE;
    for robot in ["xtb-1", "xtb-2"] {
        // The dispatcher that was killed had their leases.
        while lab.run(&format!("reset {robot}")).code != 0 {
            assert!(Instant::now() < give_up, "{robot} is not reset");
        }
    }
    lab.submit("goto 0 1.2");
    // A while in which robots are free: as long as this one's deadline.
    lab.submit("goto 2 1 --deadline 4");
    assert!(lab.until("t3", "failed")["reason"].as_str().unwrap().contains("deadline"));
    for id in ["t1", "t2"] {
        let task = lab.until(id, "queued");
        assert!(task["reason"].as_str().unwrap().contains("emergency stop of all robots"), "{task}");
        assert_eq!(task["robot"], Value::Null, "{task}");
    }
    let steps = lab.run("task t2").ok()[0]["steps"].as_array().unwrap().len();
    assert_eq!(steps, 1, "it was assigned in between");
    for screen in ["dispatch status", "list", "why xtb-1"] {
        let shown = lab.run(screen).ok()[0].to_string();
        assert!(shown.contains("fleet_stop") || shown.contains("dispatch activate"), "{screen}: {shown}");
    }
    let activated = lab.run("dispatch activate").ok();
    assert_eq!(activated[0]["ended"]["tasks"], 2, "{activated:?}");
    lab.until("t2", "done");
    assert_eq!(lab.run("dispatch activate").ok()[0]["ended"], Value::Null);
}

#[test]
fn a_task_that_is_waited_for_ends_with_its_history() {
    let lab = Lab::new(1);
    let ended = lab.run("dispatch goto 0 1.2 --on-link-loss finish --finish 60 --wait").ok();
    assert_eq!((&ended[0]["id"], &ended[0]["state"]), (&"t1".into(), &"done".into()));
    assert_eq!(ended[0]["spec"]["on_link_loss"], "finish");
    let told = lab.run("task t1").ok();
    let steps = told[0]["steps"].as_array().unwrap();
    let states: Vec<&str> = steps.iter().map(|step| step["state"].as_str().unwrap()).collect();
    assert_eq!(states[..3], ["queued", "assigned", "running"]);
    assert_eq!((*states.last().unwrap(), &told[0]["task"]["robot"]), ("done", &"xtb-1".into()));
    let unknown = lab.run("task t9");
    let (code, name, _, hint) = unknown.error();
    assert_eq!((code, name), (1, "unknown_task"));
    assert!(hint.contains("fleet-cli tasks"), "{hint}");
}

#[test]
fn a_task_is_paused_resumed_cancelled_and_retried() {
    let lab = Lab::new(1);
    let waiting = lab.beside("dispatch patrol 0,1 0,2.5 --wait");
    lab.until("t1", "running");
    assert_eq!(lab.change("pause t1"), (0, json!({"id": "t1", "state": "paused", "error": null})));
    let goal = &lab.run("status xtb-1").ok()[0];
    assert!(goal.to_string().contains("\"cancelled\""), "the robot drives on: {goal}");
    let (code, resumed) = lab.change("resume t1");
    assert_eq!((code, &resumed["error"]), (0, &Value::Null), "{resumed}");
    lab.until("t1", "running");

    assert_eq!(lab.change("cancel t1"), (0, json!({"id": "t1", "state": "cancelled", "error": null})));
    let waited = waiting.end();
    assert_eq!((waited.code, &waited.lines[0]["state"]), (1, &"cancelled".into()), "{waited:?}");
    let (code, refused) = lab.change("pause t1");
    assert_eq!((code, &refused["error"]["code"]), (1, &"wrong_state".into()), "{refused}");
    assert!(refused["error"]["hint"].as_str().unwrap().contains("fleet-cli task t1"), "{refused}");

    assert_eq!(lab.change("retry t1").0, 0);
    lab.until("t1", "running");
    let answer = lab.run("cancel --all");
    assert_eq!((answer.code, &answer.lines[0]["state"]), (0, &"cancelled".into()), "{answer:?}");
    assert_eq!(lab.run("cancel --all").ok().len(), 0, "nothing was open");
}

#[test]
fn a_route_is_extended_while_its_robot_drives_and_the_same_command_again_adds_nothing() {
    let lab = Lab::new(1);
    let waiting = lab.beside("dispatch route 0,2.5 --wait");
    lab.until("t1", "running");
    let (code, extended) = lab.change("extend t1 0,1.5 0,0.5");
    assert_eq!((code, &extended["error"]), (0, &Value::Null), "{extended}");
    assert_eq!(lab.change("extend t1 0,1.5 0,0.5 --after 1").0, 0);
    let (code, refused) = lab.change("extend t1 0,3 --after 1");
    assert_eq!((code, &refused["error"]["code"]), (1, &"stale".into()), "{refused}");
    let done = waiting.end();
    assert_eq!((done.code, &done.lines[0]["legs_done"]), (0, &json!(3)), "{done:?}");
    let (code, refused) = lab.change("extend t1 0,3");
    assert_eq!((code, &refused["error"]["code"]), (1, &"wrong_state".into()), "{refused}");
}

#[test]
fn a_task_that_failed_is_done_when_it_is_retried() {
    let lab = Lab::new(1);
    let waiting = lab.beside("dispatch route 0,3 0,1 --loops 3 --on-takeover fail --retries 0 --wait");
    lab.until("t1", "running");
    lab.run("stop xtb-1").ok();
    let failed = waiting.end();
    assert_eq!((failed.code, &failed.lines[0]["state"]), (1, &"failed".into()), "{failed:?}");
    assert!(failed.lines[0]["reason"].as_str().unwrap().contains("received a stop command"), "{failed:?}");
    assert_eq!(lab.change("retry t1").0, 0);
    lab.until("t1", "done");
    let (code, refused) = lab.change("retry t1");
    assert_eq!((code, &refused["error"]["code"]), (1, &"wrong_state".into()), "{refused}");

    let late = lab.beside("dispatch patrol 0,1 0,2 --deadline 1 --wait").end();
    assert_eq!((late.code, &late.lines[0]["state"]), (1, &"failed".into()), "{late:?}");
    let (code, refused) = lab.change("retry t2");
    let message = refused["error"]["message"].as_str().unwrap();
    assert!(code == 1 && message.contains("deadline"), "{refused}");
}

#[test]
fn who_leaves_a_task_with_ctrl_c_leaves_it_with_the_dispatcher() {
    let lab = Lab::new(1);
    for (flag, state) in [("", "running"), (" --cancel-on-interrupt", "cancelled")] {
        let waiting = lab.beside(&format!("dispatch patrol 0,1 0,2.5 --wait{flag}"));
        let id = if flag.is_empty() { "t1" } else { "t2" };
        lab.until(id, "running");
        waiting.0.signal(Signal::Interrupt);
        let left = waiting.end();
        assert_eq!(left.code, 130, "{left:?}");
        lab.until(id, state);
        if flag.is_empty() {
            let (_, name, message, hint) = left.error();
            assert_eq!(name, "interrupted");
            assert!(message.contains("continues with t1") && hint.contains("cancel t1"), "{left:?}");
            assert_eq!(lab.change("cancel t1").0, 0);
        }
    }
}

#[test]
fn without_a_dispatcher_a_submission_waits_five_seconds_and_says_how_to_start_one() {
    let lab = Lab::without(&["--robots", "1"]);
    let began = Instant::now();
    let answer = lab.run("dispatch goto 0 1");
    assert!(began.elapsed() >= Duration::from_secs(5), "{:?}", began.elapsed());
    let (code, name, message, hint) = answer.error();
    assert_eq!((code, name), (3, "no_dispatcher"), "{answer:?}");
    assert!(message.contains("waited 5 s") && message.contains("nothing was submitted"), "{message}");
    assert!(hint.contains("`fleet-cli dispatch serve`") && hint.contains("sim --dispatch"), "{hint}");
    assert_eq!(lab.run("tasks").error().0, 3);
}

#[test]
fn a_submission_made_before_the_dispatcher_starts_is_taken() {
    let mut lab = Lab::without(&["--robots", "1", "--speed", "8"]);
    let waiting = lab.beside("dispatch goto 0 1.2 --wait");
    lab.serve();
    let ended = waiting.end();
    assert_eq!((ended.code, &ended.lines[0]["id"]), (0, &"t1".into()), "{ended:?}");
    assert_eq!(lab.tasks().len(), 1, "asked for more than once, taken once");
}

#[test]
fn a_ledger_is_exported_beside_its_dispatcher_and_compacted_without() {
    let mut lab = Lab::new(1);
    lab.run("dispatch goto 0 1.2 --wait").ok();
    let records = lab.ledger_verb("export").ok();
    assert!(records.iter().all(|record| record["intact"] == true), "{records:?}");
    assert!(records.iter().any(|record| record.to_string().contains("\"submitted\"")), "{records:?}");
    let refused = lab.ledger_verb("compact");
    let (code, _, message, _) = refused.error();
    assert!(code == 1 && message.contains("in use by another dispatcher"), "{refused:?}");
    assert_eq!(lab.ledger_verb("export").ok().len(), records.len(), "it was compacted all the same");

    drop(lab.serve.take());
    lab.ledger_verb("compact").ok();
    let snapshot = lab.ledger_verb("export").ok();
    assert_eq!((snapshot.len(), &snapshot[0]["snapshot"]), (1, &true.into()));
    lab.serve();
    assert_eq!(lab.tasks()[0]["state"], "done");
    assert_eq!(lab.submit("goto 0 0"), ["t2"], "an id was used twice");
}

/// The robot's agent is stopped by the system, so that it neither hears nor says anything.
#[test]
fn a_cancellation_that_the_robot_does_not_confirm_says_so() {
    let lines = tempfile::tempdir().unwrap();
    let mut lab = Lab::without(&["--robots", "1", "--pty", &lines.path().display().to_string()]);
    let robot = agent(&lab.sim, lines.path(), "xtb-1");
    lab.serve();
    lab.submit("patrol 0,1 0,3");
    lab.until("t1", "running");
    robot.signal(Signal::Stop);
    let (code, change) = lab.change("cancel t1");
    assert_eq!((code, &change["error"]["code"]), (3, &"unconfirmed".into()), "{change}");
    assert!(change["error"]["message"].as_str().unwrap().contains("xtb-1"), "{change}");
    assert_eq!(change["state"], "cancelling");
    robot.signal(Signal::Continue);
    lab.until("t1", "cancelled");
}
