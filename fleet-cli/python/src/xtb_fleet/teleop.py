"""Driving by hand, hold-to-run: the robot drives only while the program goes on saying so.

    with robot.lease(), robot.teleop() as hand:
        while joystick.is_held():
            hand.drive(throttle=joystick.y, steering=joystick.x)

Between two calls of `drive` the last setpoint is repeated at 20 Hz, for `deadman` seconds at most: then one setpoint
of zero is sent, and nothing more before the next call. When the block ends, however it ends, nothing is repeated any
more, and zero and a `stop` are sent. If this program dies, a setpoint lives 200 ms on the robot's own clock.
"""

from __future__ import annotations

import math
import threading
import time
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING

from .errors import FleetError, Invalid, NotThere
from .lease import Lease
from .link import SETPOINT
from .messages import Setpoint

if TYPE_CHECKING:
    from .robot import Robot

SEND_EVERY_S = 0.05
ECHO_MOST_S = 0.3
"""A setpoint that answers to an older state than this would be dropped: it is not sent."""
CAUTIOUS_RPM = 20.0
"""Full throttle at most, if the robot does not say what it accepts."""
DEADMAN_S = 0.3
DEADMAN_LEAST_S, DEADMAN_MOST_S = 0.05, 2.0

IDLE_S = 1.0
"""So often it is looked whether anybody has the object still."""

Hand = tuple[float, float]
"""Throttle −1..1 (+ = ahead) and steering −1..1 (+ = right)."""


class Teleop:
    """A robot that is driven by hand, for a `with` block."""

    def __init__(self, robot: Robot, lease: Lease, deadman: float, max_rpm: float | None) -> None:
        if not DEADMAN_LEAST_S <= deadman <= DEADMAN_MOST_S:
            raise Invalid("usage", f"a deadman of {deadman} s: {DEADMAN_LEAST_S} to {DEADMAN_MOST_S} s are possible")
        if max_rpm is not None and not 0 < max_rpm <= 353:
            raise Invalid("usage", f"max_rpm={max_rpm}: above 0, and at most 353")
        self._robot = robot
        self._lease = lease
        self._deadman = deadman
        self._max_rpm = max_rpm
        self._changed = threading.Condition()
        self._hand: Hand | None = None
        self._moved = 0.0
        self._sent_at = 0.0
        self._ended = True
        self._failed: FleetError | None = None
        self.sent = 0
        """Setpoints that were sent."""
        self.expired = 0
        """How often the deadman has ended the drive."""
        self.unheard = 0
        """Setpoints that were not sent because the robot was not heard for 300 ms."""
        self.stopped: bool | None = None
        """Whether the robot has confirmed the `stop` at the end; None = none was due, or control was lost."""

    def __enter__(self) -> Teleop:
        robot = self._robot
        if self._max_rpm is None:
            about = robot.about()
            most = about["limits"]["max_rpm"] if about else CAUTIOUS_RPM
            if not most > 0:
                raise FleetError("failed", f"{robot.name} says that it accepts at most {most} rpm")
            self._max_rpm = min(most, 353.0)
        if robot._states().wait(robot.name, robot._link.patience, time.monotonic() - ECHO_MOST_S) is None:
            raise NotThere("no_robot", f"{robot.name} is not heard", "`fleet.robots()` shows the robots present")
        self._lease.grant()
        self._ended = False
        threading.Thread(
            target=_repeat, args=(weakref.ref(self), self._changed), name=f"teleop of {robot.name}", daemon=True
        ).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._let_go()

    def drive(self, throttle: float, steering: float = 0.0) -> None:
        """Where the hand is: throttle −1..1 (+ = ahead), steering −1..1 (+ = right). Call it again and again.

        Raises what ended the drive, such as `LeaseLost`.
        """
        throttle, steering = float(throttle), float(steering)
        if not (math.isfinite(throttle) and math.isfinite(steering)):
            self.release()
            raise Invalid("usage", f"throttle={throttle}, steering={steering}: numbers from -1 to 1")
        with self._changed:
            if self._failed is not None:
                raise self._failed
            if self._ended:
                raise Invalid("usage", "the teleop block has ended", "`with robot.teleop() as hand: hand.drive(…)`")
            self._hand = (max(-1.0, min(1.0, throttle)), max(-1.0, min(1.0, steering)))
            self._moved = time.monotonic()
            self._changed.notify()

    def release(self) -> None:
        """Lets go: zero is sent once, and nothing more before the next `drive`."""
        with self._changed:
            if self._hand is not None and not self._ended:
                self._hand = None
                self._send((0.0, 0.0))

    def run(self, source: Callable[[], Hand | None], for_s: float | None = None) -> None:
        """Asks `source` at 20 Hz for throttle and steering, until it says None or `for_s` is over.

        While a source hangs, the deadman ends the drive.
        """
        began = due = time.monotonic()
        while for_s is None or time.monotonic() - began < for_s:
            hand = source()
            if hand is None:
                break
            self.drive(*hand)
            due = max(due + SEND_EVERY_S, time.monotonic())
            time.sleep(max(due - time.monotonic(), 0.0))
        self.release()

    def _turn(self) -> float:
        """With the lock held: sends what is due. How long until something is due again, in s."""
        now = time.monotonic()
        if self._hand is None:
            return IDLE_S
        if now - self._moved > self._deadman:
            # Never the last setpoint again: only `drive` makes a new one.
            self._hand = None
            self.expired += 1
            self._send((0.0, 0.0))
            return IDLE_S
        if now - self._sent_at >= SEND_EVERY_S:
            self._send(self._hand)
        return max(min(self._sent_at + SEND_EVERY_S, self._moved + self._deadman) - now, 0.0) + 1e-4

    def _send(self, hand: Hand) -> None:
        """With the lock held: after the end of the block nobody gets here."""
        robot, now = self._robot, time.monotonic()
        self._sent_at = now
        state = robot._states().last.get(robot.name)
        if state is None or state.age > ECHO_MOST_S:
            self.unheard += 1
            return
        try:
            setpoint: Setpoint = {
                "lease": self._lease.grant(),
                "seq": self._lease._number(),
                "echo_tick_ms": state.data["tick_ms"],
                "rpm": hand[0] * (CAUTIOUS_RPM if self._max_rpm is None else self._max_rpm),
                "steering": hand[1],
            }
            robot._link.put(robot._link.keys.teleop(robot.name), setpoint, SETPOINT)
        except FleetError as error:
            self._failed, self._hand = error, None
            return
        self.sent += 1

    def _let_go(self) -> None:
        """Nothing is repeated from here on; zero and a stop, unless nothing was sent or control was lost."""
        with self._changed:
            if self._ended:
                return
            self._hand = None
            owed = self.sent > 0 and self._lease.lost is None
            if owed:
                self._send((0.0, 0.0))
            self._ended = True
            self._changed.notify()
        if not owed:
            return
        try:
            self._robot._link.request(self._robot.name, {"stop": {}})
            self.stopped = True
        except FleetError:
            self.stopped = False  # by the robot's own clock it stands 200 ms after the last setpoint


def _repeat(itself: weakref.ref[Teleop], changed: threading.Condition) -> None:
    """Sends what is due until the block has ended, or nobody has the object any more."""
    with changed:
        while (hand := itself()) is not None and not hand._ended:
            pause = hand._turn()
            del hand
            changed.wait(pause)
