//! `teleop`: drive a robot by hand, hold-to-run.
//!
//! Every way out ends in zero: letting go, leaving, an error and a lost focus on this side; silence
//! for 200 ms on the robot's own clock if this side is gone altogether.

mod deadman;
mod gamepad;
pub(crate) mod keys;
mod screen;

use super::take_control;
use crate::args::LeaseArgs;
use crate::context::Context;
use crate::exit::Exit;
use crate::interrupt::interrupted;
use crate::json::{LineKind, line_of};
use crate::terminal::{Input, Terminal};
use crate::values::rpm;
use clap::Args;
use crossterm::event::{KeyCode, KeyEvent, KeyEventKind};
use gamepad::Gamepads;
use keys::{Action, Key, Keyboard, Reporting};
use schemars::JsonSchema;
use serde::Serialize;
use std::io::IsTerminal;
use std::pin::{Pin, pin};
use std::time::Duration;
use tokio::time::{Interval, MissedTickBehavior};
use xtb_client::client::Client;
use xtb_client::state_feed::StateFeed;
use xtb_client::teleop::{CAUTIOUS_RPM, SEND_EVERY, TeleopSession, lost};
use xtb_client::{Error, ErrorKind, Result};
use xtb_control::Stamp;
use xtb_protocol::messages::{Body, Done};
use xtb_protocol::{Name, Uuid};

/// Arguments of `teleop`.
#[derive(Debug, Clone, Args)]
pub struct TeleopArgs {
    /// Robot.
    #[arg(value_name = "ROBOT", value_parser = Name::robot)]
    pub robot: Name,
    /// Maximum wheel speed, in rpm [default: the robot's limit].
    #[arg(long, value_name = "R", value_parser = rpm)]
    pub max_rpm: Option<f64>,
    /// Drive with a gamepad too: hold a shoulder button (LB or RB) and use the left stick.
    #[arg(long)]
    #[cfg_attr(not(feature = "gamepad"), arg(hide = true))]
    pub gamepad: bool,
    /// Control of the robot.
    #[command(flatten)]
    pub lease: LeaseArgs,
}

/// The gamepad is looked at so often.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// The screen is painted each second time.
const PAINT_EVERY: Duration = Duration::from_millis(100);

#[derive(Debug, Serialize, JsonSchema)]
struct Report<'a> {
    robot: &'a Name,
    setpoints: u64,
    /// Whether the robot has confirmed the stop at the end; `None` = it was not driven.
    stopped: Option<bool>,
    /// From whom control was taken.
    taken_from: Option<&'a str>,
}

