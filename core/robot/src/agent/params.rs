//! Settings that may change while the robot runs: one table, who may change what and when, and who did.
//!
//! Only settings of the second level: what the first level decides follows from its samples and commands, which are
//! recorded, so that a recording replays bit for bit whatever was changed. The one that concerns the first level's
//! obstacle rule reaches it as a sample ([`Sample::Obstacle`](xtb_control::Sample::Obstacle)). A lower speed needs no
//! control of the robot, as a stop needs none: a speed limit reaches robots that others drive.

use super::{Agent, TurnView};
use std::collections::VecDeque;
use xtb_control::config::{Allowed, Parameter};
use xtb_control::{Stamp, VehicleConfig};
use xtb_nav::NavSettings;
use xtb_protocol::Name;
use xtb_protocol::messages::{
    Lease, MAX_PARAM_CHANGES, ParamBody, ParamCareful, ParamChange, ParamCode, ParamInfo, ParamList,
    ParamOutcome, ParamReply, ParamRequest, ParamValue, ParamWhen,
};

/// A setting that may change.
struct Changeable {
    name: &'static str,
    when: ParamWhen,
    careful: ParamCareful,
    of: fn(&mut NavSettings) -> &mut f64,
}

const OBSTACLE: &str = "navigation.drive.obstacle_cm";

/// All of them; unit, range and what each is stand in the table of `NavSettings`.
const CHANGEABLE: [Changeable; 11] = {
    use ParamCareful::{Lower, No};
    use ParamWhen::{Always, Standing};
    const fn row(
        name: &'static str,
        when: ParamWhen,
        careful: ParamCareful,
        of: fn(&mut NavSettings) -> &mut f64,
    ) -> Changeable {
        Changeable { name, when, careful, of }
    }
    [
        row("navigation.drive.limit_mps", Always, Lower, |s| &mut s.drive.limit_mps),
        row("navigation.drive.cruise_mps", Always, Lower, |s| &mut s.drive.cruise_mps),
        row("navigation.drive.meeting_mps", Always, Lower, |s| &mut s.drive.meeting_mps),
        row(OBSTACLE, Always, No, |s| &mut s.drive.obstacle_cm),
        row("navigation.drive.look_ahead_m", Standing, No, |s| &mut s.drive.look_ahead_m),
        row("navigation.drive.look_ahead_s", Standing, No, |s| &mut s.drive.look_ahead_s),
        row("navigation.drive.deviation_m", Standing, No, |s| &mut s.drive.deviation_m),
        row("navigation.drive.no_motion_s", Standing, No, |s| &mut s.drive.no_motion_s),
        row("navigation.drive.no_progress_s", Standing, No, |s| &mut s.drive.no_progress_s),
        row("navigation.arrival.tolerance_m", Standing, No, |s| &mut s.arrival.tolerance_m),
        row("navigation.arrival.tolerance_deg", Standing, No, |s| &mut s.arrival.tolerance_deg),
    ]
};

/// The settings in force, those in the file, and the last changes.
#[derive(Debug, Clone)]
pub(super) struct Params {
    vehicle: VehicleConfig,
    settings: NavSettings,
    saved: NavSettings,
    changes: VecDeque<(Stamp, Name, ParamValue, f64)>,
    /// Changes that nobody has taken to the recording yet.
    news: VecDeque<ParamChange>,
}

