"""Stops and emergency stops: robots count as stopped only if they say so themselves and their own states show it.

An emergency stop needs no lease. It is put again and again, with the same id, until each robot has acknowledged it
or the time is up, and asked beside that. For all robots it is put at once on the key that every robot hears, before
anybody knows who they are. It is not a safety-rated stop.
"""

from __future__ import annotations

import threading
import time
import uuid
from collections.abc import Callable, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Literal

from . import wire
from .errors import FleetError, Malformed
from .keys import ANY
from .link import COMMAND, ESTOP, Asking, Link
from .messages import Request, RobotState
from .streams import read_state

AGAIN_FIRST_S, AGAIN_MOST_S = 0.05, 0.4
ANSWER_WITHIN_S = 0.5
SHOWS_WITHIN_S = 1.5
LINGER_S = 0.03
MOST_AT_ONCE = 64

Outcome = Literal["stopped", "refused", "unknown", "unconfirmed", "absent", "ambiguous"]
"""`stopped`: it said so, and its state shows it. `unknown`: no answer: it may be driving. `unconfirmed`: it answered,
and no state shows it. `absent`: somebody answered, and no such robot is there. `ambiguous`: two answer for it."""


class StopReport:
    """What came of a stop for each robot."""

    def __init__(self, robots: dict[str, Outcome], roster_known: bool) -> None:
        self.robots = robots
        """The outcome by name."""
        self.roster_known = roster_known
        """Whether anybody knows which robots there should be."""

    @property
    def confirmed(self) -> list[str]:
        """Which robots have stopped, and have shown it."""
        return [name for name, outcome in self.robots.items() if outcome == "stopped"]

    @property
    def unconfirmed(self) -> list[str]:
        """Who may be driving."""
        return [name for name, outcome in self.robots.items() if outcome != "stopped"]

    @property
    def complete(self) -> bool:
        """Whether every robot that should be there has stopped; never true when nobody knows which, or there are none."""
        return self.roster_known and bool(self.robots) and not self.unconfirmed

    def __repr__(self) -> str:
        parts = [f"stopped: {', '.join(self.confirmed) or 'none'}"]
        if self.unconfirmed:
            bad = ", ".join(f"{name} ({self.robots[name]})" for name in self.unconfirmed)
            parts.append(f"NOT CONFIRMED: {bad}")
        if not self.roster_known:
            parts.append("no roster: which robots there should be is unknown")
        return f"<{'; '.join(parts)}>"

    def _repr_html_(self) -> str:
        from . import display

        return display.stop_report(self)


def stop(link: Link, robots: Iterable[str] | None, roster: Callable[[], list[str] | None]) -> StopReport:
    """These, or all: they drop their goals and stand, not latched."""
    link.settings.may("control robots")
    if robots is None:  # everybody at once, before anybody knows who they are; who has confirmed is asked one by one
        stop_all: Request = {"id": str(uuid.uuid4()), "lease": None, "body": {"stop": {}}}
        Asking(link).ask(link.keys.cmd(ANY), ANSWER_WITHIN_S, stop_all, COMMAND)
    return _each(link, robots, roster, lambda robot: _stop_one(link, robot))


def estop(
    link: Link, robots: Iterable[str] | None, roster: Callable[[], list[str] | None], within: float
) -> StopReport:
    """These, or all: they stand, latched, until a `reset`."""
    link.settings.may("call an emergency stop")
    call = _Estop(link, within)
    if robots is not None:
        return _each(link, robots, roster, call.one)
    with call.putting(link.keys.estop("all")):
        heard: set[str] = set()
        ended = threading.Event()
        asking = threading.Thread(target=call.everybody, args=(heard, ended), daemon=True)
        asking.start()
        report = _each(link, None, roster, call.one)
        # Who has answered a question to all, and is none of those asked by name or did not answer that.
        late = [name for name in sorted(heard) if report.robots.get(name, "unknown") == "unknown"]
        if late:
            report.robots.update(_each(link, late, roster, call.one).robots)
        ended.set()
    return report


def _each(
    link: Link,
    robots: Iterable[str] | None,
    roster: Callable[[], list[str] | None],
    one: Callable[[str], Outcome],
) -> StopReport:
    """Each robot in a thread, 64 at once, as soon as it is heard of."""
    asked: dict[str, Future[Outcome]] = {}
    with ThreadPoolExecutor(MOST_AT_ONCE, "stop") as pool:

        def call(names: Iterable[str]) -> None:
            for name in names:
                if name not in asked:
                    asked[name] = pool.submit(one, name)

        if robots is not None:
            call(robots)
            known = True
        else:
            rostered = threading.Thread(target=lambda: found.append(roster()), daemon=True)
            found: list[list[str] | None] = []
            rostered.start()
            call(present(link))
            call(link.settings.roster)
            rostered.join()
            known = bool(found) and found[0] is not None
            call(found[0] or [] if found else [])
        outcomes: dict[str, Outcome] = {}
        for name in sorted(asked):
            try:
                outcomes[name] = asked[name].result()
            except FleetError:
                outcomes[name] = "unknown"
    return StopReport(outcomes, known)


def present(link: Link) -> list[str]:
    """The robots that are there now."""
    robots = (link.keys.robot_of(key, "alive") for key in link.present(link.keys.of(ANY, "alive")))
    return sorted({robot for robot in robots if robot})


