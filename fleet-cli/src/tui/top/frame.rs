//! The picture: all panes at their places, the title above, notices and keys below.

use super::labels::fitted;
use super::layout::{Areas, areas};
use super::robot_view::{ShownRobot, Standing, age, sights};
use super::*;
use crate::text::width::text_width;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use xtb_client::dispatcher_client::fleet_stop;

/// Smaller than this there is no use.
const SMALLEST: (u16, u16) = (20, 4);
/// Keys as they stand in the last line, each with its rank: without room for all, those with the highest ranks are
/// left out.
type Hints = &'static [(&'static str, u8)];
const HINTS: Hints = &[
    ("? keys", 3),
    ("Tab robot", 5),
    ("arrows cursor", 8),
    ("Enter go", 4),
    ("t drive", 6),
    ("x reset", 7),
    ("c cancel", 9),
    ("w why", 10),
    ("v tasks", 11),
    ("/ filter", 12),
    ("s S stop", 2),
    ("e E E-STOP", 0),
    ("q quit", 1),
];
const PLAYING_HINTS: Hints = &[
    ("? keys", 2),
    ("Tab robot", 4),
    ("space pause", 1),
    ("arrows seek", 3),
    ("w why", 5),
    ("v tasks", 6),
    ("f follow", 7),
    ("/ filter", 8),
    ("q quit", 0),
];
const READING_HINTS: Hints = &[
    ("? keys", 1),
    ("Tab robot", 2),
    ("w why", 3),
    ("v tasks", 4),
    ("f follow", 5),
    ("+/- zoom", 6),
    ("a all", 7),
    ("/ filter", 8),
    ("q quit", 0),
];
/// While the filter is written.
const TYPING_HINTS: &str = "E E-STOP  S stop all  Enter keep  Esc clear  Tab select";
const BETWEEN_HINTS: &str = "  ";

