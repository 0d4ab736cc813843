"""A simulator with real agents (`fleet-cli sim`), its ground truth, and robots that only pretend to be some."""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
import time
import unittest
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import zenoh

from xtb_fleet import Fleet

T = TypeVar("T")
LIMIT_S = 60.0
"""Nothing that is waited for takes as long."""


def fleet_cli() -> str:
    """The program, or the test is skipped."""
    program = os.environ.get("XTB_FLEET_CLI")
    if not program:
        raise unittest.SkipTest("XTB_FLEET_CLI does not name a fleet-cli")
    return program


def eventually(what: str, look: Callable[[], T | None], limit_s: float = LIMIT_S) -> T:
    """The first thing that is there."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        found = look()
        if found is not None and found is not False:
            return found
        time.sleep(0.01)
    raise AssertionError(f"{what}: not within {limit_s} s")


def plain_session(endpoint: str) -> zenoh.Session:
    """Zenoh without this package."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    return zenoh.open(config)


class Program:
    """A program of this project that says when it is ready."""

    def __init__(self, *arguments: str) -> None:
        command = [fleet_cli(), "--json", *arguments]
        environment = {"PATH": os.environ.get("PATH", ""), "HOME": tempfile.gettempdir(), "XTB_IDENTITY": ""}
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, env=environment
        )
        assert self.process.stdout is not None
        self.ready: dict[str, Any] = json.loads(self.process.stdout.readline())

    def end(self) -> None:
        """As Ctrl-C."""
        self.process.send_signal(2)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


class Sim:
    """A simulator of its own, its robots' ground truth, and a fleet."""

    def __init__(self, robots: int = 3, *more: str) -> None:
        self._folder = tempfile.TemporaryDirectory()
        ledger = str(Path(self._folder.name) / "lab.ledger")
        listen = ["--listen", "tcp/127.0.0.1:0"] if "--listen" not in more else []
        arguments = ["sim", "--robots", str(robots), "--dispatch", "--ledger", ledger, *listen, *more]
        self._program = Program(*arguments)
        self.endpoint: str = self._program.ready["router"]
        self._truth: dict[str, Any] = {}
        self._session: zenoh.Session | None = None

    def watch(self) -> None:
        """Subscribes to the ground truth."""
        self._session = plain_session(self.endpoint)
        self._session.declare_subscriber("xtb/lab/sim/truth", self._came)
        eventually("the ground truth", lambda: self._truth or None)

    def _came(self, sample: zenoh.Sample) -> None:
        self._truth = json.loads(sample.payload.to_bytes())

    @property
    def session(self) -> zenoh.Session:
        """Zenoh without this package."""
        assert self._session is not None
        return self._session

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._truth["t_s"])

    def truth(self, robot: str) -> dict[str, Any]:
        """Where a truck really is."""
        truth: dict[str, Any] = self._truth["robots"][robot]
        return truth

    def simulated(self, seconds: float) -> None:
        """Waits until so much simulated time is over."""
        until = self.time_s + seconds
        eventually(f"{seconds} s of the simulation", lambda: self.time_s >= until)

    def connect(self, **more: Any) -> Fleet:
        """Without an identity, whatever this computer has."""
        return Fleet.connect(self.endpoint, identity="none", timeout_s=10.0, **more)

    def end(self) -> None:
        """Ends the simulator."""
        if self._session is not None:
            self._session.close()  # type: ignore[no-untyped-call]
        self._program.end()
        self._folder.cleanup()


class FakeRobot:
    """Answers and publishes in the name of a robot that is none."""

    def __init__(self, session: zenoh.Session, name: str) -> None:
        self._session, self.name = session, name
        self.requests: list[dict[str, Any]] = []
        self.answer: Callable[[dict[str, Any]], dict[str, Any] | bytes | None] = lambda _: None
        self._key = f"xtb/lab/{name}"
        self._token = session.liveliness().declare_token(f"{self._key}/alive")
        self._queryable = session.declare_queryable(f"{self._key}/cmd/*", self._asked, complete=True)

    def _asked(self, query: zenoh.Query) -> None:
        with query:
            payload = query.payload
            request = json.loads(payload.to_bytes()) if payload is not None else {}
            self.requests.append(request)
            answer = self.answer(request)
            if answer is not None:
                data = answer if isinstance(answer, bytes) else json.dumps(answer)
                query.reply(str(query.key_expr), data, encoding="application/json")

    def publish(self, rest: str, payload: bytes | str) -> None:
        """On one of the robot's keys."""
        self._session.put(f"{self._key}/{rest}", payload, encoding="application/json")

    def end(self) -> None:
        """It is gone."""
        self._queryable.undeclare()  # type: ignore[no-untyped-call]
        self._token.undeclare()  # type: ignore[no-untyped-call]


def granted(request: dict[str, Any]) -> dict[str, Any]:
    """Yes, with a lease."""
    return {"id": request["id"], "result": {"ok": {"lease": {"epoch": 7, "root": 1}, "goal": None}}}