type Refusal = (ParamCode, String, &'static str);

impl Params {
    pub(super) fn new(vehicle: &VehicleConfig, settings: &NavSettings) -> Self {
        let mut settings = settings.clone();
        let obstacle_cm = &mut settings.drive.obstacle_cm;
        *obstacle_cm = obstacle_cm.max(vehicle.obstacle.threshold_cm);
        Self {
            vehicle: vehicle.clone(),
            saved: settings.clone(),
            settings,
            changes: VecDeque::new(),
            news: VecDeque::new(),
        }
    }

    /// No faster than this, however it is driven, in m/s.
    pub(super) fn limit_mps(&self) -> f64 {
        self.settings.drive.limit_mps
    }

    /// What is nearer to a bumper than this is an obstacle, in cm.
    pub(super) fn obstacle_cm(&self) -> f64 {
        self.settings.drive.obstacle_cm
    }

    fn list(&self, now: Stamp) -> ParamList {
        let table = self.settings.parameters();
        let info = |row: &Changeable| Some(info(row, find(&table, row.name)?, &self.settings, &self.saved));
        let change = |(at, by, to, from): &(Stamp, Name, ParamValue, f64)| ParamChange {
            tick_ms: at.ms(),
            age_ms: now.since_ms(*at),
            by: by.clone(),
            name: to.name.clone(),
            from: *from,
            to: to.value,
        };
        ParamList {
            params: CHANGEABLE.iter().filter_map(info).map(|info| self.bounded(info)).collect(),
            changes: self.changes.iter().map(change).collect(),
        }
    }

    /// Never nearer than the vehicle's own rule.
    fn bounded(&self, info: ParamInfo) -> ParamInfo {
        let least = if info.name == OBSTACLE { self.vehicle.obstacle.threshold_cm } else { info.min };
        ParamInfo { min: info.min.max(least), ..info }
    }

    /// The settings with these values, those of the table that differ, and whether that is only more careful.
    fn with(&self, values: &[ParamValue]) -> Result<(NavSettings, Vec<&'static Changeable>, bool), Refusal> {
        let mut new = self.settings.clone();
        for ParamValue { name, value } in values {
            let Some(row) = CHANGEABLE.iter().find(|row| row.name == name) else {
                let message = format!("{name} cannot be changed while the robot runs");
                return Err((ParamCode::UnknownParam, message, "`fleet-cli param list` shows what can"));
            };
            *(row.of)(&mut new) = *value;
        }
        let table = new.parameters();
        if let Err(error) = xtb_control::config::validate(&table) {
            return Err((
                ParamCode::OutOfRange,
                error.to_string(),
                "`fleet-cli param list` shows the ranges",
            ));
        }
        let least_cm = self.vehicle.obstacle.threshold_cm;
        if new.drive.obstacle_cm < least_cm {
            let message = format!("the vehicle's obstacle.threshold_cm is {least_cm}");
            return Err((ParamCode::Conflict, message, "only more distance can be kept while it runs"));
        }
        let fits = new.validate().and_then(|()| new.validate_for(&self.vehicle));
        fits.map_err(|error| {
            (ParamCode::Conflict, error.to_string(), "change both settings in one command, or another value")
        })?;
        let (mut before, mut after) = (self.settings.clone(), new.clone());
        let mut differing = Vec::new();
        let mut careful = true;
        for row in &CHANGEABLE {
            let (from, to) = (*(row.of)(&mut before), *(row.of)(&mut after));
            if from != to {
                differing.push(row);
                careful &= row.careful == ParamCareful::Lower && to < from;
            }
        }
        Ok((new, differing, careful))
    }

    fn apply(&mut self, now: Stamp, by: &Name, mut new: NavSettings, rows: &[&Changeable]) {
        for row in rows {
            let (from, to) = (*(row.of)(&mut self.settings), *(row.of)(&mut new));
            if self.changes.len() == MAX_PARAM_CHANGES {
                self.changes.pop_front();
            }
            let name = row.name.to_owned();
            self.changes.push_back((now, by.clone(), ParamValue { name: name.clone(), value: to }, from));
            if self.news.len() == MAX_PARAM_CHANGES {
                self.news.pop_front();
            }
            let (by, tick_ms) = (by.clone(), now.ms());
            self.news.push_back(ParamChange { tick_ms, age_ms: 0, by, name, from, to });
        }
        self.settings = new;
    }
}

fn find<'a>(table: &'a [Parameter], name: &str) -> Option<&'a Parameter> {
    table.iter().find(|parameter| parameter.name == name)
}

