"""What is read from the wire, without one."""

from __future__ import annotations

import json
import subprocess
import sys
import unittest
from pathlib import Path
from typing import Any

from xtb_fleet import State, StopReport, Task, display, wire
from xtb_fleet.dispatch import Tasks
from xtb_fleet.errors import Malformed
from xtb_fleet.keys import Keys

HERE = Path(__file__).parent


def state(**more: Any) -> dict[str, Any]:
    """A state as a robot publishes it."""
    value: dict[str, Any] = json.loads((HERE / "state.json").read_text("utf-8"))
    return value | more


def read(value: Any) -> Any:
    return wire.read("RobotState", json.dumps(value).encode())


class Wire(unittest.TestCase):
    def test_a_state_is_read_as_it_is(self) -> None:
        self.assertEqual(read(state()), state())

    def test_numbers_that_are_not_finite_are_refused(self) -> None:
        for number in ("NaN", "Infinity", "-Infinity", "1e999", "9" * 400):
            text = json.dumps(state()).replace('"x_m": ', f'"x_m": {number}, "was": ', 1)
            with self.assertRaises(Malformed, msg=number):
                wire.read("RobotState", text.encode())

    def test_what_is_no_message_is_refused(self) -> None:
        lacking = state()
        del lacking["tick_ms"]
        values: list[Any] = [lacking, state(pose=None), state(robot=3), state(latches=[1]), state(seq=True), state(goal=[]), []]
        for value in values:
            with self.assertRaises(Malformed, msg=str(value)[:80]):
                read(value)
        for text in (b"", b"{", b"\xff", b"[" * 60_000, b'{"a":' * 5_000 + b"1" + b"}" * 5_000):
            with self.assertRaises(Malformed, msg=str(text[:10])):
                wire.read("RobotState", text)
        with self.assertRaises(Malformed):
            wire.read("RobotState", b" " * (wire.MOST_BYTES + 1))

    def test_a_newer_robot_may_say_more(self) -> None:
        newer = state(mode="hover", stopped_because=["tired"], battery_cells=[3.7, 3.6])
        newer["pose"]["z_m"] = 0.1
        self.assertEqual(read(newer), newer)
        event = {"robot": "xtb-1", "epoch": 1, "seq": 1, "tick_ms": 1, "kind": {"sneezed": {"times": 2}}}
        self.assertEqual(wire.read("Event", json.dumps(event).encode()), event)
        with self.assertRaises(Malformed):
            read(state(battery_cells=[float("inf")]))

    def test_texts_do_nothing_to_a_terminal(self) -> None:
        bad = "\x1b[2J\u202e\u200bevil\n"
        newer = state(mode=bad, **{bad: bad})
        newer["goal"] = {**GOAL, "reason": bad}
        read_back = read(newer)
        self.assertTrue(json.dumps(read_back, ensure_ascii=False).isprintable())
        self.assertIn("\\x1b[2J\\u202e\\u200bevil\\n", read_back["goal"]["reason"])

    def test_jupyter_shows_texts_as_texts(self) -> None:
        bad = "<script>alert(1)</script>&\"'"
        newer = state(mode=bad, goal={**GOAL, "reason": bad, "kind": bad}, stopped_because=[bad])
        newer["lease"] = {"holder": bad, "age_ms": 0}
        shown = [
            display.state_card(State(read(newer), 0.0)),
            display.stop_report(StopReport({bad: "unknown"}, True)),
            display.tasks(Tasks([], [])),
        ]
        for text in shown:
            self.assertNotIn("<script", text)
        self.assertIn("&lt;script&gt;", shown[0])
        self.assertIn("NOT CONFIRMED", shown[1])

    def test_only_keys_of_this_fleet_s_robots_count(self) -> None:
        keys = Keys("lab", "me")
        self.assertEqual(keys.robot_of("xtb/lab/xtb-1/state/json", "state/json"), "xtb-1")
        for key in ("xtb/lab/all/state/json", "xtb/hall/xtb-1/state/json", "xtb/lab/a/b/state/json", "xtb/lab/*/state/json"):
            self.assertIsNone(keys.robot_of(key, "state/json"), key)

    def test_a_task_has_only_options_that_there_are(self) -> None:
        self.assertEqual(Task.goto(1, 2, priority=9)["priority"], 9)
        with self.assertRaises(TypeError):
            Task.goto(1, 2, prioritty=9)

    def test_the_types_are_made_from_the_schemas(self) -> None:
        generator = HERE.parent / "generate_types.py"
        done = subprocess.run([sys.executable, str(generator), "--check"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)


GOAL = {
    "id": "00112233-4455-6677-8899-aabbccddeeff",
    "kind": "goto",
    "x_m": 1.0,
    "y_m": 2.0,
    "yaw_rad": None,
    "via": "direct",
    "status": "running",
    "distance_m": 0.5,
    "age_ms": 3,
    "reason": None,
    "by": "cli-1",
    "on_link_loss": "halt",
}

if __name__ == "__main__":
    unittest.main()
