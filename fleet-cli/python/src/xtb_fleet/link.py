"""The Zenoh session: opened as the programs open theirs, and requests that are asked until they are answered."""

from __future__ import annotations

import json
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import zenoh
from zenoh import ext

from . import wire
from .errors import FleetError, Invalid, LeaseLost, Malformed, NotAllowed, NotThere, OutcomeUnknown, Refused
from .keys import Keys
from .messages import Body, Done, ErrorBody, Lease, Reply, Request
from .settings import Settings

LINK_LEASE_MS = 2000
"""How long a link may be silent before the other side takes it for lost."""
MOST_BYTES = 8 * 1024 * 1024
"""Of a message that is taken in."""
ASK_AGAIN_S = 0.5
ACQUIRE_AGAIN_S = 0.2
SETTLE_S = 0.15
"""Right after a session opens or a link returns a query can come back at once without a reply: asked once more."""
PATIENCE_MOST_S = 15.0
IN_FLIGHT = 32
MOST_ANSWERS = 2048
MOST_WAITING = 4096
"""Answers of one question, and messages of one subscription, that wait in Zenoh's queue."""
LOOK_MOST_S = 0.005
"""Between two looks whether an answer has come."""
CLOSE_WITHIN_S = 2.0


@dataclass(frozen=True)
class Qos:
    """How Zenoh treats the messages of a channel."""

    congestion: zenoh.CongestionControl
    priority: zenoh.Priority


REQUEST = Qos(zenoh.CongestionControl.BLOCK, zenoh.Priority.DATA)
COMMAND = Qos(zenoh.CongestionControl.BLOCK, zenoh.Priority.INTERACTIVE_LOW)
SETPOINT = Qos(zenoh.CongestionControl.DROP, zenoh.Priority.INTERACTIVE_HIGH)
ESTOP = Qos(zenoh.CongestionControl.DROP, zenoh.Priority.REAL_TIME)


@dataclass(frozen=True)
class Answer:
    """What came back, when, and on which key."""

    at: float
    key: str
    payload: bytes


class RoundTrip:
    """How long an answer takes, smoothed as TCP does it (RFC 6298)."""

    def __init__(self) -> None:
        self._smoothed: float | None = None
        self._deviation = 0.0

    def measured(self, took: float) -> None:
        """An answer took this long."""
        took = min(took, 10.0)
        if self._smoothed is None:
            self._smoothed, self._deviation = took, took / 2
        else:
            self._deviation = (self._deviation * 3 + abs(self._smoothed - took)) / 4
            self._smoothed = (self._smoothed * 7 + took) / 8

    @property
    def bound(self) -> float:
        """By then nearly every answer has come."""
        return (self._smoothed or 0.0) + self._deviation * 4

    def ask_again(self) -> float:
        """An unanswered question is asked again after this long."""
        return min(max(self.bound, ASK_AGAIN_S), 4.0)

    def patience(self, given: float) -> float:
        """How long to wait where `given` is enough on a fast link."""
        return max(given, min(self.bound * 3, PATIENCE_MOST_S))


