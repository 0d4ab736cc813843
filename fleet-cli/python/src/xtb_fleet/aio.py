"""The same for asyncio: what takes time is awaited; streams are the same objects, for `async for`.

    async with Fleet.connect_async() as fleet:
        robot = fleet["xtb-1"]
        async with robot.lease():
            await (await robot.goto(1.0, 2.0)).wait()

Questions run in threads of their own; waiting for a goal or a task costs none. A task that is cancelled while it
waits for a lease gives it back.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future
from typing import Any, Literal, TypeVar

from . import messages
from .dispatch import LOOK_EVERY_S as TASKS_EVERY_S
from .dispatch import Dispatch, Point, Tasks
from .errors import FleetError, TimedOut
from .fleet import Fleet, Robots
from .lease import Lease
from .messages import About, Event, TaskChange, TaskHistory, TaskSpecInput
from .robot import FINISH_S, LOOK_EVERY_S, Goal, GoalEnd, Robot
from .stops import StopReport
from .streams import QUEUE, State, Stream
from .teleop import DEADMAN_S, Teleop

T = TypeVar("T")


def _start(call: Callable[[], T]) -> Future[T]:
    """In a thread of its own: no call waits for those of others, and none is dropped before it has begun."""
    future: Future[T] = Future()
    future.set_running_or_notify_cancel()

    def run() -> None:
        try:
            future.set_result(call())
        except BaseException as error:
            future.set_exception(error)

    threading.Thread(target=run, name="xtb-fleet").start()
    return future


async def _run(call: Callable[[], T], undo: Callable[[T], Any] | None = None) -> T:
    """In a thread; if nobody waits for it any more when it is done, it is undone."""
    future = _start(call)
    try:
        return await asyncio.wrap_future(future)
    except asyncio.CancelledError:
        if undo is not None:  # before the blocks around it end: a goal is cancelled while the lease is there
            back = undo
            await asyncio.shield(asyncio.wrap_future(_start(lambda: _undo(future, back))))
        raise


def _undo(future: Future[T], undo: Callable[[T], Any]) -> None:
    try:
        undo(future.result())
    except FleetError:
        pass  # it failed, or the robot's own clock ends it


class Connecting:
    """A session that is being opened: to be awaited, or for `async with`."""

    def __init__(self, connect: Callable[[], Fleet]) -> None:
        self._connect = connect
        self._fleet: AsyncFleet | None = None

    def __await__(self) -> Generator[Any, None, AsyncFleet]:
        return self._open().__await__()

    async def _open(self) -> AsyncFleet:
        return AsyncFleet(await _run(self._connect, Fleet.close))

    async def __aenter__(self) -> AsyncFleet:
        self._fleet = await self._open()
        return self._fleet

    async def __aexit__(self, *_: object) -> None:
        if self._fleet is not None:
            await self._fleet.close()


class AsyncFleet:
    """:class:`Fleet` for asyncio; `sync` is the same session without."""

    def __init__(self, sync: Fleet) -> None:
        self.sync = sync
        self.dispatch = AsyncDispatch(sync.dispatch)

    def __getitem__(self, name: str) -> AsyncRobot:
        return AsyncRobot(self.sync[name])

    async def close(self) -> None:
        """Gives back the leases, and ends the session."""
        await _run(self.sync.close)

    async def robots(self) -> Robots:
        """See :meth:`Fleet.robots`."""
        return await _run(self.sync.robots)

    async def roster(self) -> list[str] | None:
        """See :meth:`Fleet.roster`."""
        return await _run(self.sync.roster)

    def states(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[State]:
        """See :meth:`Fleet.states`."""
        return self.sync.states(queue, timeout)

    def events(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[Event]:
        """See :meth:`Fleet.events`."""
        return self.sync.events(queue, timeout)

    async def estop_all(self, within: float | None = None) -> StopReport:
        """See :meth:`Fleet.estop_all`. It goes on if the task is cancelled."""
        return await _run(lambda: self.sync.estop_all(within))

    async def stop_all(self) -> StopReport:
        """See :meth:`Fleet.stop_all`."""
        return await _run(self.sync.stop_all)


class AsyncLease:
    """:class:`Lease` for `async with`."""

    def __init__(self, sync: Lease) -> None:
        self.sync = sync

    async def __aenter__(self) -> AsyncLease:
        await _run(self.sync.acquire, Lease.release)
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.shield(_run(self.sync.release))


class AsyncGoal:
    """:class:`Goal` for asyncio."""

    def __init__(self, sync: Goal) -> None:
        self.sync = sync

    async def wait(self, timeout: float | None = None, check: bool = True) -> GoalEnd:
        """See :meth:`Goal.wait`."""
        until = None if timeout is None else time.monotonic() + timeout
        while (end := self.sync._look(check)) is None:
            if until is not None and time.monotonic() >= until:
                raise self.sync._late(timeout)
            await asyncio.sleep(LOOK_EVERY_S)
        return end

    async def cancel(self) -> bool:
        """See :meth:`Goal.cancel`."""
        return await _run(self.sync.cancel)


class AsyncTeleop:
    """:class:`Teleop` for `async with`; `drive` and `release` do not wait."""

    def __init__(self, sync: Teleop) -> None:
        self.sync = sync
        self.drive = sync.drive
        self.release = sync.release

    async def __aenter__(self) -> AsyncTeleop:
        await _run(self.sync.__enter__, lambda teleop: teleop.__exit__())
        return self

    async def __aexit__(self, *_: object) -> None:
        self.sync.release()  # at once, whether or not a thread is free
        await asyncio.shield(_run(self.sync.__exit__))


class AsyncRobot:
    """:class:`Robot` for asyncio."""

    def __init__(self, sync: Robot) -> None:
        self.sync = sync
        self.name = sync.name

    async def state(self) -> State:
        """See :attr:`Robot.state`."""
        return await _run(lambda: self.sync.state)

    def states(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[State]:
        """See :meth:`Robot.states`."""
        return self.sync.states(queue, timeout)

    def events(self, queue: int = QUEUE, timeout: float | None = None) -> Stream[Event]:
        """See :meth:`Robot.events`."""
        return self.sync.events(queue, timeout)

    async def about(self) -> About | None:
        """See :meth:`Robot.about`."""
        return await _run(self.sync.about)

    def lease(self, take: bool = False) -> AsyncLease:
        """See :meth:`Robot.lease`."""
        return AsyncLease(self.sync.lease(take))

    async def goto(
        self,
        x: float,
        y: float,
        yaw: float | None = None,
        *,
        via: Literal["direct", "planned"] | None = None,
        on_link_loss: Literal["halt", "finish"] = "halt",
        finish_s: float = FINISH_S,
    ) -> AsyncGoal:
        """See :meth:`Robot.goto`."""

        def send() -> Goal:
            return self.sync.goto(x, y, yaw, via=via, on_link_loss=on_link_loss, finish_s=finish_s)

        return AsyncGoal(await _run(send, Goal.cancel))

    async def wander(
        self,
        for_s: float | None = None,
        *,
        on_link_loss: Literal["halt", "finish"] = "halt",
        finish_s: float = FINISH_S,
    ) -> AsyncGoal:
        """See :meth:`Robot.wander`."""

        def send() -> Goal:
            return self.sync.wander(for_s, on_link_loss=on_link_loss, finish_s=finish_s)

        return AsyncGoal(await _run(send, Goal.cancel))

    def teleop(self, deadman: float = DEADMAN_S, max_rpm: float | None = None) -> AsyncTeleop:
        """See :meth:`Robot.teleop`."""
        return AsyncTeleop(self.sync.teleop(deadman, max_rpm))

    async def stop(self) -> StopReport:
        """See :meth:`Robot.stop`."""
        return await _run(self.sync.stop)

    async def estop(self, within: float | None = None) -> StopReport:
        """See :meth:`Robot.estop`."""
        return await _run(lambda: self.sync.estop(within))

    async def reset(self, latch: messages.Latch | None = None) -> None:
        """See :meth:`Robot.reset`."""
        await _run(lambda: self.sync.reset(latch))

    async def set_pose(self, x: float, y: float, yaw: float) -> None:
        """See :meth:`Robot.set_pose`."""
        await _run(lambda: self.sync.set_pose(x, y, yaw))


class AsyncDispatch:
    """:class:`Dispatch` for asyncio."""

    def __init__(self, sync: Dispatch) -> None:
        self.sync = sync

    async def submit(self, *tasks: TaskSpecInput) -> list[str]:
        """See :meth:`Dispatch.submit`."""
        return await _run(lambda: self.sync.submit(*tasks))

    async def tasks(self) -> Tasks:
        """See :meth:`Dispatch.tasks`."""
        return await _run(self.sync.tasks)

    async def show(self, task: str) -> TaskHistory:
        """See :meth:`Dispatch.show`."""
        return await _run(lambda: self.sync.show(task))

    async def cancel(self, *tasks: str) -> list[TaskChange]:
        """See :meth:`Dispatch.cancel`."""
        return await _run(lambda: self.sync.cancel(*tasks))

    async def pause(self, *tasks: str) -> list[TaskChange]:
        """See :meth:`Dispatch.pause`."""
        return await _run(lambda: self.sync.pause(*tasks))

    async def resume(self, *tasks: str) -> list[TaskChange]:
        """See :meth:`Dispatch.resume`."""
        return await _run(lambda: self.sync.resume(*tasks))

    async def retry(self, *tasks: str) -> list[TaskChange]:
        """See :meth:`Dispatch.retry`."""
        return await _run(lambda: self.sync.retry(*tasks))

    async def extend(self, task: str, points: Iterable[Point], after: int | None = None) -> list[TaskChange]:
        """See :meth:`Dispatch.extend`."""
        return await _run(lambda: self.sync.extend(task, points, after))

    async def wait(self, tasks: str | Sequence[str], timeout: float | None = None, check: bool = True) -> Tasks:
        """See :meth:`Dispatch.wait`."""
        wanted = [tasks] if isinstance(tasks, str) else list(tasks)
        until = None if timeout is None else time.monotonic() + timeout
        while (ended := await _run(lambda: self.sync._look(wanted, check))) is None:
            if until is not None and time.monotonic() >= until:
                raise TimedOut("timed_out", f"not all of {', '.join(wanted)} have ended after {timeout} s")
            await asyncio.sleep(TASKS_EVERY_S)
        return ended