def _stop_one(link: Link, robot: str) -> Outcome:
    replies = link.replies(robot, {"stop": {}}, linger=max(LINGER_S, link.round_trip.bound / 4))
    if len(replies) > 1:
        return "ambiguous"
    if "ok" not in replies[0]["result"]:
        return "refused"
    return _confirm(link, robot, _has_stopped)


def _has_stopped(state: RobotState) -> bool:
    goal = state["goal"]
    over = goal is None or goal["status"] not in ("accepted", "running", "blocked")
    return over and state["mode"] not in ("teleop", "goto", "wander")


def _is_latched(state: RobotState) -> bool:
    return any(latch["latch"] == "estop" for latch in state["latches"])


class _Putting:
    """Puts an emergency stop again and again, in a thread of its own: a full queue holds up no question."""

    def __init__(self, call: _Estop, key: str) -> None:
        self._call, self._key = call, key
        self._ended = threading.Event()

    def __enter__(self) -> None:
        threading.Thread(target=self._put, daemon=True).start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def _put(self) -> None:
        pause = AGAIN_FIRST_S
        while not self._ended.is_set():
            try:
                self._call.link.put(self._key, {"id": self._call.id}, ESTOP)
            except FleetError:
                if self._call.link.is_closed:
                    return
            self._ended.wait(pause)
            pause = min(pause * 1.25, AGAIN_MOST_S)


class _Estop:
    """One emergency stop: the same id in each repetition."""

    def __init__(self, link: Link, within: float) -> None:
        self.link = link
        self.id = str(uuid.uuid4())
        self.within = within

    @property
    def _answer_within(self) -> float:
        return self.link.round_trip.patience(min(ANSWER_WITHIN_S, self.within))

    def putting(self, key: str) -> _Putting:
        """Repeats it as long as the block lasts."""
        return _Putting(self, key)

    def one(self, robot: str) -> Outcome:
        """One robot, until it has acknowledged or the time is up, and then until its state shows it."""
        key = self.link.keys.estop(robot)
        with self.putting(key):
            voices = self._acknowledged(key, robot)
        if voices == 0:
            return "unknown"
        return "ambiguous" if voices > 1 else _confirm(self.link, robot, _is_latched)

    def _acknowledged(self, key: str, robot: str) -> int:
        """How many say in the robot's name that it is latched, once one does; a question is asked again before
        those before are answered."""
        began = time.monotonic()
        give_up = began + self.link.round_trip.patience(self.within)
        asking, pause, due = Asking(self.link), AGAIN_FIRST_S, 0.0
        while (now := time.monotonic()) < give_up:
            if now >= due:
                if asking.open < 16:
                    asking.ask(key, give_up - now, {"id": self.id}, ESTOP)
                due, pause = now + pause, min(pause * 1.25, AGAIN_MOST_S)
            news = asking.next(min(due, give_up) - now)
            if news is not None and self._latched(news.key, news.payload) == robot:
                # Another program that answers too does so at once.
                self.link.round_trip.measured(news.at - began)
                return 1 + self._others(key, robot)
        return 0

    def _others(self, key: str, robot: str) -> int:
        asking = Asking(self.link)
        asking.ask(key, self._answer_within, {"id": self.id}, ESTOP)
        answers = asking.all(self._answer_within)
        return max(0, sum(self._latched(answer.key, answer.payload) == robot for answer in answers) - 1)

    def _latched(self, key: str, payload: bytes) -> str | None:
        """Who is said to be latched."""
        try:
            answer = wire.read("Estopped", payload)
        except Malformed:
            return None
        robot = answer["robot"]
        ours = self.link.keys.robot_of(key, f"estop/{self.link.keys.client}") == robot
        return str(robot) if ours and answer["latched"] else None

    def everybody(self, heard: set[str], ended: threading.Event) -> None:
        """Asks all robots at once, again and again."""
        key = self.link.keys.estop(ANY)
        while not ended.is_set() and not self.link.is_closed:
            asking = Asking(self.link)
            asking.ask(key, self._answer_within, {"id": self.id}, ESTOP)
            for answer in asking.all(self._answer_within + 0.5):
                robot = self._latched(answer.key, answer.payload)
                if robot:
                    heard.add(robot)
            ended.wait(AGAIN_FIRST_S)


def _confirm(link: Link, robot: str, shows: Callable[[RobotState], bool]) -> Outcome:
    """Whether a robot that was answered for is there, and a state that it made after the answer shows it."""
    key = link.keys.of(robot, "alive")
    if key not in link.present(key):
        return "absent"
    give_up = time.monotonic() + link.round_trip.patience(SHOWS_WITHIN_S)
    first: tuple[int, int] | None = None
    pause = 0.06
    while time.monotonic() < give_up:
        answers = link.get(link.keys.of(robot, "state?format=json"), give_up - time.monotonic())
        states = [state for answer in answers if (state := read_state(link, answer.key, answer.payload))]
        if len(states) > 1:
            return "ambiguous"
        for state in states:
            first = first or (state["epoch"], state["seq"])
            if state["epoch"] != first[0]:
                return "ambiguous"
            if state["seq"] > first[1] and shows(state):
                return "stopped"
        time.sleep(pause)
        pause = min(pause * 1.5, 0.5)
    return "unconfirmed"
