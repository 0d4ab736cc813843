//! Which key means what. `?` shows the same.

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};

/// What a key asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Press {
    /// Every robot stands, latched.
    EstopAll,
    /// The selected one stands, latched.
    Estop,
    /// Every robot drops its goal and stands.
    StopAll,
    /// The selected one does.
    Stop,
    /// The selected robot's latches are to end.
    Reset,
    /// All latches of all robots that are shown are to end.
    ResetAll,
    /// The dispatcher is to assign tasks again.
    Activate,
    /// Drive the selected robot, or let it go.
    Teleop,
    /// The selected robot's goal or task is to end.
    Cancel,
    /// Send the selected robot to the cursor; pause in a recording.
    Go,
    /// The selected robot stands at the cursor.
    SetPose,
    /// Why it stands.
    Why,
    /// Events, tasks or alerts.
    Pane,
    /// Events one by one, or a line for each drive.
    Details,
    /// The open alerts are seen.
    Acknowledge,
    /// Write what the table is filtered by.
    Filter,
    /// The keys.
    Help,
    /// Select so many robots further on.
    Step(isize),
    /// Select the robot with this number.
    Number(usize),
    /// So many cells to the right and up; true = many.
    Cursor(i8, i8, bool),
    /// The cursor to the selected robot.
    Home,
    /// The map's part, by so many halves of it.
    Pan(i8, i8),
    /// Yaw on arrival, counter-clockwise.
    Turn(i8),
    /// Yaw on arrival does not matter.
    AnyYaw,
    /// In or out.
    Zoom(bool),
    /// Everything.
    Whole,
    /// The selected robot stays in the middle.
    Follow,
    /// A recording runs or rests.
    Pause,
    /// Yes.
    Yes,
    /// Close what is open, else leave.
    Back,
    /// Leave.
    Leave,
}

/// What a key asks for; `None` = nothing, or it was let go.
pub(super) fn press(key: &KeyEvent) -> Option<Press> {
    if key.kind == KeyEventKind::Release {
        return None;
    }
    let shift = key.modifiers.contains(KeyModifiers::SHIFT);
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return (key.code == KeyCode::Char('c')).then_some(Press::Leave);
    }
    let found = match key.code {
        KeyCode::Esc => Press::Back,
        KeyCode::Enter => Press::Go,
        KeyCode::Tab if shift => Press::Step(-1),
        KeyCode::Tab => Press::Step(1),
        KeyCode::BackTab => Press::Step(-1),
        KeyCode::F(1) => Press::Help,
        KeyCode::Up => Press::Cursor(0, 1, shift),
        KeyCode::Down => Press::Cursor(0, -1, shift),
        KeyCode::Left => Press::Cursor(-1, 0, shift),
        KeyCode::Right => Press::Cursor(1, 0, shift),
        // Some terminals tell of the key and of shift, not of the letter that they make.
        KeyCode::Char(c) if shift => letter(c.to_ascii_uppercase())?,
        KeyCode::Char(c) => letter(c)?,
        _ => return None,
    };
    // A key that is held asks once, unless it moves something on the screen.
    let repeats = matches!(found, Press::Cursor(..) | Press::Pan(..) | Press::Turn(_) | Press::Zoom(_));
    (key.kind == KeyEventKind::Press || repeats).then_some(found)
}

fn letter(c: char) -> Option<Press> {
    Some(match c {
        'E' => Press::EstopAll,
        'e' => Press::Estop,
        'S' => Press::StopAll,
        's' => Press::Stop,
        'x' => Press::Reset,
        'X' => Press::ResetAll,
        'A' => Press::Activate,
        't' => Press::Teleop,
        'c' => Press::Cancel,
        'p' => Press::SetPose,
        'w' => Press::Why,
        'v' => Press::Pane,
        'd' => Press::Details,
        'o' => Press::Acknowledge,
        '/' => Press::Filter,
        '?' | 'h' => Press::Help,
        'j' => Press::Step(1),
        'k' => Press::Step(-1),
        '0'..='9' => Press::Number(c as usize - '0' as usize),
        'g' => Press::Home,
        'H' => Press::Pan(-1, 0),
        'L' => Press::Pan(1, 0),
        'K' => Press::Pan(0, 1),
        'J' => Press::Pan(0, -1),
        'r' => Press::Turn(1),
        'R' => Press::Turn(-1),
        'u' => Press::AnyYaw,
        '+' | '=' => Press::Zoom(true),
        '-' => Press::Zoom(false),
        'a' => Press::Whole,
        'f' => Press::Follow,
        ' ' => Press::Pause,
        'y' => Press::Yes,
        'q' => Press::Leave,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(code: KeyCode, modifiers: KeyModifiers, kind: KeyEventKind) -> Option<Press> {
        press(&KeyEvent::new_with_kind(code, modifiers, kind))
    }

    #[test]
    fn a_shifted_letter_is_the_capital_one_whatever_the_terminal_says() {
        let shift = KeyModifiers::SHIFT;
        for (code, modifiers) in [
            (KeyCode::Char('E'), KeyModifiers::NONE),
            (KeyCode::Char('E'), shift),
            (KeyCode::Char('e'), shift),
        ] {
            assert_eq!(key(code, modifiers, KeyEventKind::Press), Some(Press::EstopAll));
        }
        assert_eq!(
            key(KeyCode::Char('e'), KeyModifiers::NONE, KeyEventKind::Press),
            Some(Press::Estop),
            "and a plain one is not"
        );
    }

    #[test]
    fn held_keys_move_the_cursor_and_nothing_else() {
        let none = KeyModifiers::NONE;
        assert_eq!(key(KeyCode::Enter, none, KeyEventKind::Repeat), None);
        assert_eq!(key(KeyCode::Up, none, KeyEventKind::Repeat), Some(Press::Cursor(0, 1, false)));
        assert_eq!(key(KeyCode::Up, none, KeyEventKind::Release), None);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL, KeyEventKind::Press), Some(Press::Leave));
        assert_eq!(key(KeyCode::Char('e'), KeyModifiers::CONTROL, KeyEventKind::Press), None);
    }
}