fn info(row: &Changeable, parameter: &Parameter, now: &NavSettings, saved: &NavSettings) -> ParamInfo {
    let (min, max) = match parameter.allowed {
        Allowed::Range(min, max) => (min, max),
        _ => (f64::MIN, f64::MAX),
    };
    ParamInfo {
        name: row.name.to_owned(),
        value: *(row.of)(&mut now.clone()),
        saved: *(row.of)(&mut saved.clone()),
        unit: parameter.unit.to_owned(),
        min,
        max,
        when: row.when,
        careful: row.careful,
        about: parameter.about.to_owned(),
    }
}

impl Agent {
    /// What is nearer to a bumper than this is an obstacle, in cm; no less than the vehicle's own rule says.
    #[must_use]
    pub fn obstacle_cm(&self) -> f64 {
        self.params.obstacle_cm()
    }

    /// A question about settings, or a change; the answer is final. Of a save it is that of a robot that has saved:
    /// whoever writes the file asks [`Agent::params_to_save`] before.
    pub fn param(
        &mut self,
        now: Stamp,
        client: &Name,
        request: &ParamRequest,
        view: TurnView<'_>,
    ) -> ParamReply {
        let done = match &request.body {
            ParamBody::List {} => Ok(()),
            ParamBody::Set { values } => self.set_params(now, client, request.lease, values, view),
            ParamBody::Save {} => self.check_param_lease(now, client, request.lease),
        };
        let result = match done {
            Ok(()) => ParamOutcome::Ok(self.params.list(now)),
            Err((code, message, hint)) => return ParamReply::refused(request.id, code, message, hint),
        };
        ParamReply { id: request.id, result }
    }

    fn set_params(
        &mut self,
        now: Stamp,
        client: &Name,
        lease: Option<Lease>,
        values: &[ParamValue],
        view: TurnView<'_>,
    ) -> Result<(), Refusal> {
        let (new, rows, is_careful) = self.params.with(values)?;
        if !is_careful {
            self.check_param_lease(now, client, lease)?;
        }
        let moves = self.under_way() || !view.neutral;
        if let Some(row) = rows.iter().find(|row| row.when == ParamWhen::Standing && moves) {
            let message = format!("{} changes only while the robot stands and has no goal", row.name);
            return Err((ParamCode::Driving, message, "stop the robot, or wait until its goal has ended"));
        }
        self.nav.set_settings(&new);
        self.params.apply(now, client, new, &rows);
        Ok(())
    }

    fn check_param_lease(&self, now: Stamp, client: &Name, lease: Option<Lease>) -> Result<(), Refusal> {
        let alive = self.lease.silent_ms(now).is_some_and(|ms| ms < self.limits.lease_free_ms);
        match lease {
            Some(lease) if alive && self.lease.is_present(client, lease) => Ok(()),
            Some(_) => Err((
                ParamCode::LeaseLost,
                "the lease is not the present one".to_owned(),
                "acquire control again",
            )),
            None => {
                let holder = self.lease.holder().map(|holder| format!(", which {holder} has"));
                let message = format!("this change needs control of the robot{}", holder.unwrap_or_default());
                Err((
                    ParamCode::LeaseRequired,
                    message,
                    "acquire control first; only a lower speed needs none",
                ))
            }
        }
    }

    /// What differs from the settings file: names and values.
    #[must_use]
    pub fn params_to_save(&self) -> Vec<ParamValue> {
        let (mut now, mut saved) = (self.params.settings.clone(), self.params.saved.clone());
        let value = |row: &Changeable| {
            let (value, before) = (*(row.of)(&mut now), *(row.of)(&mut saved));
            (value != before).then(|| ParamValue { name: row.name.to_owned(), value })
        };
        CHANGEABLE.iter().filter_map(value).collect()
    }

    /// These have been written into the settings file.
    pub fn params_saved(&mut self, values: &[ParamValue]) {
        for ParamValue { name, value } in values {
            if let Some(row) = CHANGEABLE.iter().find(|row| row.name == name) {
                *(row.of)(&mut self.params.saved) = *value;
            }
        }
    }

    /// The oldest change that has not been taken to the recording yet.
    pub fn next_param_change(&mut self) -> Option<ParamChange> {
        self.params.news.pop_front()
    }
}