/// What it prints with `--json`.
pub(super) const JSON: &[LineKind] = &[line_of::<Report<'_>>];

/// Drives until the operator leaves.
///
/// # Errors
/// No terminal, no router, no answer, a refusal, or somebody else took over.
pub async fn run(ctx: &Context, args: &TeleopArgs) -> Result<Exit> {
    if !std::io::stdin().is_terminal() || !std::io::stdout().is_terminal() {
        return Err(Error::new(ErrorKind::Invalid, "teleop needs a terminal for its keys and its screen")
            .hint(
                "programs publish setpoints on xtb/<fleet>/<robot>/teleop/<client>; see docs/protocol.md",
            ));
    }
    let mut pads = args.gamepad.then(Gamepads::open).transpose()?;
    let begun = async {
        let client = Client::open(&ctx.settings).await?;
        let control = take_control(ctx, &client, &args.robot, args.lease.take).await?;
        let limit = client.about(&args.robot).await?.map_or(CAUTIOUS_RPM, |about| about.limits.max_rpm);
        Ok::<_, Error>((client, control, limit))
    };
    let (client, control, limit) = tokio::select! {
        begun = begun => begun?,
        () = interrupted() => {
            let message = format!("interrupted: {} was not driven", args.robot);
            return Err(Error::new(ErrorKind::Interrupted, message));
        }
    };
    let max_rpm = args.max_rpm.unwrap_or(limit).min(limit);
    let wheel = TeleopSession::new(&client, &control, &args.robot, max_rpm);
    let driven = drive(ctx, wheel, &mut pads).await;
    let taken_from = control.taken_from().map(str::to_owned);
    control.release().await;
    client.close().await;
    let (setpoints, stopped) = driven?;
    let report = Report { robot: &args.robot, setpoints, stopped, taken_from: taken_from.as_deref() };
    ctx.out.result(&report, goodbye)?;
    Ok(Exit::Done)
}

fn goodbye(report: &Report<'_>) -> String {
    let robot = report.robot;
    match report.stopped {
        None => format!("{robot} was not driven; control released"),
        Some(true) => format!("{robot} confirmed the stop; control released"),
        Some(false) => {
            format!("{robot} did not confirm the stop: the last setpoint times out within 250 ms")
        }
    }
}

/// How many setpoints were sent, and whether the stop after them was confirmed.
async fn drive(
    ctx: &Context,
    mut wheel: TeleopSession<'_>,
    pads: &mut Option<Gamepads>,
) -> Result<(u64, Option<bool>)> {
    let feed = StateFeed::open(wheel.client, &wheel.client.keys().robot(wheel.robot)).await?;
    let mut terminal = Terminal::open()?;
    let reporting = if terminal.reports_release() { Reporting::Releases } else { Reporting::Presses };
    let mut keyboard = Keyboard::new(reporting);
    let ended = hands_on(ctx, &mut wheel, &feed, &mut terminal, (&mut keyboard, pads)).await;
    let stopped = wheel.let_go(&feed).await;
    ended.map(|()| (wheel.sent, stopped))
}

async fn hands_on(
    ctx: &Context,
    wheel: &mut TeleopSession<'_>,
    feed: &StateFeed,
    terminal: &mut Terminal,
    (keyboard, pads): (&mut Keyboard, &mut Option<Gamepads>),
) -> Result<()> {
    let reporting = if terminal.reports_release() { Reporting::Releases } else { Reporting::Presses };
    let mut stop = pin!(interrupted());
    let (mut send, mut paint, mut look) = (ticks(SEND_EVERY), ticks(PAINT_EVERY), ticks(LOOK_EVERY));
    let control = wheel.control;
    let (mut resetting, mut notice): (Option<Resetting<'_>>, _) = (None, String::new());
    loop {
        let turn = tokio::select! {
            // What ends or changes motion comes before what repeats it.
            biased;
            () = &mut stop => return Ok(()),
            input = terminal.next() => Turn::Input(input),
            answer = answered(&mut resetting), if resetting.is_some() => Turn::Reset(answer),
            _ = look.tick(), if pads.is_some() => Turn::Look,
            _ = send.tick() => Turn::Send,
            _ = paint.tick() => Turn::Paint,
        };
        // Not before the wait: what was pressed is as old as its event, not as the turn before it.
        let now = wheel.client.now();
        match turn {
            Turn::Input(input) => match heed(keyboard, now, input) {
                Heed::Leave => return Ok(()),
                Heed::Ignore => {}
                Heed::Reset => {
                    let reset = Body::Reset { latch: None };
                    resetting.get_or_insert_with(|| Box::pin(control.request(Uuid::new_v4(), reset)));
                    send.reset_immediately();
                }
                // Not at the next tick: letting go means zero at once.
                Heed::Send => {
                    notice.clear();
                    send.reset_immediately();
                }
            },
            Turn::Reset(Ok(_)) => "reset; press a key to drive".clone_into(&mut notice),
            Turn::Reset(Err(failure)) => notice = failure.to_string(),
            Turn::Look => {
                let before = keyboard.drive(now);
                keyboard.pad(now, pads.as_mut().and_then(Gamepads::look));
                if before.throttle != 0.0 && keyboard.drive(now).throttle == 0.0 {
                    send.reset_immediately();
                }
            }
            Turn::Send => {
                if let Some(failure) = wheel.control.lost() {
                    return Err(lost(wheel, feed, failure));
                }
                if let Some(drive) = keyboard.send(now) {
                    wheel.send(drive, feed).await?;
                }
            }
            Turn::Paint => {
                let seen = feed.last(wheel.robot);
                let late = wheel.refused(feed).unwrap_or_default();
                terminal.paint(&screen::lines(
                    &screen::View {
                        robot: wheel.robot,
                        seen: seen.as_ref(),
                        drive: keyboard.drive(now),
                        max_rpm: wheel.max_rpm,
                        reporting,
                        notice: if late.is_empty() { &notice } else { &late },
                    },
                    &ctx.out,
                ))?;
            }
        }
    }
}

/// A reset that is on its way; driving and painting go on meanwhile.
type Resetting<'a> = Pin<Box<dyn Future<Output = xtb_client::Result<Done>> + Send + 'a>>;

/// Its answer; it is then no longer on its way.
async fn answered(resetting: &mut Option<Resetting<'_>>) -> xtb_client::Result<Done> {
    let Some(asking) = resetting else { return std::future::pending().await };
    let answer = asking.await;
    *resetting = None;
    answer
}

/// What woke the loop.
enum Turn {
    Input(Option<Input>),
    Reset(xtb_client::Result<Done>),
    Look,
    Send,
    Paint,
}

/// What an input asks of the loop.
#[derive(Debug, PartialEq, Eq)]
enum Heed {
    Leave,
    Ignore,
    Send,
    Reset,
}

/// Ticks that leave out those that were missed: after a stall nothing old is sent in a burst.
pub(super) fn ticks(every: Duration) -> Interval {
    let mut ticks = tokio::time::interval(every);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Skip);
    ticks
}

fn heed(keyboard: &mut Keyboard, now: Stamp, input: Option<Input>) -> Heed {
    match input {
        // The terminal is gone.
        None => Heed::Leave,
        Some(Input::Key(key)) if is_leaving(&key) => Heed::Leave,
        Some(Input::Key(key)) if is_reset(&key) => {
            // What is held must be pressed anew: a reset moves nothing.
            keyboard.let_go();
            Heed::Reset
        }
        Some(Input::Key(key)) => match meaning(&key) {
            Some((key, action)) => {
                keyboard.key(now, key, action);
                Heed::Send
            }
            None => Heed::Ignore,
        },
        Some(Input::FocusLost) => {
            keyboard.let_go();
            Heed::Send
        }
    }
}

fn is_leaving(key: &KeyEvent) -> bool {
    key.kind != KeyEventKind::Release && (key.code == KeyCode::Char('q') || Input::leaves(key))
}

fn is_reset(key: &KeyEvent) -> bool {
    key.kind == KeyEventKind::Press && matches!(key.code, KeyCode::Char('r' | 'R'))
}

fn meaning(event: &KeyEvent) -> Option<(Key, Action)> {
    let key = match event.code {
        KeyCode::Up => Key::Ahead,
        KeyCode::Down => Key::Astern,
        KeyCode::Left => Key::Left,
        KeyCode::Right => Key::Right,
        KeyCode::Char(c) => match c.to_ascii_lowercase() {
            'w' => Key::Ahead,
            's' => Key::Astern,
            'a' => Key::Left,
            'd' => Key::Right,
            ' ' => Key::Stop,
            _ => return None,
        },
        _ => return None,
    };
    let action = match event.kind {
        KeyEventKind::Press => Action::Press,
        KeyEventKind::Repeat => Action::Repeat,
        KeyEventKind::Release => Action::Release,
    };
    Some((key, action))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crossterm::event::KeyModifiers;

    fn press(code: KeyCode) -> Option<Input> {
        Some(Input::Key(KeyEvent::new(code, KeyModifiers::NONE)))
    }

    #[test]
    fn inputs_drive_let_go_or_leave() {
        let (mut keyboard, now) = (Keyboard::new(Reporting::Releases), Stamp::from_ms(7));
        assert_eq!(heed(&mut keyboard, now, press(KeyCode::Char('W'))), Heed::Send);
        assert_eq!(keyboard.drive(now).throttle, 1.0);
        assert_eq!(heed(&mut keyboard, now, press(KeyCode::Char('x'))), Heed::Ignore);
        assert_eq!(heed(&mut keyboard, now, Some(Input::FocusLost)), Heed::Send);
        assert_eq!(keyboard.drive(now).throttle, 0.0);
        heed(&mut keyboard, now, press(KeyCode::Char('W')));
        assert_eq!(heed(&mut keyboard, now, press(KeyCode::Char('r'))), Heed::Reset);
        assert_eq!(keyboard.drive(now).throttle, 0.0, "a reset lets go");
        assert_eq!(heed(&mut keyboard, now, press(KeyCode::Char('q'))), Heed::Leave);
        assert_eq!(heed(&mut keyboard, now, None), Heed::Leave);
    }

    #[tokio::test]
    async fn ticks_that_were_missed_do_not_come_in_a_burst() {
        assert_eq!(ticks(SEND_EVERY).missed_tick_behavior(), MissedTickBehavior::Skip);
    }
}
