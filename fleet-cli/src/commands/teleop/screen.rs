//! What the driver sees.

use super::keys::Reporting;
use crate::output::{Output, Tone};
use xtb_client::client::LastState;
use xtb_client::teleop::StickPosition;
use xtb_client::text::reasons;
use xtb_client::text::robot::{self as describe, UNKNOWN, fixed};
use xtb_protocol::Name;
use xtb_protocol::messages::{BatteryLevel, RobotState};

/// Everything that the screen is made of.
pub(super) struct View<'a> {
    /// Whom we drive.
    pub(super) robot: &'a Name,
    /// Its last state.
    pub(super) seen: Option<&'a LastState>,
    /// What is asked for.
    pub(super) drive: StickPosition,
    /// Full throttle, in rpm.
    pub(super) max_rpm: f64,
    /// What the terminal can do.
    pub(super) reporting: Reporting,
    /// What came of the last reset; empty = none was asked for.
    pub(super) notice: &'a str,
}

/// The lines.
pub(super) fn lines(view: &View<'_>, out: &Output) -> Vec<String> {
    let title = format!("teleop {}", view.robot);
    let mut lines = vec![out.paint(Tone::Strong, &title), String::new()];
    let mut fact = |label: &str, text: String, tone: Tone| {
        lines.push(format!("  {} {}", out.paint(Tone::Dim, &format!("{label:11}")), out.paint(tone, &text)));
    };
    let asked = view.drive.throttle * view.max_rpm;
    let asking = format!("{} rpm, steering {}", fixed(asked, 0), signed(view.drive.steering));
    fact("command", asking, if asked == 0.0 { Tone::Plain } else { Tone::Good });
    let (age, tone) = age(view.seen);
    fact("state", age, tone);
    for (label, text, tone) in facts(view.seen.and_then(LastState::fresh)) {
        fact(label, text, tone);
    }
    lines.push(String::new());
    if !view.notice.is_empty() {
        lines.extend([out.paint(Tone::Warning, view.notice), String::new()]);
    }
    lines.extend(help(view.reporting).map(|line| out.paint(Tone::Dim, line)));
    lines
}

fn age(seen: Option<&LastState>) -> (String, Tone) {
    match seen {
        Some(seen) if seen.fresh().is_some() => (format!("{} old", describe::age(seen.age())), Tone::Plain),
        Some(seen) => (format!("STALE, {} old", describe::age(seen.age())), Tone::Bad),
        None => ("STALE, no message yet".to_owned(), Tone::Bad),
    }
}

/// Labels stay where they are when nothing is known, so that the eye finds them.
fn facts(state: Option<&RobotState>) -> [(&'static str, String, Tone); 9] {
    let show = |text: fn(&RobotState) -> String| state.map_or_else(|| UNKNOWN.to_owned(), text);
    let blocked =
        state.is_some_and(|state| [state.obstacle.front, state.obstacle.rear].contains(&Some(true)));
    let stands = state.is_some_and(|state| !state.stopped_because.is_empty());
    let warn = |when: bool| if when { Tone::Warning } else { Tone::Plain };
    let latched = state.is_some_and(|state| !state.latches.is_empty());
    let low = state.is_some_and(|state| state.battery_level > BatteryLevel::Ok);
    [
        ("latched", show(latches), if latched { Tone::Bad } else { Tone::Plain }),
        ("mode", show(|state| reasons::name(&state.mode)), Tone::Plain),
        ("speed", show(describe::speed), Tone::Plain),
        ("reference", show(reference), Tone::Plain),
        ("obstacles", show(|state| describe::obstacles(&state.obstacle)), warn(blocked)),
        ("pose", show(|state| describe::pose(&state.pose)), Tone::Plain),
        ("control", show(describe::controlled_by), Tone::Plain),
        ("battery", show(describe::battery), warn(low)),
        ("stopped", show(why), warn(stands)),
    ]
}

fn reference(state: &RobotState) -> String {
    format!("{} rpm, steering {}", fixed(state.reference_rpm, 0), signed(state.steering))
}

fn why(state: &RobotState) -> String {
    if state.stopped_because.is_empty() { "no".to_owned() } else { reasons::reasons(&state.stopped_because) }
}

/// While one is set the robot takes no setpoint.
fn latches(state: &RobotState) -> String {
    if state.latches.is_empty() {
        return "no".to_owned();
    }
    let all: Vec<_> = state.latches.iter().map(describe::latch).collect();
    format!("SETPOINTS REFUSED, r resets: {}", all.join("; "))
}

fn signed(steering: f64) -> String {
    match steering {
        0.0 => "straight".to_owned(),
        s if s > 0.0 => format!("right {}", fixed(s, 2)),
        s => format!("left {}", fixed(-s, 2)),
    }
}

fn help(reporting: Reporting) -> [&'static str; 2] {
    match reporting {
        Reporting::Releases => [
            "hold ↑ ↓ ← → or W S A D to drive and steer · space stops · r resets · q quits",
            "This terminal reports key releases: releasing a key stops at once.",
        ],
        Reporting::Presses => [
            "↑ ↓ or W S drive · ← → or A D steer in steps of 0.25, which stay · space stops · r resets · q \
             quits",
            "This terminal reports no key releases: each press drives for 250 ms, key repeat extends it.",
        ],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;
    use xtb_protocol::messages::Latch;

    #[test]
    fn what_is_not_known_is_not_shown_as_known() {
        let robot = Name::new("xtb-1").unwrap();
        let drive = StickPosition { throttle: 1.0, steering: -0.5 };
        let view = View {
            robot: &robot,
            seen: None,
            drive,
            max_rpm: 30.0,
            reporting: Reporting::Presses,
            notice: "",
        };
        let text = lines(&view, &Output { json: false, colors: false }).join("\n");
        assert!(text.contains("30 rpm, steering left 0.50"), "{text}");
        assert!(text.contains("STALE, no message yet"), "{text}");
        assert_eq!(text.matches(UNKNOWN).count(), 9, "{text}");
        assert!(text.contains("reports no key releases"), "{text}");
    }

    #[test]
    fn a_latch_that_refuses_setpoints_is_named() {
        let latches = vec![fake::latch(Latch::Estop, "cli-123456", false)];
        let state = RobotState { latches, ..fake::state("xtb-1") };
        let seen = LastState { state, at: std::time::Instant::now() };
        let drive = StickPosition { throttle: 1.0, steering: 0.0 };
        let (robot, reporting) = (fake::name("xtb-1"), Reporting::Releases);
        let view = View {
            robot: &robot,
            seen: Some(&seen),
            drive,
            max_rpm: 30.0,
            reporting,
            notice: "xtb-1 refuses: no",
        };
        let text = lines(&view, &Output { json: false, colors: false }).join("\n");
        assert!(text.contains("SETPOINTS REFUSED, r resets: estop by cli-123456 for 12.0 s"), "{text}");
        assert!(text.contains("xtb-1 refuses: no"), "{text}");
    }
}