class Asking:
    """Questions on their way: answers as they come, and how many questions are still open.

    Answers are fetched from a queue of Zenoh's, not by callbacks: a callback needs the interpreter's lock in a thread
    of Zenoh that may hold one of Zenoh's own, and with 1.10 that can end in a deadlock.
    """

    def __init__(self, link: Link) -> None:
        self._link = link
        self._queues: deque[zenoh.Handler[zenoh.Reply]] = deque()

    @property
    def open(self) -> int:
        """Questions that have not ended."""
        return len(self._queues)

    def ask(self, selector: str, within: float, message: Any = None, qos: Qos = REQUEST) -> None:
        """Sends a question."""
        payload = None if message is None else wire.write(message)
        try:
            queue = self._link.session.get(
                selector,
                zenoh.handlers.FifoChannel(MOST_WAITING),
                target=zenoh.QueryTarget.ALL,
                consolidation=zenoh.ConsolidationMode.NONE,
                timeout=max(within, 0.001),
                congestion_control=qos.congestion,
                priority=qos.priority,
                express=True,
                payload=payload,
                encoding=None if payload is None else zenoh.Encoding.APPLICATION_JSON,
            )
        except zenoh.ZError:
            return  # as if nobody had answered: it may be asked again
        self._queues.append(queue)

    def ask_presence(self, key_expr: str, within: float) -> None:
        """Asks who is there."""
        channel: zenoh.handlers.FifoChannel[zenoh.Reply] = zenoh.handlers.FifoChannel(MOST_WAITING)
        try:
            self._queues.append(self._link.session.liveliness().get(key_expr, channel, timeout=max(within, 0.001)))
        except zenoh.ZError:
            return

    def poll(self) -> Answer | None:
        """The next answer, if one is there; questions that have ended are forgotten."""
        for _ in range(len(self._queues)):
            queue = self._queues[0]
            try:
                reply = queue.try_recv()
            except zenoh.ZError:
                self._queues.popleft()
                continue
            self._queues.rotate(-1)
            if reply is not None and (sample := reply.ok) is not None:
                return Answer(time.monotonic(), str(sample.key_expr), sample.payload.to_bytes())
        return None

    def next(self, within: float) -> Answer | None:
        """The next answer; None = a question has ended, or nothing came `within`."""
        until, pause, before = time.monotonic() + within, 0.0002, self.open
        while True:
            news = self.poll()
            if news is not None or self.open < before or (left := until - time.monotonic()) <= 0:
                return news
            time.sleep(min(pause, left))
            pause = min(pause * 1.5, LOOK_MOST_S)

    def all(self, within: float) -> list[Answer]:
        """All answers that come until every question has ended."""
        answers: list[Answer] = []
        until = time.monotonic() + within
        while self.open and len(answers) < MOST_ANSWERS and (left := until - time.monotonic()) > 0:
            if (news := self.next(left)) is not None:
                answers.append(news)
        return answers


