//! What this client may do: known from its identity, so that nothing is sent that the router would drop in silence.

use crate::error::{Error, ErrorKind, Result};
use xtb_identity::{Action, Role};
use xtb_protocol::Name;

/// Whether a role may do this.
///
/// # Errors
/// [`ErrorKind::NotAllowed`], with who can.
pub fn check(name: &Name, role: Role, action: Action) -> Result<()> {
    match role.may(action) {
        true => Ok(()),
        false => Err(refusal(name, role, hint(role, action))),
    }
}

/// The refusal alone.
pub(crate) fn refusal(name: &Name, role: Role, hint: String) -> Error {
    let message = format!("{name} is {}: {}", role.noun(), role.allows());
    Error::new(ErrorKind::NotAllowed, message).hint(hint)
}

/// Who can, and how to become one.
fn hint(role: Role, action: Action) -> String {
    if role == Role::Robot {
        return "this is a robot's identity, for robot-agent: give a person's or a service's with --identity DIR \
                or XTB_IDENTITY"
            .to_owned();
    }
    // A person, if one can: the least of them. A dispatcher also leads and serves a map, but not that alone.
    let alone = [Role::Traffic, Role::Map];
    let order = Role::PEOPLE.iter().rev().chain(&alone).chain(&Role::SERVICES).chain(&Role::ALL);
    let can = order.copied().find(|role| role.may(action));
    let who = can.map_or("another role", Role::noun);
    let how = match can {
        Some(role) if role.is_person() => format!(": `fleet-cli pki add-person NAME --role {role}` adds one"),
        Some(role) if Role::SERVICES.contains(&role) => {
            format!(": `fleet-cli pki add-service {role}` adds one")
        }
        _ => String::new(),
    };
    format!("{who} can {}{how}", action.text())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fake::name;

    fn refused(role: Role, action: Action) -> (String, String) {
        let error = check(&name("alice"), role, action).unwrap_err();
        assert_eq!((error.kind, error.kind.code().as_str()), (ErrorKind::NotAllowed, "not_allowed"));
        (error.message, error.hint)
    }

    #[test]
    fn a_refusal_says_what_the_role_allows_and_who_can() {
        let (message, hint) = refused(Role::Viewer, Action::Drive);
        assert_eq!(message, "alice is a viewer: may look and call an emergency stop");
        assert_eq!(
            hint,
            "an operator can control robots: `fleet-cli pki add-person NAME --role operator` adds one"
        );
        let (message, hint) = refused(Role::Operator, Action::ServeMap);
        assert!(message.starts_with("alice is an operator: may look, drive"), "{message}");
        assert_eq!(hint, "a map server can serve a map: `fleet-cli pki add-service map` adds one");
        let (_, hint) = refused(Role::Tracker, Action::Look);
        assert!(hint.starts_with("a viewer can look at the fleet"), "{hint}");
        assert!(refused(Role::Robot, Action::Look).1.contains("for robot-agent"));
    }

    #[test]
    fn each_action_is_refused_in_words_to_each_role_that_may_not() {
        for role in Role::ALL {
            for action in ACTIONS {
                assert_eq!(
                    check(&name("alice"), role, action).is_ok(),
                    role.may(action),
                    "{role} {action:?}"
                );
            }
        }
    }

    const ACTIONS: [Action; 13] = [
        Action::Look,
        Action::EmergencyStop,
        Action::Drive,
        Action::FetchRecordings,
        Action::ChangeTasks,
        Action::ChangeMap,
        Action::ServeDispatcher,
        Action::ServeTraffic,
        Action::ServeMap,
        Action::ServeDashboard,
        Action::PublishFixes,
        Action::RunRobot,
        Action::Simulate,
    ];
}
