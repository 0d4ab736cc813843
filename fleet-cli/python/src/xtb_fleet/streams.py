"""What robots say, as it comes: the last state of each, and streams that a program reads at its own pace."""

from __future__ import annotations

import asyncio
import threading
import time
import weakref
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from typing import Any, Generic, TypeVar, cast

from . import wire
from .errors import Malformed
from .keys import Keys
from .link import Link
from .messages import Event, GoalState, RobotState

STALE_S = 0.5
"""A state older than this is not the present one."""
QUEUE = 256
"""Items that a stream keeps for a reader who is slow, unless it was told otherwise."""

MOST_ROBOTS = 1024
"""Whose states are kept at most: the largest fleet that the programs have room for."""

T = TypeVar("T")


@dataclass(frozen=True, repr=False)
class State:
    """What a robot said of itself, and when it came in: `state["pose"]["x_m"]`, `state.age`."""

    data: RobotState
    """As on the wire: docs/protocol.md, State."""
    received: float
    """When, on `time.monotonic()`."""

    def __getitem__(self, field: str) -> Any:
        return cast("dict[str, Any]", self.data)[field]

    @property
    def age(self) -> float:
        """Since it came in, in s."""
        return time.monotonic() - self.received

    @property
    def is_fresh(self) -> bool:
        """Whether it says how the robot stands now."""
        return self.age <= STALE_S

    @property
    def robot(self) -> str:
        """Whose."""
        return self.data["robot"]

    @property
    def mode(self) -> str:
        """`idle`, `goto`, `wander`, `teleop`, `manual` or `fault`."""
        return self.data["mode"]

    @property
    def x(self) -> float:
        """East in the map, in m."""
        return self.data["pose"]["x_m"]

    @property
    def y(self) -> float:
        """North in the map, in m."""
        return self.data["pose"]["y_m"]

    @property
    def yaw(self) -> float:
        """Counter-clockwise from east, in rad."""
        return self.data["pose"]["yaw_rad"]

    @property
    def goal(self) -> GoalState | None:
        """The present or last goal."""
        return self.data["goal"]

    @property
    def holder(self) -> str | None:
        """Who controls it; None = nobody."""
        lease = self.data["lease"]
        return lease["holder"] if lease else None

    @property
    def stopped_because(self) -> list[str]:
        """Why it stands, the most important first."""
        return list(self.data["stopped_because"])

    @property
    def latches(self) -> list[str]:
        """Latched stops: `reset` ends them."""
        return [latch["latch"] for latch in self.data["latches"]]

    def __repr__(self) -> str:
        return (
            f"<{self.robot}: {self.mode} at ({self.x:.2f}, {self.y:.2f}, {self.yaw:.2f} rad), {self.age:.2f} s ago"
            f"{', ' + ', '.join(self.stopped_because) if self.stopped_because else ''}>"
        )

    def _repr_html_(self) -> str:
        from . import display

        return display.state_card(self)


