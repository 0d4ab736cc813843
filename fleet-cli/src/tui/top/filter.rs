//! Which robots the table shows, and in which order: those in trouble first, then by their numbers. The page's
//! `robot_filter.js` says the same.
//!
//! A filter is words between blanks; a robot is shown if it fits all of them: `@north` = it has a tag that begins so;
//! `latched` = its state, or the beginning of it from three letters on; `7` = the number at the end of its name, or,
//! if nobody has just that one, a part of the name; anything else = a part of its name or of its alias.

use super::robot_view::{ShownRobot, Standing};
use super::*;

/// Letters of a state that mean it.
const STATE_FROM: usize = 3;
/// Longer than any name.
const LONGEST: usize = 40;

/// What each state is called in a filter.
fn word(standing: Standing) -> &'static str {
    match standing {
        Standing::Latched => "latched",
        Standing::Faulty => "faulty",
        Standing::Missing | Standing::Gone => "missing",
        Standing::Stale => "stale",
        Standing::Hindered => "blocked",
        Standing::Stands => "stopped",
        Standing::Drives => "driving",
    }
}

/// The lower, the sooner somebody has to look.
fn urgency(standing: Standing) -> u8 {
    match standing {
        Standing::Latched => 0,
        Standing::Faulty => 1,
        Standing::Missing | Standing::Gone | Standing::Stale => 2,
        Standing::Hindered => 3,
        Standing::Stands | Standing::Drives => 4,
    }
}

fn fits(sight: &ShownRobot<'_>, part: &str) -> bool {
    if let Some(tag) = part.strip_prefix('@') {
        let mut tags = sight.robot.roster.iter().flat_map(|entry| &entry.tags);
        return tags.any(|own| own.trim_start_matches('@').to_lowercase().starts_with(tag));
    }
    let name = sight.name.as_str().contains(part)
        || sight.alias.is_some_and(|alias| alias.to_lowercase().contains(part));
    name || (part.len() >= STATE_FROM && word(sight.standing()).starts_with(part))
}

/// The number at the end of its name.
fn number(sight: &ShownRobot<'_>) -> Option<u64> {
    let name = sight.name.as_str();
    name[name.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse().ok()
}

/// What the person filters by.
#[derive(Debug, Clone, Default)]
pub(super) struct Filter {
    /// In small letters; empty = all robots.
    pub(super) text: String,
    /// Whether keys go on writing it.
    pub(super) typing: bool,
}

impl Filter {
    /// Those that fit, as the table shows them.
    fn found<'a>(&self, sights: &[ShownRobot<'a>]) -> Vec<ShownRobot<'a>> {
        let parts: Vec<&str> = self.text.split_whitespace().collect();
        let numbers: Vec<u64> = parts.iter().filter_map(|part| part.parse().ok()).collect();
        let is_named = |sight: &ShownRobot<'_>| number(sight).is_some_and(|own| numbers.contains(&own));
        let fit = sights.iter().filter(|sight| parts.iter().all(|part| fits(sight, part)));
        let mut found: Vec<ShownRobot<'a>> = fit.copied().collect();
        found.sort_by_key(|sight| (!is_named(sight), urgency(sight.standing())));
        found
    }
}

impl Cockpit {
    /// The robots of the table. The selected one is always among them: keys act on it.
    pub(super) fn listed<'a>(&self, sights: &[ShownRobot<'a>]) -> Vec<ShownRobot<'a>> {
        let mut found = self.filter.found(sights);
        let selected = sights.iter().find(|sight| Some(sight.name) == self.selected.as_ref());
        if let Some(selected) = selected
            && !found.iter().any(|sight| sight.name == selected.name)
        {
            found.push(*selected);
        }
        found
    }

    /// How many robots fit.
    pub(super) fn fitting(&self, sights: &[ShownRobot<'_>]) -> usize {
        self.filter.found(sights).len()
    }

    /// Whether a key writes the filter. `E` and `S` never do: they stop all robots here too. A question that comes
    /// up meanwhile waits, so that no letter answers it.
    pub(super) fn writes(&mut self, key: &KeyEvent, scene: &Scene, now_ms: AtMs) -> bool {
        if !self.filter.typing || key.modifiers.intersects(KeyModifiers::CONTROL | KeyModifiers::ALT) {
            return false;
        }
        let shift = key.modifiers.contains(KeyModifiers::SHIFT);
        if let KeyCode::Char(c) = key.code
            && matches!(if shift { c.to_ascii_uppercase() } else { c }, 'E' | 'S')
        {
            return false;
        }
        if key.kind == KeyEventKind::Release {
            return true;
        }
        let sights = sights(scene, &self.setup.robots, now_ms);
        match key.code {
            KeyCode::Enter => self.filter.typing = false,
            KeyCode::Esc => self.filter = Filter::default(),
            KeyCode::Up | KeyCode::BackTab => self.step(&sights, -1),
            KeyCode::Down | KeyCode::Tab => self.step(&sights, 1),
            KeyCode::Backspace => {
                self.filter.typing = self.filter.text.pop().is_some();
                self.select_first(&sights);
            }
            KeyCode::Char(c) if !c.is_control() && self.filter.text.len() < LONGEST => {
                self.filter.text.extend(c.to_lowercase());
                self.select_first(&sights);
            }
            _ => {}
        }
        true
    }

    /// Only while it is written: a robot that fits no longer keeps the selection.
    fn select_first(&mut self, sights: &[ShownRobot<'_>]) {
        let found = self.filter.found(sights);
        let Some(first) = found.first() else { return };
        let is_exact = number(first).is_some_and(|own| self.names(own));
        let fits = found.iter().any(|sight| Some(sight.name) == self.selected.as_ref());
        if !self.filter.text.is_empty() && (is_exact || !fits) {
            self.selected = Some(first.name.clone());
        }
    }

    /// Whether the filter has this number as a word.
    fn names(&self, number: u64) -> bool {
        self.filter.text.split_whitespace().any(|part| part.parse() == Ok(number))
    }
}
