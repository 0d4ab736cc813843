"""Tasks for whichever robot is free: submitted to the fleet's dispatcher, listed, changed.

    ids = fleet.dispatch.submit(Task.goto(4.0, 2.0, who={"tag": "red"}), Task.wander(30.0))
    fleet.dispatch.wait(ids)
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Iterable, Sequence
from typing import Any, Union, cast

from . import wire
from .errors import FleetError, GoalEnded, Malformed, NotThere, OutcomeUnknown, Refused, TimedOut
from .link import Asking, Link
from .messages import (
    DispatchBody,
    DispatchReply,
    DispatchRequest,
    DispatchStatus,
    Suspension,
    TaskChange,
    TaskHistory,
    TaskKindInput,
    TaskList,
    TaskSpecInput,
    TaskView,
    WaypointInput,
)

ENDED = ("done", "failed", "cancelled")
STARTS_WITHIN_S = 5.0
"""A dispatcher that is just starting is waited for this long."""
CONFIRMS_WITHIN_S = 6.0
"""It answers a change within 5 s, confirmed or not."""
ANSWERS_WITHIN_S = 2.0
ASK_AGAIN_S = 0.2
LOOK_EVERY_S = 0.2
MOST_BYTES_OF_PAGES = 256 << 20
LEDGERS = 3
"""So often a list is begun again because the ledger has changed."""

Point = Union[tuple[float, float], tuple[float, float, float], WaypointInput]
"""(x, y) or (x, y, yaw), in m and rad."""


class Task:
    """Makes tasks. Further options (docs/protocol.md, Dispatch): `who`, `priority`, `deadline_ms`, `retries`,
    `on_link_loss`, `finish_s`, `on_takeover`, `grace_s`."""

    @staticmethod
    def goto(x: float, y: float, yaw: float | None = None, **options: Any) -> TaskSpecInput:
        """Drive to a point."""
        return _spec({"goto": {"to": {"x_m": float(x), "y_m": float(y), "yaw_rad": yaw}}}, options)

    @staticmethod
    def route(points: Iterable[Point], loops: int = 1, dwell_s: float = 0.0, **options: Any) -> TaskSpecInput:
        """Drive along points."""
        return _spec({"route": {"points": _points(points), "loops": loops, "dwell_s": dwell_s}}, options)

    @staticmethod
    def patrol(
        points: Iterable[Point], for_s: float | None = None, dwell_s: float = 0.0, **options: Any
    ) -> TaskSpecInput:
        """Drive along points again and again."""
        return _spec({"patrol": {"points": _points(points), "for_s": for_s, "dwell_s": dwell_s}}, options)

    @staticmethod
    def wander(for_s: float, **options: Any) -> TaskSpecInput:
        """Wander for so long."""
        return _spec({"wander": {"for_s": float(for_s)}}, options)


def _spec(kind: TaskKindInput, options: dict[str, Any]) -> TaskSpecInput:
    known = TaskSpecInput.__optional_keys__
    unknown = options.keys() - known
    if unknown:
        raise TypeError(f"a task has no {', '.join(sorted(unknown))}; it has {', '.join(sorted(known))}")
    return cast(TaskSpecInput, {"kind": kind, **options})


def _points(points: Iterable[Point]) -> list[WaypointInput]:
    return [_point(point) for point in points]


def _point(point: Point) -> WaypointInput:
    if isinstance(point, dict):
        return point
    yaw = float(point[2]) if len(point) > 2 else None
    return {"x_m": float(point[0]), "y_m": float(point[1]), "yaw_rad": yaw}


class Tasks(list[TaskView]):
    """Tasks, as a list; `suspended` says what keeps the dispatcher from assigning them."""

    suspended: list[Suspension]

    def __init__(self, tasks: Iterable[TaskView], suspended: list[Suspension]) -> None:
        super().__init__(tasks)
        self.suspended = suspended

    def _repr_html_(self) -> str:
        from . import display

        return display.tasks(self)


class Dispatch:
    """The fleet's dispatcher: `fleet.dispatch`. It needs `fleet-cli dispatch serve` or `sim --dispatch`."""

    def __init__(self, link: Link) -> None:
        self._link = link

    @property
    def is_there(self) -> bool:
        """Whether one runs."""
        return bool(self._link.present(self._link.keys.dispatch("alive"), 0.5))

    def submit(self, *tasks: TaskSpecInput) -> list[str]:
        """All of these or none; their ids, in this order. Asked again with the same id: they are taken once."""
        ids: list[str] = self._ask({"submit": {"tasks": list(tasks)}}, "submitted")
        return ids

    def tasks(self) -> Tasks:
        """All tasks that it remembers, in the order of their ids."""
        for _ in range(LEDGERS):
            tasks = self._tasks()
            if tasks is not None:
                return tasks
        raise FleetError("failed", "the dispatcher's ledger changes again and again")

    def _tasks(self) -> Tasks | None:
        """None = its ledger has changed meanwhile."""
        page = self._page("tasks?format=json")
        if page["left_out"] == 0:
            return Tasks(page["tasks"], page["suspended"])
        found: list[TaskView] = []
        ledger = page["ledger"]
        after, left_out, size = "t0", 1, 0
        while left_out:
            page = self._page(f"tasks?format=json;after={after}")
            if page["ledger"] != ledger:
                return None
            if not page["tasks"]:
                break
            found += page["tasks"]
            size += wire.MOST_BYTES_OF_TASKS
            after, left_out = page["tasks"][-1]["id"], page["left_out"]
            if size > MOST_BYTES_OF_PAGES:
                raise FleetError("failed", "the dispatcher's list of tasks does not end")
        return Tasks(found, page["suspended"])

    def show(self, task: str) -> TaskHistory:
        """One task and how it came to be so."""
        history: TaskHistory = self._ask({"show": {"task": task}}, "shown", 0.0)
        return history

    def cancel(self, *tasks: str) -> list[TaskChange]:
        """Ends them; answered when their robots have confirmed."""
        return self._changed({"cancel": {"tasks": list(tasks)}})

    def cancel_all(self) -> list[TaskChange]:
        """Ends all that have not ended."""
        return self._changed({"cancel_all": {}})

    def pause(self, *tasks: str) -> list[TaskChange]:
        """Puts them aside; their robots stop."""
        return self._changed({"pause": {"tasks": list(tasks)}})

    def resume(self, *tasks: str) -> list[TaskChange]:
        """Lets go on what is paused or held."""
        return self._changed({"resume": {"tasks": list(tasks)}})

    def retry(self, *tasks: str) -> list[TaskChange]:
        """Queues again what has failed or was cancelled."""
        return self._changed({"retry": {"tasks": list(tasks)}})

    def extend(self, task: str, points: Iterable[Point], after: int | None = None) -> list[TaskChange]:
        """Adds points to a route that has not ended, after its last one.

        `after`: points that it has without these (None = as many as it has now). The same again adds nothing twice.
        """
        if after is None:
            kind = self.show(task)["task"]["spec"]["kind"]
            after = len(kind["route"]["points"]) if "route" in kind else 1
        return self._changed({"extend": {"task": task, "after": after, "points": _points(points)}})

    def activate(self) -> Suspension | None:
        """Lets it assign tasks again after an emergency stop of all robots."""
        ended: Suspension | None = self._ask({"activate": {}}, "activated")
        return ended

    def status(self) -> DispatchStatus:
        """How it stands."""
        status: DispatchStatus = self._ask({"status": {}}, "status", 0.0)
        return status

    def wait(self, tasks: str | Sequence[str], timeout: float | None = None, check: bool = True) -> Tasks:
        """Waits until they have ended, and says how.

        Raises `GoalEnded` if one is not done, unless `check` is False; `TimedOut` after `timeout` s.
        """
        wanted = [tasks] if isinstance(tasks, str) else list(tasks)
        until = None if timeout is None else time.monotonic() + timeout
        while (ended := self._look(wanted, check)) is None:
            if until is not None and time.monotonic() >= until:
                raise TimedOut("timed_out", f"not all of {', '.join(wanted)} have ended after {timeout} s")
            time.sleep(LOOK_EVERY_S)
        return ended

    def _look(self, wanted: list[str], check: bool) -> Tasks | None:
        """The tasks, if all have ended."""
        every = self.tasks()
        found = {task["id"]: task for task in every if task["id"] in wanted}
        missing = [task for task in wanted if task not in found]
        if missing:
            raise Refused("unknown_task", f"the dispatcher does not know {', '.join(missing)}")
        if any(task["state"] not in ENDED for task in found.values()):
            return None
        bad = [task for task in found.values() if task["state"] != "done"]
        if bad and check:
            words = ", ".join(f"{task['id']} {task['state']}: {task['reason'] or 'no reason given'}" for task in bad)
            raise GoalEnded(bad[0]["state"], words, f"`fleet.dispatch.show({bad[0]['id']!r})` tells its history")
        return Tasks((found[task] for task in wanted), every.suspended)

    def _changed(self, body: DispatchBody) -> list[TaskChange]:
        changes: list[TaskChange] = self._ask(body, "changed", within=CONFIRMS_WITHIN_S)
        errors = [change["error"] for change in changes if change["error"] is not None]
        # The worst of several: that a robot has not confirmed.
        errors.sort(key=lambda error: error["code"] != "unconfirmed")
        if errors:
            raise Refused(errors[0]["code"], errors[0]["message"], errors[0]["hint"])
        return changes

    def _ask(
        self, body: DispatchBody, wanted: str, patience: float = STARTS_WITHIN_S, within: float = ANSWERS_WITHIN_S
    ) -> Any:
        """Asks with one id until it is answered or `patience` is over."""
        link = self._link
        link.settings.may("change tasks")
        link._check_open()
        key = link.keys.dispatch(f"cmd/{link.keys.client}")
        request_id = str(uuid.uuid4())
        message: DispatchRequest = {"id": request_id, "body": body}
        began, was_there, busy = time.monotonic(), False, None
        while True:
            asked, patient = time.monotonic(), link.round_trip.patience(within)
            asking = Asking(link)
            asking.ask(key, patient, message)
            for answer in asking.all(patient + 0.5):
                reply = _reply(answer.key, key, answer.payload, request_id)
                if reply is None:
                    continue
                result = cast("dict[str, Any]", reply["result"])
                if wanted in result:
                    return result[wanted]
                error = result.get("error")
                if error is None:
                    raise FleetError("failed", "unreadable answer from the dispatcher", "compare the versions")
                if error["code"] != "overloaded":
                    raise Refused(error["code"], error["message"], error["hint"])
                busy = Refused(error["code"], error["message"], error["hint"])
            # Where nobody could have got it the question ends at once.
            was_there = was_there or time.monotonic() - asked >= patient or self.is_there
            if time.monotonic() - began >= patience:
                raise busy if busy and not was_there else link.explained(self._silent(patience, was_there))
            time.sleep(ASK_AGAIN_S)

    def _page(self, rest: str) -> TaskList:
        answers = self._link.get(self._link.keys.dispatch(rest), self._link.round_trip.patience(ANSWERS_WITHIN_S))
        for answer in answers:
            if answer.key != self._link.keys.dispatch("tasks"):
                continue
            try:
                return cast(TaskList, wire.read("TaskList", answer.payload, wire.MOST_BYTES_OF_TASKS))
            except Malformed as error:
                raise FleetError("failed", f"unreadable answer from the dispatcher: {error.message}") from None
        raise self._link.explained(self._silent(0.0, self.is_there))

    def _silent(self, waited: float, was_there: bool) -> FleetError:
        fleet = self._link.settings.fleet
        if was_there:
            message = f"the dispatcher of fleet {fleet} does not answer: outcome unknown"
            return OutcomeUnknown("outcome_unknown", message, "`fleet.dispatch.tasks()` shows its tasks when it answers")
        waiting = f" (waited {waited:.0f} s)" if waited else ""
        hint = "start one with `fleet-cli dispatch serve` or `fleet-cli sim --dispatch`"
        return NotThere("no_dispatcher", f"fleet {fleet} has no dispatcher{waiting}", hint)


def _reply(key: str, asked: str, payload: bytes, request_id: str) -> DispatchReply | None:
    if key != asked:
        return None
    try:
        reply = cast(DispatchReply, wire.read("DispatchReply", payload, wire.MOST_BYTES_OF_TASKS))
    except Malformed:
        return None
    return reply if reply["id"] in (request_id, str(uuid.UUID(int=0))) else None