impl Cockpit {
    /// Draws the fleet as it is at `now_ms`.
    pub(crate) fn draw(&mut self, frame: &mut Frame<'_>, scene: &Scene, now_ms: AtMs) {
        let (look, area) = (self.setup.look, frame.area());
        if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
            frame.render_widget(Line::from("too small; E, S, q"), area);
            return look.reduce(frame.buffer_mut());
        }
        let names = self.setup.robots.clone();
        let sights = sights(scene, &names, now_ms);
        self.settle(&sights);
        self.learn(scene);
        self.notice_alerts(scene, now_ms);
        let areas = areas(area, sights.len());
        let title = self.title(scene, &sights, areas.title.width, now_ms);
        frame.render_widget(fitted(title, areas.title.width), areas.title);
        if let Some(map) = areas.map {
            self.draw_map(frame, map, &sights, now_ms);
        }
        self.draw_table(frame, areas.robots, &sights);
        if let (Some(area), Some(sight)) = (areas.detail, self.sight(&sights)) {
            self.draw_detail(frame, area, sight);
        }
        if let Some(area) = areas.pane {
            self.draw_pane(frame, area, scene, now_ms);
        }
        self.draw_foot(frame, &areas, now_ms);
        self.draw_over(frame, area, &sights, scene);
        look.reduce(frame.buffer_mut());
    }

    /// Makes the floor ready for drawing when there is another one.
    fn learn(&mut self, scene: &Scene) {
        match scene.map() {
            Some(map) if self.floor.as_ref().is_none_or(|floor| floor.hash != map.hash) => {
                self.floor = Some(Floor::of(map));
            }
            Some(_) => {}
            None => self.floor = None,
        }
        if let Some(floor) = self.floor.as_mut().filter(|floor| floor.places != scene.places()) {
            floor.places = scene.places().to_vec();
        }
    }

    /// What matters most about the whole fleet; an alarm takes its place.
    fn title(&self, scene: &Scene, sights: &[ShownRobot<'_>], width: u16, now_ms: AtMs) -> Line<'static> {
        let look = self.setup.look;
        if let Some(alarm) = self.alarm(now_ms) {
            return Line::styled(format!("{alarm:width$}", width = usize::from(width)), look.alarm());
        }
        let mut spans = vec![Span::styled(format!(" {} ", scene.fleet()), look.tone(Tone::Strong))];
        let mut add = |text: String, tone: Tone| {
            spans.push(Span::raw("· "));
            spans.push(Span::styled(format!("{text} "), look.tone(tone)));
        };
        if let Some(playing) = &self.playing {
            add(play_words(playing), Tone::Strong);
        }
        let plural = if sights.len() == 1 { "robot" } else { "robots" };
        add(format!("{} {plural}", sights.len()), Tone::Plain);
        let count =
            |wanted: &[Standing]| sights.iter().filter(|sight| wanted.contains(&sight.standing())).count();
        for (wanted, words) in [
            (&[Standing::Drives][..], "driving"),
            (&[Standing::Hindered], "blocked"),
            (&[Standing::Latched], "LATCHED"),
            (&[Standing::Faulty], "FAULTY"),
            (&[Standing::Stale], "STALE"),
            (&[Standing::Gone, Standing::Missing], "MISSING"),
        ] {
            let found = count(wanted);
            if found > 0 {
                add(format!("{found} {words}"), wanted[0].tone());
            }
        }
        let alerts = self.open_alerts(scene).count();
        if alerts > 0 {
            add(format!("{alerts} ALERT{} (o)", if alerts == 1 { "" } else { "S" }), Tone::Bad);
        }
        if let Some(stats) = scene.slow_simulator(now_ms) {
            add(xtb_client::text::robot::simulator(&stats), Tone::Warning);
        }
        if self.playing.is_none() {
            let is = |there: bool| if there { Tone::Plain } else { Tone::Dim };
            let (dispatcher, traffic) = (scene.dispatcher(), scene.traffic_control());
            match fleet_stop(scene.suspended()) {
                Some(_) => add("dispatcher SUSPENDED (v)".to_owned(), Tone::Bad),
                None if scene.suspended().is_empty() => {
                    add(if dispatcher { "dispatcher" } else { "no dispatcher" }.to_owned(), is(dispatcher));
                }
                None => {
                    let tasks: u64 = scene.suspended().iter().map(|suspension| suspension.tasks).sum();
                    add(format!("dispatcher, {tasks} tasks SUSPENDED (v)"), Tone::Warning);
                }
            }
            add(if traffic { "traffic" } else { "no traffic" }.to_owned(), is(traffic));
        }
        if self.unreadable > 0 {
            add(format!("{} unreadable", self.unreadable), Tone::Warning);
        }
        if scene.refused() > 0 {
            add(format!("{} refused", scene.refused()), Tone::Warning);
        }
        Line::from(spans)
    }

    /// What must be known before anything else is looked at.
    fn alarm(&self, now_ms: AtMs) -> Option<String> {
        if self.leaving > 0 {
            let open = self.commands.under_way().len() + usize::from(self.grip.is_some());
            return Some(format!(" QUITTING: {open} not answered yet; q quits at once"));
        }
        if !self.link.0 {
            let since = age(Some(now_ms.saturating_sub(self.link.1)));
            return Some(format!(" NO LINK to the router for {since}: commands do not reach the robots"));
        }
        match self.grip.as_ref()? {
            Grip::Asking(robot) => Some(format!(" DRIVE {robot}: requesting control")),
            Grip::Ending(robot) => Some(format!(" DRIVE {robot}: releasing control")),
            Grip::Driving { robot, max_rpm, keyboard } => {
                let drive = keyboard.drive(Stamp::from_ms(now_ms));
                let asked = xtb_client::text::robot::fixed(drive.throttle * max_rpm, 0);
                let side = xtb_client::text::robot::fixed(drive.steering, 2);
                Some(format!(
                    " DRIVING {robot}: {asked} rpm, steering {side}   hold arrows, space stop, t end"
                ))
            }
        }
    }

    /// What was told and is not answered, and the keys.
    fn draw_foot(&self, frame: &mut Frame<'_>, areas: &Areas, now_ms: AtMs) {
        let look = self.setup.look;
        let asked = self.commands.under_way().iter().rev().map(|open| {
            let tone = if open.command.is_stop() { Tone::Warning } else { Tone::Plain };
            (open.since_ms, format!("{}: sent, no answer yet", open.command.words()), tone)
        });
        let told = self.commands.notices().map(|notice| (notice.at_ms, notice.text.clone(), notice.tone));
        let mut lines: Vec<(AtMs, String, Tone)> = told.chain(asked).collect();
        lines.sort_by_key(|(at_ms, ..)| std::cmp::Reverse(*at_ms));
        lines.truncate(usize::from(areas.notices.height));
        let line = |(at_ms, text, tone): (AtMs, String, Tone)| {
            let since = age(Some(now_ms.saturating_sub(at_ms)));
            fitted(Line::styled(format!(" {since:>7}  {text}"), look.tone(tone)), areas.notices.width)
        };
        let lines: Vec<Line<'_>> = lines.into_iter().map(line).collect();
        frame.render_widget(Paragraph::new(lines), areas.notices);
        let hints = match (&self.playing, self.setup.read_only) {
            (Some(_), _) => PLAYING_HINTS,
            (_, Some(_)) => READING_HINTS,
            _ => HINTS,
        };
        let keys = Rect { x: areas.keys.x + 1, width: areas.keys.width.saturating_sub(1), ..areas.keys };
        let (hints, tone) = match self.filter.typing {
            true => (format!("/{}_   {TYPING_HINTS}", self.filter.text), Tone::Strong),
            false => (hints_within(hints, usize::from(keys.width)), Tone::Dim),
        };
        frame.render_widget(Line::styled(hints, look.tone(tone)), keys);
    }
}

/// As many keys as fit into `room` columns, but at least one.
fn hints_within(all: Hints, room: usize) -> String {
    let first = |count: usize| {
        let shown = all.iter().filter(|(_, rank)| usize::from(*rank) < count).map(|(text, _)| *text);
        shown.collect::<Vec<_>>().join(BETWEEN_HINTS)
    };
    let fits = (2..=all.len()).rev().map(first).find(|text| text_width(text) <= room);
    fits.unwrap_or_else(|| first(1))
}

fn play_words(playing: &Playing) -> String {
    let Playing { at_s, length_s, speed, stands } = playing;
    let stands = stands.as_ref().map(|why| format!(", {why}")).unwrap_or_default();
    format!("RECORDING {at_s:.1} of {length_s:.1} s, {speed}x{stands}")
}
