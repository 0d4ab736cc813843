"""judge_drive.py ENDPOINT ROBOT drive|kill|burst|second|estop: does a foreign cmd_vel drive, and only when it may?

Commands are zenoh-ros2-sdk's (TwistStamped, 10 Hz), the odometry too; held-up samples are plain Zenoh puts with CDR of
rosbags and attachments by hand. Prints what was observed as one line with "ok"; `kill` prints `driving` once it does,
and goes on until it is killed.

  drive   0.3 m/s for 3 s, then zero: it moves about as far as that
  burst   on time for 2 s, then 2 s of samples that are held back and sent at once: it does not move. Again with 0.7 s,
          within which the lease is not yet free
  second  a second node drives the other way: it is not followed, and /diagnostics names it
  estop   stops at once, and after `reset` only once the stick was let go
"""

import re
import sys
import threading
import time
import uuid
from typing import Any

from judge import Diagnostics, Odometry, Robot, attachment, finish, gid_of, until
from zenoh_ros2_sdk import ROS2Publisher
from zenoh_ros2_sdk.entity import EndpointEntity, EntityKind, NodeEntity
from zenoh_ros2_sdk.keyexpr import endpoint_liveliness_keyexpr

STAMPED = "geometry_msgs/msg/TwistStamped"
PERIOD_S = 0.1
# A robot that stands moves by no more than this: odometry's noise.
STANDS_M = 0.01
robot = Robot(sys.argv[1], sys.argv[2])
scenario = sys.argv[3]
odometry, diagnostics = Odometry(robot), Diagnostics(robot)


def velocity(mps: float, made_ns: int) -> Any:
    """A TwistStamped; who makes it stamps it."""
    vector, frame = robot.type("geometry_msgs/msg/Vector3"), f"{robot.frame}/base_link"
    ahead, turning = vector(x=mps, y=0.0, z=0.0), vector(x=0.0, y=0.0, z=0.0)
    twist = robot.type("geometry_msgs/msg/Twist")(linear=ahead, angular=turning)
    stamp = robot.type("builtin_interfaces/msg/Time")(sec=made_ns // 10**9, nanosec=made_ns % 10**9)
    return {"header": robot.type("std_msgs/msg/Header")(stamp=stamp, frame_id=frame), "twist": twist}


class Stick:
    """A node of its own that publishes a velocity ten times a second, while one is set."""

    def __init__(self, name: str) -> None:
        self.mps: float | None = None
        self.publisher = robot.publisher("cmd_vel", STAMPED, node_name=name)
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self) -> None:
        due = time.monotonic()
        while True:
            if (mps := self.mps) is not None:
                self.publisher.publish(**velocity(mps, time.time_ns()))
            due += PERIOD_S
            time.sleep(max(0.0, due - time.monotonic()))


def token_of(publisher: ROS2Publisher) -> str:
    """The token that the SDK has declared for it."""
    node = NodeEntity(publisher.domain_id, publisher.session_mgr.session_id, publisher.node_id, publisher.node_name,
                      publisher.namespace)
    return endpoint_liveliness_keyexpr(EndpointEntity(node, publisher.entity_id, EntityKind.PUBLISHER, publisher.topic,
                                                      publisher.dds_type_name, publisher.type_hash, publisher.qos))


def moves(seconds: float) -> float:
    """How far it goes in that time."""
    began = time.monotonic()
    time.sleep(seconds)
    return round(odometry.moved_m(began), 4)


def stands() -> bool:
    """Waits until it does: the wheels coast after the motor is neutral."""
    return until(lambda: abs(odometry.speed_mps()) < 0.005, 3.0)


def received(what: str) -> int:
    """How many commands were `what`, by /diagnostics: "fresh 1, on trial 2, late 3, …"."""
    found = re.search(rf"{what} (\d+)", diagnostics.latest.get("cmd_vel received", ""))
    return int(found.group(1)) if found else 0


def drive() -> dict[str, Any]:
    stick, began = Stick("judge_drive"), time.monotonic()
    stick.mps = 0.3
    time.sleep(3.0)
    top_mps = max(pose[3] for pose in odometry.since(began))
    stick.mps = 0.0
    stood = stands()
    moved_m = odometry.moved_m(began)
    # 0.5 m on a computer with time to spare; not more than 0.3 m/s and what it coasts.
    ok = stood and 0.35 < moved_m < 1.1 and moves(1.0) < STANDS_M
    return {"ok": ok, "moved_m": round(moved_m, 3), "top_mps": round(top_mps, 3), "stood": stood,
            "notice": sorted(diagnostics.said.get("cmd_vel", [])),
            "in_control": sorted(diagnostics.said.get("ROS node in control", []))}


def kill() -> dict[str, Any]:
    stick = Stick("judge_kill")
    stick.mps = 0.3
    if not until(lambda: odometry.speed_mps() > 0.05, 5.0):
        return {"ok": False, "speed_mps": odometry.speed_mps()}
    print("driving", flush=True)
    while True:
        time.sleep(1.0)


