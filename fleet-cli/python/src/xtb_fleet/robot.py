"""One robot: what it says, and what can be asked of it."""

from __future__ import annotations

import math
import threading
import time
import uuid
import weakref
from dataclasses import dataclass
from typing import Literal, cast

from . import messages, stops, wire
from .errors import FleetError, GoalEnded, Invalid, LeaseLost, Malformed, NotThere, OutcomeUnknown, TimedOut
from .lease import Lease, no_lease
from .link import Link
from .messages import About, Body, Done, Event, GoalState
from .stops import StopReport
from .streams import QUEUE, Events, State, States, Stream, read_state
from .teleop import DEADMAN_S, Teleop

FINAL = ("reached", "cancelled", "replaced", "failed", "interrupted")
LOOK_EVERY_S = 0.05
OLD_STATES_S = 1.0
"""States that were on their way when a goal was accepted still show the one before."""
REASON_WITHIN_S = 0.5
"""The state may show the end before the event says why."""
GIVE_UP_AFTER_S = 5.0
"""A robot that was not heard for this long may be anywhere: watching ends, outcome unknown."""
LOSS_SETTLES_S = 1.0
"""Who has lost control waits this long to see what came of the goal."""
FINISH_S = 300.0


@dataclass(frozen=True)
class GoalEnd:
    """How a goal ended."""

    status: str
    """`reached`, `cancelled`, `replaced`, `failed` or `interrupted` (the robot restarted)."""
    reason: str | None
    """Why, as far as the robot said."""


class Goal:
    """A goal that the robot has accepted."""

    def __init__(self, robot: Robot, lease: Lease) -> None:
        self.id = str(uuid.uuid4())
        """Its id: that of its request."""
        self.robot = robot
        self._lease = lease
        self._epoch = lease.grant()["epoch"]
        self._lock = threading.Lock()
        self._began: float | None = None
        self._heard = time.monotonic()
        self._seen = False
        self._first_tick: int | None = None
        self._shown: tuple[float, str] | None = None
        self._told: GoalEnd | None = None
        self._taken: float | None = None
        self._state: GoalState | None = None
        # Before it is sent: nothing of it can be missed.
        robot._states().listen(self._on_state)
        robot._events().listen(self._on_event)

    def __repr__(self) -> str:
        return f"<goal {self.id} of {self.robot.name}: {self.status}>"

    @property
    def status(self) -> str:
        """How it stands, as last heard."""
        end = self._ended()
        if end:
            return end.status
        return self._state["status"] if self._state else "accepted"

    @property
    def distance(self) -> float | None:
        """Still to go in a straight line, in m; None = not known."""
        return self._state["distance_m"] if self._state else None

    def wait(self, timeout: float | None = None, check: bool = True) -> GoalEnd:
        """Waits until it has ended, and says how.

        Raises `GoalEnded` if it was not reached, unless `check` is False; `TimedOut` after `timeout` s (the goal
        goes on); `LeaseLost` or `OutcomeUnknown` if nobody can say what became of it.
        """
        until = None if timeout is None else time.monotonic() + timeout
        while (end := self._look(check)) is None:
            if until is not None and time.monotonic() >= until:
                raise self._late(timeout)
            time.sleep(LOOK_EVERY_S)
        return end

    def cancel(self) -> bool:
        """Ends it; False = it did not run any more.

        Raises `FleetError` if the robot may drive on.
        """
        try:
            self._lease.grant()
            self.robot._request({"cancel": {"goal": self.id}}, self._lease)
            return True
        except FleetError as error:
            if error.code == "unknown_goal":
                return False
            message = f"goal {self.id} was not cancelled, {self.robot.name} may still be driving: {error.message}"
            raise type(error)(error.code, message, _stop_hint(self.robot.name)) from None

    def _late(self, timeout: float | None) -> TimedOut:
        return TimedOut("timed_out", f"goal {self.id} of {self.robot.name} has not ended after {timeout} s")

    def _look(self, check: bool) -> GoalEnd | None:
        """How it ended, if it has; raises what makes that unknowable."""
        end = self._ended()
        now = time.monotonic()
        if end is not None:
            self._forget()
            if check and end.status != "reached":
                why = f": {end.reason}" if end.reason else ""
                message = f"{self.robot.name}: goal {end.status}{why}"
                raise GoalEnded(end.status, message, f"`fleet-cli why {self.robot.name}` says why it stands")
            return end
        with self._lock:
            taken, silent = self._taken, now - self._heard
        lost = self._lease.lost
        if lost is not None and (silent > GIVE_UP_AFTER_S or taken is not None and now - taken > LOSS_SETTLES_S):
            self._forget()
            raise lost
        if silent > GIVE_UP_AFTER_S:
            self._forget()
            message = f"no message from {self.robot.name} for {silent:.1f} s"
            raise OutcomeUnknown("outcome_unknown", message, _stop_hint(self.robot.name))
        return None

    def _ended(self) -> GoalEnd | None:
        with self._lock:
            if self._told is not None:
                return self._told
            if self._shown is None:
                return None
            at, status = self._shown
            complete = status == "reached" or time.monotonic() - at >= REASON_WITHIN_S
            return GoalEnd(status, None) if complete else None

    def _send(self, body: Body) -> Goal:
        """Sends it; whether the robot has taken it may stay unknown: then it is told to forget it."""
        try:
            self.robot._request(body, self._lease, self.id)
        except OutcomeUnknown as error:
            self._forget()
            try:
                came = "had started and was cancelled" if self.cancel() else "is not running"
                words = f"goal {self.id} {came}"
            except FleetError:
                words = f"goal {self.id} could not be cancelled either: {self.robot.name} may be driving"
            message = f"{error.message}; {words}"
            raise OutcomeUnknown("outcome_unknown", message, _stop_hint(self.robot.name)) from None
        except FleetError:
            self._forget()
            raise
        with self._lock:
            self._began = self._heard = time.monotonic()
        return self

    def _forget(self) -> None:
        self.robot._states().unlisten(self._on_state)
        self.robot._events().unlisten(self._on_event)

    def _on_state(self, state: State) -> None:
        with self._lock:
            if self._began is None or self._shown is not None or state.received < self._began:
                return
            self._heard = state.received
            since = state.received - self._began
            if self._first_tick is None:
                self._first_tick = state.data["tick_ms"]
            moved_on = state.data["tick_ms"] > self._first_tick
            goal = state.goal
            if state.data["epoch"] != self._epoch:
                self._shown = (state.received, "interrupted")
            elif goal is not None and goal["id"] == self.id:
                self._seen, self._state = True, goal
                if goal["status"] in FINAL:
                    self._shown = (state.received, goal["status"])
            elif self._seen or moved_on and since > OLD_STATES_S:
                self._shown = (state.received, "replaced")
            if state.holder not in (None, self.robot._link.keys.client) and self._lease.lost is not None:
                self._taken = self._taken or state.received

    def _on_event(self, event: Event) -> None:
        goal = event["kind"].get("goal")
        if goal is not None and goal["id"] == self.id and goal["status"] in FINAL:
            with self._lock:
                self._told = self._told or GoalEnd(goal["status"], goal.get("reason"))


