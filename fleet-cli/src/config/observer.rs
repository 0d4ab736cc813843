//! `[alerts]` and `[history]` of the fleet config: when the dispatcher calls for a person, how, and what it keeps.

use serde::{Deserialize, Serialize};
use std::path::PathBuf;
use std::time::Duration;
use xtb_client::{Error, ErrorKind, Result};
use xtb_dispatch::alerts::Rules;
use xtb_protocol::messages::BatteryLevel;
use xtb_services::alert_outlets::{CommandOutlet, OutletSettings, Url, WebhookOutlet};
use xtb_services::dispatch::ObserverSettings;
use xtb_services::history::Retention;

pub(super) const ALERTS: [&str; 12] = [
    "latched",
    "gone_s",
    "task_failed",
    "battery",
    "blocked_s",
    "suspended",
    "map_mismatch_s",
    "command",
    "command_timeout_s",
    "webhook",
    "webhook_ca",
    "webhook_timeout_s",
];
pub(super) const HISTORY: [&str; 2] = ["keep_days", "max_mib"];

/// Longest time of a rule: a day.
const MAX_RULE_S: f64 = 86_400.0;
/// Longest that an outlet may take, in s.
const MAX_OUTLET_S: f64 = 600.0;

/// From which level on a battery is an alert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BatteryRule {
    /// Never.
    Off,
    /// Think of charging.
    Warn,
    /// Nothing new begins.
    Finish,
    /// The robot stands.
    Critical,
}

/// When there is an alert, and who is told beside the screens. Times in s; 0 = the rule is off.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AlertsConfig {
    /// A stop is latched.
    pub latched: bool,
    /// A robot is not heard for this long.
    pub gone_s: f64,
    /// A task failed for good.
    pub task_failed: bool,
    /// A battery is at this level or lower.
    pub battery: BatteryRule,
    /// A robot with a goal makes no progress for this long.
    pub blocked_s: f64,
    /// The dispatcher assigns nothing, or not all.
    pub suspended: bool,
    /// A robot has another map than the fleet for this long.
    pub map_mismatch_s: f64,
    /// A program and its arguments; each change of an alert comes as JSON on its standard input. Empty = none.
    pub command: Vec<String>,
    /// It is ended after this long.
    pub command_timeout_s: f64,
    /// Where to post each change.
    pub webhook: Option<String>,
    /// Certificate authorities of an https server, a PEM file.
    pub webhook_ca: Option<PathBuf>,
    /// It has this long to answer.
    pub webhook_timeout_s: f64,
}

impl Default for AlertsConfig {
    fn default() -> Self {
        let seconds = |ms: Option<u64>| ms.map_or(0.0, |ms| ms as f64 / 1000.0);
        let rules = Rules::default();
        Self {
            latched: rules.latched,
            gone_s: seconds(rules.gone_ms),
            task_failed: rules.task_failed,
            battery: BatteryRule::Warn,
            blocked_s: seconds(rules.blocked_ms),
            suspended: rules.suspended,
            map_mismatch_s: seconds(rules.map_mismatch_ms),
            command: Vec::new(),
            command_timeout_s: 10.0,
            webhook: None,
            webhook_ca: None,
            webhook_timeout_s: 5.0,
        }
    }
}

/// How much history is kept; the oldest goes first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HistoryConfig {
    /// Days.
    pub keep_days: u32,
    /// Size of the file, in MiB.
    pub max_mib: u32,
}

impl Default for HistoryConfig {
    fn default() -> Self {
        let Retention { keep_days, max_mib } = Retention::default();
        Self { keep_days, max_mib }
    }
}

fn within(key: &str, value: f64, min: f64, max: f64) -> Result<()> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(Error::new(ErrorKind::Config, format!("{key} = {value:?} is not allowed: {min:?}..={max:?}")))
}

impl AlertsConfig {
    pub(super) fn check(&self) -> Result<()> {
        within("alerts.gone_s", self.gone_s, 0.0, MAX_RULE_S)?;
        within("alerts.blocked_s", self.blocked_s, 0.0, MAX_RULE_S)?;
        within("alerts.map_mismatch_s", self.map_mismatch_s, 0.0, MAX_RULE_S)?;
        within("alerts.command_timeout_s", self.command_timeout_s, 0.1, MAX_OUTLET_S)?;
        within("alerts.webhook_timeout_s", self.webhook_timeout_s, 0.1, MAX_OUTLET_S)?;
        if self.webhook.is_none() && self.webhook_ca.is_some() {
            return Err(Error::new(ErrorKind::Config, "alerts.webhook_ca is set, alerts.webhook is not"));
        }
        Ok(())
    }

