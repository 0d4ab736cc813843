"""What Jupyter shows. Every text is escaped: a robot's name or reason is text, whatever it holds."""

from __future__ import annotations

import html
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from .errors import FleetError

if TYPE_CHECKING:
    from .dispatch import Tasks
    from .fleet import Robots
    from .robot import Robot
    from .stops import StopReport
    from .streams import State

Rows = Iterable[Iterable[object]]


def table(head: Iterable[str], rows: Rows, caption: str = "") -> str:
    """A table of texts."""
    top = "".join(f"<th style='text-align:left'>{_text(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(f'<td style=text-align:left>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    title = f"<caption>{_text(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>"


def robots(fleet: Robots) -> str:
    """Who is there, who should be, and how they stand."""
    rows = [
        (
            each.name,
            "yes" if each.is_alive else "NO",
            {True: "yes", False: "no", None: "?"}[each.expected],
            *(_brief(each.state) if each.state else ("", "", "", "")),
        )
        for each in fleet
    ]
    return table(("robot", "there", "in the roster", "mode", "x, y (m)", "controlled by", "stopped because"), rows)


def state_card(state: State) -> str:
    """One state."""
    data = state.data
    goal = data["goal"]
    rows: list[tuple[str, object]] = [
        ("mode", data["mode"]),
        ("pose", f"{state.x:.3f} m, {state.y:.3f} m, {state.yaw:.3f} rad ({data['pose']['source']})"),
        ("speed", _number(data["speed_mps"], "m/s")),
        ("battery", f"{_number(data['battery_v'], 'V')} ({data['battery_level']})"),
        ("controlled by", state.holder or "none"),
        ("goal", f"{goal['kind']} {goal['status']} {goal['reason'] or ''}" if goal else "none"),
        ("latched", ", ".join(state.latches) or "nothing"),
        ("faults", ", ".join(fault["fault"] for fault in data["faults"]) or "none"),
        ("stopped because", ", ".join(state.stopped_because) or "driving"),
        ("age", f"{state.age:.2f} s{'' if state.is_fresh else ': NOT THE PRESENT STATE'}"),
    ]
    return table(("", ""), rows, data["robot"])


def robot_card(robot: Robot) -> str:
    """One robot as it stands, or why that is not known."""
    try:
        return state_card(robot.state)
    except FleetError as error:
        return table(("", ""), [("no message", error.message), ("", error.hint)], robot.name)


def stop_report(report: StopReport) -> str:
    """Which robots have confirmed."""
    rows = [(name, outcome if outcome == "stopped" else outcome.upper()) for name, outcome in report.robots.items()]
    caption = "all robots stopped" if report.complete else "NOT CONFIRMED FOR ALL" if report.roster_known else "no roster"
    return table(("robot", "outcome"), rows, caption)


def tasks(found: Tasks) -> str:
    """The dispatcher's tasks."""
    rows = [
        (
            task["id"],
            task["state"],
            task["robot"] or "",
            f"{task['legs_done']}/{task['legs'] if task['legs'] is not None else '?'}",
            task["by"],
            task["reason"] or "",
        )
        for task in found
    ]
    caption = f"{len(found.suspended)} suspended: `activate` or `adopt`" if found.suspended else ""
    return table(("task", "state", "robot", "drives", "by", "reason"), rows, caption)


def _brief(state: State) -> tuple[object, ...]:
    return state.mode, f"{state.x:.2f}, {state.y:.2f}", state.holder or "", ", ".join(state.stopped_because)


def _number(value: float | None, unit: str) -> str:
    return "unknown" if value is None else f"{value:.3f} {unit}"


def _text(value: Any) -> str:
    return html.escape(str(value))