def burst() -> dict[str, Any]:
    key = robot.key(robot.named("cmd_vel"), STAMPED)
    verdict: dict[str, Any] = {"ok": True}
    for held_s in (2.0, 0.7):
        gid, sequence = uuid.uuid4().bytes, 0
        publisher = robot.zenoh.declare_publisher(key)

        def sample(gid: bytes = gid) -> tuple[bytes, bytes]:
            nonlocal sequence
            sequence += 1
            made_ns = time.time_ns()
            message = robot.type(STAMPED)(**velocity(0.3, made_ns))
            return bytes(robot.sdk.store.serialize_cdr(message, STAMPED)), attachment(sequence, made_ns, gid)

        began = time.monotonic()
        for _ in range(20):
            payload, attached = sample()
            publisher.put(payload, attachment=attached)
            time.sleep(PERIOD_S)
        before_m, held, late = odometry.moved_m(began), [], received("late")
        for _ in range(round(held_s / PERIOD_S)):
            held.append(sample())
            time.sleep(PERIOD_S)
        speed_mps, sent = odometry.speed_mps(), time.monotonic()
        for payload, attached in held:
            publisher.put(payload, attachment=attached)
        time.sleep(2.0)
        after = odometry.since(sent)
        # After 0.7 s it may still coast; then it must not become faster.
        faster_mps = max((pose[3] for pose in after), default=9.0) - speed_mps
        moved_m = odometry.moved_m(sent)
        dropped = received("late") > late  # /diagnostics counts them
        ok = dropped and before_m > 0.2 and faster_mps < 0.02 and moved_m < (STANDS_M if held_s > 1.0 else 0.05)
        verdict["ok"] &= ok
        verdict[f"held {held_s} s"] = {"ok": ok, "before_m": round(before_m, 3), "speed_then_mps": round(speed_mps, 3),
                                       "faster_mps": round(faster_mps, 3), "moved_m": round(moved_m, 4),
                                       "samples": len(held), "late": received("late") - late}
        publisher.undeclare()
    return verdict


def second() -> dict[str, Any]:
    first, other = Stick("judge_first"), Stick("judge_second")
    # The first keeps the SDK's gid, which says nothing of its node; the second has that of its token, as rmw_zenoh.
    other.publisher.publisher_gid = gid_of(token_of(other.publisher))
    first.mps = 0.2
    drove = until(lambda: odometry.speed_mps() > 0.05, 5.0)
    other.mps = -0.3
    began = time.monotonic()
    time.sleep(3.0)
    speeds = [pose[3] for pose in odometry.since(began)]
    fenced = sorted(diagnostics.said.get("fenced cmd_vel", []))
    # The first leaves: the second, whose stick is held, does not take over.
    first.mps = 0.0
    time.sleep(0.3)
    first.publisher.close()
    first.mps = None
    stood = stands()
    held_m = moves(2.5)
    other.mps = 0.0
    time.sleep(0.3)
    other.mps = 0.2
    let_go = until(lambda: odometry.speed_mps() > 0.05, 3.0)
    other.mps = 0.0
    stands()
    named = any("/judge_second" in it for it in fenced)
    ok = drove and named and min(speeds) > -0.01 and stood and held_m < STANDS_M and let_go
    return {"ok": ok, "first_drove": drove, "slowest_mps": round(min(speeds), 3), "fenced": fenced,
            "held_stick_moved_m": held_m, "drives_after_letting_go": let_go,
            "said": sorted(diagnostics.said.get("cmd_vel that has to let go", []))}


def estop() -> dict[str, Any]:
    stick = Stick("judge_estop")
    stick.mps = 0.2
    drove = until(lambda: odometry.speed_mps() > 0.05, 5.0)
    called = time.monotonic()
    answer = robot.trigger("estop")
    answered_s = time.monotonic() - called
    stood = stands()
    stood_s, coasted_m = time.monotonic() - called, odometry.moved_m(called)
    latched_m = moves(2.0)
    reset = robot.trigger("reset")
    reset_m = moves(2.0)
    stick.mps = 0.0
    time.sleep(0.3)
    stick.mps = 0.2
    before = diagnostics.latest.get("cmd_vel received")
    let_go = until(lambda: odometry.speed_mps() > 0.05, 3.0)
    stick.mps = 0.0
    stands()
    ok = drove and bool(answer.get("success")) and bool(reset.get("success")) and stood and let_go and coasted_m < 0.3
    return {"ok": ok and max(latched_m, reset_m) < STANDS_M, "drove": drove, "estop": answer, "reset": reset,
            "answered_s": round(answered_s, 3), "stood_s": round(stood_s, 3), "coasted_m": round(coasted_m, 3),
            "latched_moved_m": latched_m, "after_reset_moved_m": reset_m, "drives_after_letting_go": let_go,
            "received": [before, diagnostics.latest.get("cmd_vel received")],
            "has_to_let_go": diagnostics.latest.get("cmd_vel that has to let go")}


if not odometry.came.wait(10.0):
    finish({"ok": False, "problem": "no odometry"})
scenarios = {"drive": drive, "kill": kill, "burst": burst, "second": second, "estop": estop}
finish(scenarios[scenario]())