    fn rules(&self) -> Rules {
        let on = |seconds: f64| (seconds > 0.0).then_some((seconds * 1000.0) as u64);
        Rules {
            latched: self.latched,
            gone_ms: on(self.gone_s),
            task_failed: self.task_failed,
            battery: match self.battery {
                BatteryRule::Off => None,
                BatteryRule::Warn => Some(BatteryLevel::Warn),
                BatteryRule::Finish => Some(BatteryLevel::Finish),
                BatteryRule::Critical => Some(BatteryLevel::Critical),
            },
            blocked_ms: on(self.blocked_s),
            suspended: self.suspended,
            map_mismatch_ms: on(self.map_mismatch_s),
        }
    }
}

impl HistoryConfig {
    pub(super) fn check(&self) -> Result<()> {
        within("history.keep_days", f64::from(self.keep_days), 1.0, 3650.0)?;
        within("history.max_mib", f64::from(self.max_mib), 1.0, 65_536.0)
    }
}

/// What a dispatcher tells people, as these say.
///
/// # Errors
/// [`ErrorKind::Config`]: no web hook, or its certificates cannot be read.
pub fn observer(alerts: &AlertsConfig, history: HistoryConfig) -> Result<ObserverSettings> {
    let command = alerts.command.split_first().map(|(program, arguments)| CommandOutlet {
        program: program.clone(),
        arguments: arguments.to_vec(),
        timeout: Duration::from_secs_f64(alerts.command_timeout_s),
    });
    let webhook = alerts.webhook.as_deref().map(|url| {
        let url = Url::new(url, alerts.webhook_ca.as_deref())?;
        Ok::<_, Error>(WebhookOutlet { url, timeout: Duration::from_secs_f64(alerts.webhook_timeout_s) })
    });
    Ok(ObserverSettings {
        rules: alerts.rules(),
        outlets: OutletSettings { command, webhook: webhook.transpose()? },
        history: Retention { keep_days: history.keep_days, max_mib: history.max_mib },
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::FleetConfig;

    fn parse(text: &str) -> Result<ObserverSettings> {
        let config = FleetConfig::parse(text)?;
        observer(&config.alerts, config.history)
    }

    #[test]
    fn without_a_word_the_rules_are_on_and_nobody_is_called() {
        let settings = parse("").unwrap();
        assert_eq!((settings.rules, settings.history), (Rules::default(), Retention::default()));
        assert!(settings.outlets.command.is_none() && settings.outlets.webhook.is_none());
    }

    #[test]
    fn thresholds_switches_and_outlets_are_read() {
        let settings = parse(
            r#"
            [alerts]
            latched = false
            gone_s = 2.5
            battery = "off"
            blocked_s = 0
            command = ["/usr/local/bin/call", "--lab"]
            webhook = "http://127.0.0.1:9000/hook"
            [history]
            keep_days = 7
            "#,
        )
        .unwrap();
        let rules = settings.rules;
        assert_eq!(
            (rules.latched, rules.gone_ms, rules.battery, rules.blocked_ms),
            (false, Some(2500), None, None)
        );
        assert!(rules.suspended, "what is not named stays on");
        let command = settings.outlets.command.unwrap();
        assert_eq!(
            (command.program.as_str(), command.arguments.as_slice()),
            ("/usr/local/bin/call", &["--lab".to_owned()][..])
        );
        assert!(settings.outlets.webhook.is_some());
        assert_eq!(settings.history, Retention { keep_days: 7, ..Retention::default() });
    }

    #[test]
    fn what_cannot_be_is_refused_by_name() {
        for (text, word) in [
            ("[alerts]\ngone_s = -1", "alerts.gone_s"),
            ("[alerts]\nblocked_s = nan", "alerts.blocked_s"),
            ("[alerts]\ncommand_timeout_s = 0", "alerts.command_timeout_s"),
            ("[alerts]\nbattery = 'low'", "low"),
            ("[alerts]\nwebhook = 'gopher://x'", "no web hook"),
            ("[alerts]\nwebhook_ca = 'ca.pem'", "alerts.webhook_ca"),
            ("[alerts]\ncommand = 'beep'", "command"),
            ("[history]\nkeep_days = 0", "history.keep_days"),
        ] {
            let failure = parse(text).unwrap_err();
            assert_eq!(failure.kind, ErrorKind::Config, "{text}");
            assert!(failure.message.contains(word), "{failure:?}");
        }
    }
}
