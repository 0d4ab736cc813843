"""A fleet: who is there, one robot by its name, all of them at once."""

from __future__ import annotations

import os
import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING

from . import stops, wire
from .dispatch import Dispatch
from .errors import Invalid, Malformed
from .keys import ANY
from .link import Link
from .messages import Event
from .robot import Robot
from .settings import DEFAULT_TIMEOUT_S, Settings, check_robot, resolve
from .stops import StopReport
from .streams import MOST_ROBOTS, QUEUE, Events, State, States, Stream, read_state

if TYPE_CHECKING:
    from .aio import AsyncFleet, Connecting


@dataclass(frozen=True)
class RobotInfo:
    """A robot that is there, or should be."""

    name: str
    is_alive: bool
    """Whether it is there now: then it accepts commands."""
    expected: bool | None
    """Whether the roster names it; None = there is no roster."""
    state: State | None
    """How it stands; None = it does not answer."""


class Robots(list[RobotInfo]):
    """All robots, in the order of their names."""

    def _repr_html_(self) -> str:
        from . import display

        return display.robots(self)


class Fleet:
    """A session with a fleet. Use it as a context manager, or call :meth:`close`.

    >>> with Fleet.connect() as fleet:
    ...     with fleet["xtb-1"].lease():
    ...         fleet["xtb-1"].goto(1.0, 2.0).wait()
    """

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        """Routers, fleet, own name, identity, timeout and roster."""
        self._link = Link(settings)
        self._lock = threading.Lock()
        self._robots: dict[str, Robot] = {}
        self._states: States | None = None
        self._events: Events | None = None
        self.dispatch = Dispatch(self._link)
        """Tasks for whichever robot is free."""

    @classmethod
    def connect(
        cls,
        endpoint: str | list[str] | None = None,
        fleet: str | None = None,
        name: str | None = None,
        identity: str | os.PathLike[str] | None = None,
        *,
        timeout_s: float = DEFAULT_TIMEOUT_S,
    ) -> Fleet:
        """Opens a session.

        What is not given comes, as for `fleet-cli`, from XTB_CONNECT, XTB_FLEET and XTB_IDENTITY, from the identity in
        `~/.config/xtb/identity`, from `~/.config/xtb/fleet.toml` (XTB_CONFIG), and else is `tcp/127.0.0.1:7447`,
        fleet `lab` and no identity. `name` is what robots show as the holder of their lease; `identity` is a folder,
        or `"none"`; `timeout_s` is how long a router or an answer is waited for.

        Raises `NotThere` (no router), or `Invalid`.
        """
        return cls(resolve(endpoint, fleet, name, identity, timeout_s))

    @classmethod
    def connect_async(
        cls,
        endpoint: str | list[str] | None = None,
        fleet: str | None = None,
        name: str | None = None,
        identity: str | os.PathLike[str] | None = None,
        *,
        timeout_s: float = DEFAULT_TIMEOUT_S,
    ) -> Connecting:
        """The same for asyncio: `async with Fleet.connect_async() as fleet`, or `fleet = await …`."""
        from .aio import Connecting

        return Connecting(lambda: cls.connect(endpoint, fleet, name, identity, timeout_s=timeout_s))

    def __enter__(self) -> Fleet:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Gives back the leases, and ends the session."""
        with self._lock:
            robots, feeds = list(self._robots.values()), [self._states, self._events]
        for robot in robots:
            robot._let_run_out()
        try:
            for robot in robots:
                robot._close()
            for feed in feeds:
                if feed is not None:
                    feed.close()
        finally:
            self._link.close()

    def __repr__(self) -> str:
        at = ", ".join(self.settings.endpoints)
        return f"<fleet {self.settings.fleet} at {at} as {self.settings.client}>"

    def _repr_html_(self) -> str:
        return self.robots()._repr_html_()

    def __getitem__(self, name: str) -> Robot:
        """One robot, whether it is there or not."""
        check_robot(name)
        with self._lock:
            if name not in self._robots:
                self._robots[name] = Robot(self._link, name)
            return self._robots[name]

    @property
    def aio(self) -> AsyncFleet:
        """The same session for asyncio."""
        from .aio import AsyncFleet

        return AsyncFleet(self)

    # Looking.

    def robots(self) -> Robots:
        """Who is there, and who should be by the roster (of the configuration, or the simulator's)."""
        roster, alive = self.roster(), set(stops.present(self._link))
        states: dict[str, State] = {}
        for answer in self._link.get(self._link.keys.of(ANY, "state?format=json")):
            data = read_state(self._link, answer.key, answer.payload)
            if data is not None:
                states[data["robot"]] = State(data, answer.at)
        for name in alive - states.keys():
            state = Robot(self._link, name)._ask_state()  # a question to all reaches those whom the routers know
            if state is not None:
                states[name] = state
        names = sorted(alive | set(roster or ()), key=_by_number)
        expected = set(roster) if roster is not None else None
        return Robots(
            RobotInfo(name, name in alive, None if expected is None else name in expected, states.get(name))
            for name in names
        )

    def roster(self) -> list[str] | None:
        """Which robots there should be; None = nobody knows."""
        if self.settings.roster:
            return list(self.settings.roster)
        names: set[str] | None = None
        for answer in self._link.get(self._link.keys.roster()):
            try:
                roster = wire.read("Roster", answer.payload, wire.MOST_BYTES_OF_TASKS)
                robots = {check_robot(entry["name"]) for entry in roster["robots"]}
            except (Malformed, Invalid):
                continue
            if answer.key == self._link.keys.roster():
                names = (names or set()) | robots
        return sorted(names, key=_by_number) if names is not None and len(names) <= MOST_ROBOTS else None

    def states(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[State]:
        """The states of all robots as they come, some 20 a second each; see :class:`Stream`."""
        with self._lock:
            if self._states is None:
                self._states = States(self._link, ANY)
            return self._states.stream(queue, timeout)

    def events(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[Event]:
        """What happens to all robots, as it comes."""
        with self._lock:
            if self._events is None:
                self._events = Events(self._link, ANY)
            return self._events.stream(queue, timeout)

    # Acting.

    def estop_all(self, within: float | None = None) -> StopReport:
        """Every robot stands, latched, until a `reset`; the report says who has confirmed. Needs no lease.

        Not a safety-rated stop. The dispatcher assigns nothing until `fleet.dispatch.activate()`.
        """
        return stops.estop(self._link, None, self.roster, within or self.settings.timeout_s)

    def stop_all(self) -> StopReport:
        """Every robot drops its goal and stands, not latched; the report says who has confirmed."""
        return stops.stop(self._link, None, self.roster)


def _by_number(name: str) -> tuple[str, int, str]:
    """xtb-2 before xtb-10."""
    stem = name.rstrip("0123456789")
    return stem, int(name[len(stem) :] or 0), name

