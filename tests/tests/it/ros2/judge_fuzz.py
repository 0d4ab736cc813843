"""judge_fuzz.py ENDPOINT ROBOT [SEED [ROUNDS]]: does a robot take rubbish without moving, and go on?

Sends by plain Zenoh, to each topic that it hears and each service that it serves, payloads that are random, cut off,
bent or too long (CDR of rosbags) with attachments of 0 to 80 random bytes, proper ones and none. Nothing of it is a
proper goal or pose (those are in the frame `odom`), nor two proper velocities of one publisher. Some questions to
services of type Trigger are proper: a latched emergency stop is reset at the end. After each round zenoh-ros2-sdk
calls `stop`; at the end its cmd_vel drives. Prints counts and "ok".
"""

import random
import sys
import time
from collections import Counter
from typing import Any

import numpy
from judge import TRIGGER, Diagnostics, Odometry, Robot, attachment, finish, offered, until

robot = Robot(sys.argv[1], sys.argv[2])
seed = int(sys.argv[3]) if len(sys.argv) > 3 else 1
rounds = int(sys.argv[4]) if len(sys.argv) > 4 else 20
dice = random.Random(seed)
odometry, diagnostics = Odometry(robot), Diagnostics(robot)
channels = [channel for channel in offered(robot.namespace) if channel.kind in ("MS", "SS")]
keys = {channel: robot.key(channel.name, channel.type) for channel in channels}
counts: Counter[str] = Counter()


def proper(type_name: str) -> bytes:
    """A message of this type, of zeros but for frames, quaternions and velocities."""
    store = robot.sdk.store

    def value(name: str) -> Any:
        fields = {}
        for field, (node, of) in store.fielddefs[name][1]:
            kind = node.name
            if kind == "NAME":
                fields[field] = value(of)
            elif kind == "BASE":
                fields[field] = {"string": "odom", "bool": False}.get(of[0], 1 if of[0].startswith("float") else 0)
            else:
                fields[field] = numpy.zeros(of[1], dtype=of[0][1][0]) if kind == "ARRAY" else []
        if not fields:
            fields = {"structure_needs_at_least_one_member": 0}
        return store.types[name](**fields)

    return bytes(store.serialize_cdr(value(type_name), type_name))


def messages() -> dict[Any, bytes]:
    found = {}
    for channel in channels:
        if channel.kind == "MS":
            robot.type(channel.type)
            found[channel] = proper(channel.type)
        else:
            client = robot.client(channel.name.removeprefix(f"{robot.namespace}/"), channel.type)
            found[channel] = proper(client.request_store_type)
            client.close()
    return found


def bent(of: bytes) -> tuple[str, bytes]:
    kind = dice.choice(("random", "cut", "bent", "long", "huge", "proper"))
    if kind == "random":
        return kind, dice.choice((b"", b"\0\1\0\0", b"\0\0\0\0")) + dice.randbytes(dice.randrange(200))
    if kind == "cut":
        return kind, of[: dice.randrange(len(of))]
    if kind == "bent":
        body = bytearray(of)
        for _ in range(dice.randrange(1, 9)):
            body[dice.randrange(len(body))] = dice.randrange(256)
        return kind, bytes(body)
    if kind == "long":
        return kind, of + dice.randbytes(dice.randrange(100))
    if kind == "huge":  # a string or a sequence as long as can be said
        return kind, of[:12] + b"\xff\xff\xff\xff" + dice.randbytes(dice.choice((0, 40, 100_000)))
    return kind, of


def attached() -> tuple[str, bytes | None]:
    kind = dice.choice(("none", "random", "random", "33", "proper", "proper"))
    made_ns = dice.choice((time.time_ns(), 0, -1, 2**63 - 1, -(2**63)))
    return kind, {
        "none": None,
        "random": dice.randbytes(dice.randrange(81)),
        "33": dice.randbytes(33),
        "proper": attachment(dice.randrange(-(2**63), 2**63), made_ns, dice.randbytes(16)),
    }[kind]


if not odometry.came.wait(10.0):
    finish({"ok": False, "problem": "no odometry"})
good = messages()
stop = robot.client("stop", TRIGGER)
slow_s = 0.0
began = time.monotonic()
for _ in range(rounds):
    for channel in channels:
        for _ in range(10):
            (what, payload), (how, with_) = bent(good[channel]), attached()
            counts[f"payload {what}"] += 1
            counts[f"attachment {how}"] += 1
            if channel.kind == "MS":
                robot.zenoh.put(keys[channel], payload, attachment=with_)
                counts["messages"] += 1
                continue
            replies = robot.zenoh.get(keys[channel], payload=payload, attachment=with_, timeout=2.0)
            counts["questions"] += 1
            counts["answers"] += sum(reply.ok is not None for reply in replies)
    asked = time.monotonic()
    counts["stop answered"] += stop.call(structure_needs_at_least_one_member=0) is not None
    slow_s = max(slow_s, time.monotonic() - asked)
time.sleep(0.5)
moved_m, odometry_hz = odometry.moved_m(began), len(odometry.since(began)) / (time.monotonic() - began)

# It is as before: latches end, and a stick drives.
malformed = diagnostics.latest.get("malformed")
reset = robot.trigger("reset")
released = robot.trigger("release_control")
time.sleep(1.0)
publisher = robot.publisher("cmd_vel", "geometry_msgs/msg/Twist")
vector = robot.type("geometry_msgs/msg/Vector3")


def drives() -> bool:
    publisher.publish(linear=vector(x=0.2, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
    time.sleep(0.1)
    return odometry.speed_mps() > 0.05


driven = until(drives, 5.0)
publisher.publish(linear=vector(x=0.0, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0))
time.sleep(0.3)
ok = moved_m < 0.02 and counts["stop answered"] == rounds and odometry_hz > 10 and driven and bool(reset.get("success"))
finish({"ok": ok, "seed": seed, "moved_m": round(moved_m, 4), "odometry_hz": round(odometry_hz, 1), "driven": driven,
        "slowest_stop_s": round(slow_s, 3), "reset": reset, "released": released, "malformed": malformed,
        "overloaded": diagnostics.latest.get("overloaded"), "counts": dict(counts)})