class Link:
    """A session with a fleet."""

    def __init__(self, settings: Settings) -> None:
        self.settings = settings
        self.keys = Keys(settings.fleet, settings.client)
        self.round_trip = RoundTrip()
        self.session = _open(settings)
        self.is_closed = False
        """Whether it was closed."""

    def close(self) -> None:
        """Ends the session; a lost link can hold it for longer than anybody waits."""
        self.is_closed = True
        closing = threading.Thread(target=self.session.close, daemon=True)  # type: ignore[no-untyped-call,unused-ignore]
        closing.start()
        closing.join(CLOSE_WITHIN_S)

    @property
    def patience(self) -> float:
        """How long to wait for an answer, in s: as asked for, longer on a slow link."""
        return self.round_trip.patience(self.settings.timeout_s)

    # Looking.

    def get(self, selector: str, within: float | None = None) -> list[Answer]:
        """Everybody's answers; asked for once more if there are none at once."""
        self.settings.may("look")
        within = self.patience if within is None else within
        return self._get(selector, within)

    def _get(self, selector: str, within: float) -> list[Answer]:
        return self._twice(lambda asking: asking.ask(selector, within), within)

    def present(self, key_expr: str, within: float | None = None) -> list[str]:
        """The keys of those who are there."""
        self.settings.may("look")
        within = self.patience if within is None else within
        return [answer.key for answer in self._twice(lambda asking: asking.ask_presence(key_expr, within), within)]

    def _twice(self, ask: Callable[[Asking], None], within: float) -> list[Answer]:
        self._check_open()
        began = time.monotonic()
        asking = Asking(self)
        ask(asking)
        answers = asking.all(within + 0.5)
        if not answers and time.monotonic() - began < within:
            time.sleep(SETTLE_S)
            ask(asking)
            answers = asking.all(within + 0.5)
        return answers

    def subscribe(self, key_expr: str, each: Callable[[str, bytes], None]) -> Callable[[], None]:
        """Passes messages on, in a thread of its own, until the function that it returns is called.

        If that thread is slow the oldest are lost; nothing else waits for it.
        """
        self._check_open()
        self.settings.may("look")
        ring: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(MOST_WAITING)
        subscriber = self.session.declare_subscriber(key_expr, ring)
        return self._pass_on(subscriber, subscriber.handler, each)

    def subscribe_events(self, key_expr: str, each: Callable[[str, bytes], None]) -> Callable[[], None]:
        """The same; the last 64 come first, and lost ones are sent again."""
        self._check_open()
        self.settings.may("look")
        ring: zenoh.handlers.RingChannel[zenoh.Sample] = zenoh.handlers.RingChannel(MOST_WAITING)
        subscriber = ext.declare_advanced_subscriber(
            self.session,
            key_expr,
            ring,
            history=ext.HistoryConfig(detect_late_publishers=True, max_samples=64),
            recovery=ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
        )
        return self._pass_on(subscriber, subscriber.handler, each)

    def _pass_on(
        self, subscriber: Any, handler: zenoh.Handler[zenoh.Sample], each: Callable[[str, bytes], None]
    ) -> Callable[[], None]:
        def listen() -> None:
            while True:
                try:
                    sample = handler.recv()
                except zenoh.ZError:
                    return  # it was undeclared, or the session has ended
                if sample.kind == zenoh.SampleKind.PUT:
                    each(str(sample.key_expr), sample.payload.to_bytes())

        threading.Thread(target=listen, name="subscription", daemon=True).start()
        return lambda: _undeclare(subscriber)

    # Acting.

    def put(self, key: str, message: Any, qos: Qos) -> None:
        """Sends a message that nobody answers."""
        self._check_open()
        try:
            self.session.put(
                key,
                wire.write(message),
                encoding=zenoh.Encoding.APPLICATION_JSON,
                congestion_control=qos.congestion,
                priority=qos.priority,
                express=True,
            )
        except zenoh.ZError as error:
            raise FleetError("failed", f"put on {key}: {_words(error)}") from None

    def request(self, robot: str, body: Body, lease: Lease | None = None, request_id: str | None = None) -> Done:
        """Asks a robot for something; again with the same id while nobody answers."""
        reply = self.replies(robot, body, lease, request_id)[0]
        result = reply["result"]
        if "error" in result:
            raise refused(robot, result["error"])
        nothing: Done = {"lease": None, "goal": None}
        return result.get("ok", nothing)

    def replies(
        self,
        robot: str,
        body: Body,
        lease: Lease | None = None,
        request_id: str | None = None,
        linger: float = 0.0,
    ) -> list[Reply]:
        """At least one reply; more if others answer in the robot's name within `linger` of the first."""
        self.settings.may("control robots")
        self._check_open()
        key = self.keys.cmd(robot)
        request_id = request_id or str(uuid.uuid4())
        message: Request = {"id": request_id, "lease": lease, "body": body}
        asking, replies = Asking(self), list[Reply]()
        patience = self.patience
        began = time.monotonic()
        give_up, next_ask = began + patience, began
        again = ACQUIRE_AGAIN_S if "acquire" in body else self.round_trip.ask_again()
        asked = turned_away = 0
        sent_at = began
        while (now := time.monotonic()) < give_up:
            if now >= next_ask and not replies:
                if asking.open < IN_FLIGHT:
                    asking.ask(key, give_up - now, message, COMMAND)
                    asked, sent_at = asked + 1, now
                next_ask = now + again
            before = asking.open
            news = asking.next(min(next_ask, give_up) - now)
            if news is None:
                if replies:
                    break
                if asking.open < before:  # nobody where the question went: soon again
                    next_ask = min(next_ask, time.monotonic() + ASK_AGAIN_S / 5)
                continue
            reply = _reply(news, key, request_id)
            if reply is None:
                continue
            if reply["result"].get("error", {}).get("code") == "overloaded":
                turned_away += 1
                next_ask = min(next_ask, time.monotonic() + ASK_AGAIN_S / 5)
                continue
            replies.append(reply)
            if linger <= 0:
                self.round_trip.measured(news.at - began)
                return replies
            give_up = min(give_up, time.monotonic() + linger)
            next_ask = give_up
        if replies:
            return replies
        fleet, waited = self.settings.fleet, f"{patience:.1f} s"
        if turned_away:
            how = f"is overloaded (it rejected {turned_away} of {asked} requests in {waited})"
            hint = "too many requests from clients: end some clients, or wait longer with timeout_s"
        else:
            how = f"does not answer ({asked} requests in {waited})"
            hint = "`fleet.robots()` shows the robots present"
        words = f"{robot} of fleet {fleet} {how}: outcome unknown"
        raise self.explained(OutcomeUnknown("outcome_unknown", words, hint))

    def explained(self, error: FleetError) -> FleetError:
        """The reason why nobody has answered, if it is the router that does not admit this identity."""
        own = self.settings.identity
        if own is None:
            return error
        for answer in self._get(f"xtb/{self.settings.fleet}/identity/{own.name}", 0.5):
            try:
                status = wire.read("IdentityStatus", answer.payload)
            except Malformed:
                continue
            if status["name"] != own.name:
                continue
            why = None
            if status["role"] is None:
                why = f"the router does not know {own.name}"
            elif status["revoked"]:
                why = f"{own.name} was revoked"
            elif status["generation"] != own.generation:
                why = f"the router admits certificate {status['generation']} of {own.name}, this is {own.generation}"
            elif status["role"] != own.role:
                why = f"{own.name} has the role {status['role']} to the router, and {own.role} by its identity here"
            if why:
                return NotAllowed("not_admitted", why, "enrol with the newest file of `fleet-cli pki`")
        return error

    def _check_open(self) -> None:
        if self.is_closed:
            raise Invalid("usage", "the connection to the fleet was closed", "open another with `Fleet.connect`")


