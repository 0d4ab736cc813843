//! What needs a person: a line and the terminal's bell when there is a new alert, a list, a key that acknowledges.

use super::*;
use ratatui::text::{Line, Span};
use xtb_client::text::robot as describe;
use xtb_protocol::messages::{Alert, AlertState};

/// New alerts that are told one by one; of more the number is told.
const TOLD: usize = 2;

impl Cockpit {
    /// Tells of alerts that are new, with the bell. A recording tells of none.
    pub(super) fn notice_alerts(&mut self, scene: &Scene, now_ms: AtMs) {
        if self.playing.is_some() {
            return;
        }
        let newest = scene.alerts().and_then(|list| list.alerts.last()).map(|alert| alert.id);
        // Another dispatcher counts anew.
        let seen = self.alerts_seen.min(newest.unwrap_or(self.alerts_seen));
        let new: Vec<&Alert> = self.open_alerts(scene).filter(|alert| alert.id > seen).collect();
        let Some(last) = new.last() else { return };
        self.alerts_seen = last.id;
        self.rings = true;
        if new.len() > TOLD {
            let text = format!("ALERT: {} new ones; v shows them, o acknowledges all", new.len());
            return self.commands.tell(now_ms, Tone::Bad, text);
        }
        for alert in new {
            self.commands.tell(now_ms, Tone::Bad, format!("ALERT (o: seen): {}", alert.text));
        }
    }

    /// Whether the terminal's bell is to ring, once.
    pub(crate) fn take_bell(&mut self) -> bool {
        std::mem::take(&mut self.rings)
    }

    /// Those that nobody has acknowledged, of the robots that are shown and of the fleet as a whole.
    pub(super) fn open_alerts<'a>(&self, scene: &'a Scene) -> impl Iterator<Item = &'a Alert> + use<'a> {
        let shown = self.setup.robots.clone();
        let open = scene.alerts().into_iter().flat_map(|alerts| &alerts.alerts);
        open.filter(|alert| alert.is_open()).filter(move |alert| {
            shown.is_empty() || alert.robot.as_ref().is_none_or(|robot| shown.contains(robot))
        })
    }

    /// Says that the person has seen all that are open.
    pub(super) fn acknowledge(&mut self, scene: &Scene, now_ms: AtMs) -> Vec<Action> {
        let ids: Vec<u64> = self.open_alerts(scene).map(|alert| alert.id).collect();
        if ids.is_empty() {
            let none = if scene.alerts().is_some() { "no open alerts" } else { "no alerts: no dispatcher" };
            self.commands.tell(now_ms, Tone::Plain, none);
            return Vec::new();
        }
        self.wish(Command::Acknowledge { ids }, now_ms)
    }

    /// All that have not ended, the newest first, each with what to do.
    pub(super) fn alert_lines(&self, scene: &Scene) -> (String, Vec<Line<'static>>) {
        let Some(list) = scene.alerts() else {
            return ("alerts (v: events): unknown, no dispatcher found".to_owned(), Vec::new());
        };
        let left: Vec<&Alert> =
            list.alerts.iter().rev().filter(|alert| alert.state() != AlertState::Ended).collect();
        let open = left.iter().filter(|alert| alert.is_open()).count();
        let lines = left.iter().flat_map(|alert| {
            let tone = if alert.is_open() { Tone::Bad } else { Tone::Warning };
            let since = std::time::Duration::from_millis(list.at_ms.saturating_sub(alert.since_ms));
            let by = alert.acknowledged.as_ref().map(|ack| format!(" (seen by {})", ack.who()));
            let text = format!("{}{}", alert.text, by.unwrap_or_default());
            let since =
                Span::styled(format!(" {:>10} ", describe::age(since)), self.setup.look.tone(Tone::Dim));
            [
                Line::from(vec![since, Span::styled(text, self.setup.look.tone(tone))]),
                Line::styled(format!("  → {}", alert.remedy), self.setup.look.tone(Tone::Dim)),
            ]
        });
        (format!("alerts (v: events): {open} open (o: seen)"), lines.collect())
    }
}
