"""Control of one robot: a lease that the robot grants, kept in the background, given back.

    with robot.lease():
        robot.goto(1.0, 2.0).wait()

A thread sends a `retain` every 100 ms, whether or not those before were answered. It ends with the block, with the
object and with the interpreter: 500 ms later the robot's own clock ends a goal with `halt`, 900 ms later the lease
is free.
"""

from __future__ import annotations

import threading
import time
import uuid
import weakref
from typing import TYPE_CHECKING

from . import messages, wire
from .errors import FleetError, Invalid, LeaseLost, Malformed
from .link import COMMAND, Answer, Asking

if TYPE_CHECKING:
    from .robot import Robot

RETAIN_EVERY_S = 0.1
RETAIN_WITHIN_S = 0.5
RETAINS = 48
"""Retains on their way at most."""


class Lease:
    """Control of a robot, for a `with` block or from :meth:`acquire` to :meth:`release`."""

    def __init__(self, robot: Robot, take: bool) -> None:
        self._robot = robot
        self._take = take
        self._lock = threading.Lock()
        self._grant: messages.Lease | None = None
        self._lost: LeaseLost | None = None
        self._ended = threading.Event()
        self._retains = Asking(robot._link)
        self._setpoints = 0
        self.taken_from: str | None = None
        """From whom it was taken; None = nobody held it."""

    def __enter__(self) -> Lease:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def __repr__(self) -> str:
        how = "lost" if self.lost else "held" if self.is_held else "not held"
        return f"<lease of {self._robot.name}: {how}>"

    @property
    def is_held(self) -> bool:
        """Whether the robot has granted it, and has not said otherwise since."""
        with self._lock:
            return self._grant is not None

    @property
    def lost(self) -> LeaseLost | None:
        """How it was lost, if it was."""
        with self._lock:
            return self._lost

    def acquire(self) -> Lease:
        """Asks the robot for it; with `take` also if somebody else holds it.

        Raises `Refused` (`lease_held` names the holder), or `OutcomeUnknown`.
        """
        robot = self._robot
        if self._grant is not None or self._ended.is_set():
            raise Invalid("usage", "a lease is acquired once", f"make a new one with `fleet[{robot.name!r}].lease()`")
        if (other := robot._held()) is not None and other.is_held:
            hint = "use the lease that it has, or release that first"
            raise Invalid("usage", f"this program controls {robot.name} already", hint)
        link = robot._link
        try:
            done = link.request(robot.name, {"acquire": {"take": False}})
        except FleetError as error:
            if not self._take or error.code != "lease_held":
                raise
            state = robot._ask_state()
            self.taken_from = state.holder if state else None
            done = link.request(robot.name, {"acquire": {"take": True}})
        grant = done.get("lease")
        if grant is None:
            raise FleetError("outcome_unknown", f"the reply for {robot.name} has no lease, so it is not from a robot")
        with self._lock:
            self._grant = grant
        robot._lease = weakref.ref(self)
        keeper = threading.Thread(
            target=_keep, args=(weakref.ref(self), self._ended), name=f"lease of {robot.name}", daemon=True
        )
        keeper.start()
        return self

    def release(self) -> None:
        """Gives it back: a goal with `halt` ends. If that is not answered, it runs out by itself."""
        self._ended.set()
        with self._lock:
            grant, self._grant = self._grant, None
        if self._robot._held() is self:
            self._robot._lease = None
        self._retains = Asking(self._robot._link)  # a queue that nobody reads any more would block Zenoh when full
        if grant is None or self._robot._link.is_closed:
            return
        try:
            self._robot._link.request(self._robot.name, {"release": {}}, grant)
        except FleetError:
            pass

    def grant(self) -> messages.Lease:
        """What requests bear. Raises :class:`LeaseLost`."""
        with self._lock:
            if self._lost is not None:
                raise self._lost
            if self._grant is None:
                raise no_lease(self._robot.name)
            return self._grant

    def _number(self) -> int:
        """The next setpoint's, counted from 1 in each grant."""
        self._setpoints += 1
        return self._setpoints

    def _said(self, error: FleetError) -> None:
        """The robot refused something that bore the lease."""
        if error.code != "lease_lost":
            return
        name = self._robot.name
        hint = f"`fleet-cli why {name}` shows who controls it; lease(take=True) takes control again"
        with self._lock:
            if self._grant is not None:
                self._grant = None
                self._lost = LeaseLost("lease_lost", f"control of {name} lost: {error.message}", hint)
        self._ended.set()

    def _retain(self) -> None:
        """Reads what came of those before, and sends one, without waiting for its answer."""
        link, key = self._robot._link, self._robot._link.keys.cmd(self._robot.name)
        while (answer := self._retains.poll()) is not None:
            self._answered(answer, key)
        with self._lock:
            grant = self._grant
        if grant is None or self._retains.open >= RETAINS:
            return
        within = min(link.round_trip.patience(RETAIN_WITHIN_S), 4.0)
        self._retains.ask(
            key, within, {"id": str(uuid.uuid4()), "lease": grant, "body": {"retain": {}}}, COMMAND
        )

    def _answered(self, answer: Answer, key: str) -> None:
        try:
            reply = wire.read("Reply", answer.payload)
        except Malformed:
            return
        error = reply["result"].get("error")
        if answer.key == key and error is not None:
            self._said(FleetError(error["code"], error["message"], error["hint"]))


def no_lease(robot: str) -> Invalid:
    """What needs control was asked for without it."""
    hint = f"`with fleet[{robot!r}].lease(): …` takes control"
    return Invalid("lease_required", f"this needs control of {robot}", hint)


def _keep(itself: weakref.ref[Lease], ended: threading.Event) -> None:
    """Retains a lease until it has ended, or nobody has the object any more."""
    due = time.monotonic()
    while not ended.wait(max(due - time.monotonic(), 0.0)):
        lease = itself()
        if lease is None:
            return
        if lease._robot._link.is_closed:
            return
        lease._retain()
        del lease
        # What was missed while the interpreter was busy is not made up for.
        due = max(due + RETAIN_EVERY_S, time.monotonic())
