//! Who is at a dock, on the way to one, or needs one, as `list` says it.

use xtb_protocol::messages::{HomeStatus, RobotHome};

/// Who is at a dock or needs one, in a line below the table; `None` = nobody.
pub(super) fn line(homes: &[RobotHome]) -> Option<String> {
    let words = |home: &RobotHome| {
        let what = match home.status {
            HomeStatus::OnTheWay => "on the way to",
            HomeStatus::Charging => "charging at",
            HomeStatus::Charged => "charged at",
            HomeStatus::NotCharging => "NOT CHARGING at",
            HomeStatus::WaitsForDock => "waits for a dock",
            HomeStatus::NeedsHelp => "NEEDS HELP to get to a dock",
            HomeStatus::Parked | HomeStatus::AfterTask => return None,
        };
        let place = home.place.as_ref().map(|place| format!(" {place}")).unwrap_or_default();
        Some(format!("{} {what}{place}", home.robot))
    };
    let all: Vec<String> = homes.iter().filter_map(words).collect();
    (!all.is_empty()).then(|| format!("docks: {}", all.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use xtb_client::fake;

    #[test]
    fn who_is_at_a_dock_or_needs_one_is_said_below_the_table() {
        let home = |robot: &str, status, place: Option<&str>| RobotHome {
            robot: fake::name(robot),
            status,
            place: place.map(fake::name),
            task: None,
            battery_v: None,
            why: String::new(),
        };
        let homes = [
            home("xtb-1", HomeStatus::Charging, Some("dock-1")),
            home("xtb-2", HomeStatus::Parked, Some("parking-1")),
            home("xtb-3", HomeStatus::WaitsForDock, None),
        ];
        let said = line(&homes);
        assert_eq!(said.as_deref(), Some("docks: xtb-1 charging at dock-1, xtb-3 waits for a dock"));
        assert_eq!(line(&homes[1..2]), None);
    }
}