def refused(robot: str, error: ErrorBody) -> Refused:
    """A robot's refusal."""
    words = error["message"]
    message = f"{robot} is {words}" if words.startswith("controlled by ") else f"{robot} refuses: {words}"
    kind = LeaseLost if error["code"] == "lease_lost" else Refused
    return kind(error["code"], message, error["hint"])


def _reply(answer: Answer, key: str, request_id: str) -> Reply | None:
    """A robot's reply to this request, or to one that could not be read."""
    if answer.key != key:
        return None
    try:
        reply = cast(Reply, wire.read("Reply", answer.payload))
    except Malformed:
        return None
    ours = reply["id"] in (request_id, str(uuid.UUID(int=0)))
    return reply if ours and ("ok" in reply["result"]) != ("error" in reply["result"]) else None


def _undeclare(subscriber: Any) -> None:
    try:
        subscriber.undeclare()
    except zenoh.ZError:
        pass  # the session has ended


def _words(error: Exception) -> str:
    """What Zenoh says, without the places in its source where it says it."""
    text = str(error).partition('msg: "')[2] or str(error)
    return wire.escaped(text.split(" at /")[0].rstrip("."))


def _options(settings: Settings) -> dict[str, Any]:
    """Zenoh's settings, those of a client of this project (core/bus: session.rs and tls.rs)."""
    options: dict[str, Any] = {
        "mode": "client",
        "connect/endpoints": list(settings.endpoints),
        "connect/timeout_ms": 0,
        "connect/retry": {"period_init_ms": 200, "period_max_ms": 1000},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": LINK_LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        "transport/link/rx/max_message_size": MOST_BYTES,
        "listen/endpoints": [],
    }
    if own := settings.identity:
        tls = "transport/link/tls"
        options |= {
            f"{tls}/root_ca_certificate": str(own.file("ca.pem")),
            f"{tls}/enable_mtls": True,
            f"{tls}/verify_name_on_connect": True,
            f"{tls}/close_link_on_expiration": True,
            f"{tls}/connect_certificate": str(own.file("certificate.pem")),
            f"{tls}/connect_private_key": str(own.file("key.pem")),
            "adminspace/enabled": False,
        }
    return options


def _open(settings: Settings) -> zenoh.Session:
    """Tries again until it stands or the time is up."""
    until, pause, reason = time.monotonic() + settings.timeout_s, 0.2, ""
    while True:
        config = zenoh.Config()
        for name, value in _options(settings).items():
            try:
                config.insert_json5(name, json.dumps(value))  # type: ignore[no-untyped-call,unused-ignore]
            except zenoh.ZError as error:
                message = f"Zenoh rejects the setting {name} = {json.dumps(value)}: {_words(error)}"
                raise Invalid("usage", message, "an endpoint looks like tcp/192.168.1.10:7447") from None
        try:
            return zenoh.open(config)
        except zenoh.ZError as error:
            reason = _words(error)
        if time.monotonic() + pause > until:
            where = ", ".join(settings.endpoints)
            hint = "start `fleet-cli router` or `fleet-cli sim`; `fleet-cli doctor` looks for the cause"
            raise NotThere("no_router", f"no router at {where}: {reason}", hint)
        time.sleep(pause)
        pause = min(pause * 2, 1.0)