class Robot:
    """One robot of the fleet: `fleet["xtb-1"]`."""

    def __init__(self, link: Link, name: str) -> None:
        self.name = name
        self._link = link
        self._lease: weakref.ref[Lease] | None = None  # whoever drops the object lets go of the robot
        self._feeds = threading.Lock()
        self._state_feed: States | None = None
        self._event_feed: Events | None = None

    def __repr__(self) -> str:
        return f"<robot {self.name} of fleet {self._link.settings.fleet}>"

    def _repr_html_(self) -> str:
        from . import display

        return display.robot_card(self)

    # Looking.

    @property
    def state(self) -> State:
        """What it said last, with its age. The first time it is asked; from then on it is subscribed to.

        Raises `NotThere` if it was never heard.
        """
        feed = self._states()
        last = feed.last.get(self.name)
        if last is None or not last.is_fresh:
            # What has just been subscribed to comes within 50 ms.
            last = feed.wait(self.name, 0.2, last.received if last else 0.0) or self._ask_state() or last
        if last is None:
            message = f"{self.name} of fleet {self._link.settings.fleet} is not heard"
            raise NotThere("no_robot", message, "`fleet.robots()` shows the robots present")
        return last

    def states(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[State]:
        """Its states as they come, some 20 a second, for `for` and `async for`; see :class:`Stream`."""
        return self._states().stream(queue, timeout)

    def events(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[Event]:
        """What happens to it, as it comes."""
        return self._events().stream(queue, timeout)

    def about(self) -> About | None:
        """Its factsheet; None = it does not answer."""
        for answer in self._link.get(self._link.keys.of(self.name, "about?format=json")):
            try:
                about = cast(About, wire.read("About", answer.payload))
            except Malformed:
                continue
            if about["robot"] == self.name == self._link.keys.robot_of(answer.key, "about"):
                return about
        return None

    @property
    def is_alive(self) -> bool:
        """Whether it is there now."""
        key = self._link.keys.of(self.name, "alive")
        return key in self._link.present(key)

    # Acting.

    def lease(self, take: bool = False) -> Lease:
        """Control of it, for a `with` block; with `take` also if somebody else has it."""
        return Lease(self, take)

    def goto(
        self,
        x: float,
        y: float,
        yaw: float | None = None,
        *,
        via: Literal["direct", "planned"] | None = None,
        on_link_loss: Literal["halt", "finish"] = "halt",
        finish_s: float = FINISH_S,
    ) -> Goal:
        """Sends it to a point of the map: m east, m north, rad counter-clockwise from east on arrival.

        With `halt` it stops when this program falls silent or gives the lease back; with `finish` it goes on, for
        `finish_s` at most. Raises `Refused`, `LeaseLost` or `OutcomeUnknown`.
        """
        goal: messages.BodyGoto = {
            "x_m": _finite("x", x),
            "y_m": _finite("y", y),
            "yaw_rad": None if yaw is None else _finite("yaw", yaw),
            "via": via,
            "on_link_loss": on_link_loss,
            "finish_s": _finite("finish_s", finish_s),
        }
        return Goal(self, self._control())._send({"goto": goal})

    def wander(
        self,
        for_s: float | None = None,
        *,
        on_link_loss: Literal["halt", "finish"] = "halt",
        finish_s: float = FINISH_S,
    ) -> Goal:
        """Lets it wander, for so long or until it is stopped."""
        wander: messages.BodyWander = {
            "for_s": None if for_s is None else _finite("for_s", for_s),
            "on_link_loss": on_link_loss,
            "finish_s": max(_finite("finish_s", finish_s), for_s or 0.0),
        }
        return Goal(self, self._control())._send({"wander": wander})

    def teleop(self, deadman: float = DEADMAN_S, max_rpm: float | None = None) -> Teleop:
        """Drives it by hand, for a `with` block; `deadman`: how long a call of `drive` holds, in s."""
        return Teleop(self, self._control(), deadman, max_rpm)

    def stop(self) -> StopReport:
        """It drops its goal and stands; needs no lease, is not latched."""
        return stops.stop(self._link, [self.name], lambda: None)

    def estop(self, within: float | None = None) -> StopReport:
        """It stands, latched, until a `reset`; needs no lease. Not a safety-rated stop."""
        return stops.estop(self._link, [self.name], lambda: None, within or self._link.settings.timeout_s)

    def reset(self, latch: messages.Latch | None = None) -> None:
        """Ends latched stops whose cause is gone; moves nothing. Raises `Refused` (`cause_present`)."""
        self._request({"reset": {"latch": latch}}, self._control())

    def set_pose(self, x: float, y: float, yaw: float) -> None:
        """Tells it where it stands: m east, m north, rad."""
        pose: messages.BodySetPose = {
            "x_m": _finite("x", x),
            "y_m": _finite("y", y),
            "yaw_rad": _finite("yaw", yaw),
        }
        self._request({"set_pose": pose}, self._control())

    def _control(self) -> Lease:
        self._link.settings.may("control robots")
        lease = self._held()
        if lease is None:
            raise no_lease(self.name)
        return lease

    def _request(self, body: Body, lease: Lease, request_id: str | None = None) -> Done:
        try:
            return self._link.request(self.name, body, lease.grant(), request_id)
        except LeaseLost as error:
            lease._said(error)
            raise lease.lost or error from None

    def _ask_state(self) -> State | None:
        for answer in self._link.get(self._link.keys.of(self.name, "state?format=json")):
            data = read_state(self._link, answer.key, answer.payload)
            if data is not None and data["robot"] == self.name:
                return State(data, answer.at)
        return None

    def _states(self) -> States:
        with self._feeds:
            if self._state_feed is None:
                self._state_feed = States(self._link, self.name)
            return self._state_feed

    def _events(self) -> Events:
        with self._feeds:
            if self._event_feed is None:
                self._event_feed = Events(self._link, self.name)
            return self._event_feed

    def _let_run_out(self) -> None:
        lease = self._held()
        if lease is not None:
            lease._ended.set()

    def _held(self) -> Lease | None:
        return self._lease() if self._lease is not None else None

    def _close(self) -> None:
        lease = self._held()
        if lease is not None:
            lease.release()
        with self._feeds:
            feeds = [self._state_feed, self._event_feed]
        for feed in feeds:
            if feed is not None:
                feed.close()


def _finite(name: str, value: float) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise Invalid("usage", f"{name}={value} is not a finite number")
    return number


def _stop_hint(robot: str) -> str:
    return f"`fleet[{robot!r}].stop()` stops it, `fleet-cli why {robot}` shows its state"