class Stream(Generic[T]):
    """Items as they come, for `for` and `async for`; a reader that is slow loses the oldest, and `dropped` counts them.

    It ends when it is closed, or with `timeout` when nothing came for so long.
    """

    def __init__(self, size: int, timeout: float | None, ended: Callable[[Stream[T]], None]) -> None:
        self._items: deque[T] = deque(maxlen=size)
        self._changed = threading.Condition()
        self._waiting: list[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = []
        self._timeout = timeout
        self._ended = ended
        self._closed = False
        self.dropped = 0
        """Items that were lost because the reader was slow."""

    def _push(self, item: T) -> None:
        with self._changed:
            if self._closed:
                return
            if len(self._items) == self._items.maxlen:
                self.dropped += 1
            self._items.append(item)
            self._wake()

    def _wake(self) -> None:
        self._changed.notify_all()
        for loop, event in self._waiting:
            try:
                loop.call_soon_threadsafe(event.set)
            except RuntimeError:
                pass  # that loop has ended
        self._waiting.clear()

    def close(self) -> None:
        """Ends it, with what was not read yet."""
        with self._changed:
            self._closed = True
            self._items.clear()
            self._wake()
        self._ended(self)

    def __enter__(self) -> Stream[T]:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[T]:
        return self

    def __next__(self) -> T:
        with self._changed:
            if not self._changed.wait_for(lambda: self._items or self._closed, self._timeout) or not self._items:
                raise StopIteration
            return self._items.popleft()

    def __aiter__(self) -> AsyncIterator[T]:
        return self

    async def __anext__(self) -> T:
        until = None if self._timeout is None else time.monotonic() + self._timeout
        while True:
            event = asyncio.Event()
            with self._changed:
                if self._items:
                    return self._items.popleft()
                if self._closed:
                    raise StopAsyncIteration
                waiter = (asyncio.get_running_loop(), event)
                self._waiting.append(waiter)
            try:
                await asyncio.wait_for(event.wait(), None if until is None else until - time.monotonic())
            except asyncio.TimeoutError:
                raise StopAsyncIteration from None
            finally:
                with self._changed:
                    if waiter in self._waiting:
                        self._waiting.remove(waiter)


class Feed(Generic[T]):
    """One subscription, and everybody who listens to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._streams: weakref.WeakSet[Stream[T]] = weakref.WeakSet()  # one that nobody reads any more is gone
        self._listeners: list[weakref.WeakMethod[Callable[[T], None]]] = []
        self._undeclare: Callable[[], None] | None = None
        self.unreadable = 0
        """Messages that were none of the protocol."""

    def _publish(self, item: T) -> None:
        with self._lock:
            streams, listeners = list(self._streams), list(self._listeners)
        for reference in listeners:
            if (listener := reference()) is not None:
                listener(item)
        for stream in streams:
            stream._push(item)

    def stream(self, size: int, timeout: float | None) -> Stream[T]:
        """A new stream of what comes from now on."""
        if size < 1:
            raise ValueError(f"a queue of {size} holds nothing")
        stream: Stream[T] = Stream(size, timeout, self._forget)
        with self._lock:
            self._streams.add(stream)
        return stream

    def _forget(self, stream: Stream[T]) -> None:
        with self._lock:
            self._streams.discard(stream)

    def listen(self, listener: Callable[[T], None]) -> None:
        """Calls this for each item, in the thread that receives it: it must be quick."""
        with self._lock:
            self._listeners = [each for each in self._listeners if each() is not None]
            self._listeners.append(weakref.WeakMethod(listener))

    def unlisten(self, listener: Callable[[T], None]) -> None:
        """Ends that."""
        with self._lock:
            self._listeners = [each for each in self._listeners if each() != listener]

    def close(self) -> None:
        """Ends the subscription and the streams."""
        if self._undeclare:
            self._undeclare()
        with self._lock:
            streams = list(self._streams)
        for stream in streams:
            stream.close()


class States(Feed[State]):
    """The states of one robot, or of all."""

    def __init__(self, link: Link, robot: str) -> None:
        super().__init__()
        self._keys = link.keys
        self._came = threading.Condition()
        self.last: dict[str, State] = {}
        """The last state of each robot."""
        self._undeclare = link.subscribe(link.keys.of(robot, "state/json"), self._received)

    def _received(self, key: str, payload: bytes) -> None:
        data = _spoken(self._keys, key, "state", cast("RobotState | None", _read("RobotState", payload)))
        if data is None:
            self.unreadable += 1
            return
        robot = data["robot"]
        state = State(data, time.monotonic())
        with self._came:
            if robot not in self.last and len(self.last) >= MOST_ROBOTS:
                self.unreadable += 1
                return
            self.last[robot] = state
            self._came.notify_all()
        self._publish(state)

    def wait(self, robot: str, within: float, since: float = 0.0) -> State | None:
        """The last state of a robot that came after `since`, waited for if need be."""

        def there() -> State | None:
            last = self.last.get(robot)
            return last if last and last.received > since else None

        with self._came:
            return self._came.wait_for(there, within)


class Events(Feed[Event]):
    """The events of one robot, or of all: the last 64 first."""

    def __init__(self, link: Link, robot: str) -> None:
        super().__init__()
        self._keys = link.keys
        self._undeclare = link.subscribe_events(link.keys.of(robot, "event/json"), self._received)

    def _received(self, key: str, payload: bytes) -> None:
        event = _spoken(self._keys, key, "event", cast("Event | None", _read("Event", payload)))
        if event is None:
            self.unreadable += 1
        else:
            self._publish(event)


def read_state(link: Link, key: str, payload: bytes) -> RobotState | None:
    """A robot's answer to `state?format=json`."""
    data = cast("RobotState | None", _read("RobotState", payload))
    return data if data is not None and link.keys.robot_of(key, "state") == data["robot"] else None


def _read(kind: str, payload: bytes) -> Any:
    try:
        return wire.read(kind, payload)
    except Malformed:
        return None


S = TypeVar("S", RobotState, Event)


def _spoken(keys: Keys, key: str, rest: str, message: S | None) -> S | None:
    """A message, if it is of the robot on whose key it came."""
    if message is None or keys.robot_of(key, f"{rest}/json") != message["robot"]:
        return None
    return message
