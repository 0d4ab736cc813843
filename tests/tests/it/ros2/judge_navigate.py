"""judge_navigate.py ENDPOINT ROBOT reach|cancel|preempt|refuse|long X Y: does a foreign client's goal get its way?

The services of `navigate_to_pose` are called with zenoh-ros2-sdk's client, feedback is heard with its subscriber, the
latched status with zenoh-ext's AdvancedSubscriber; CDR and the services' hashes are rosbags'. The robot needs a map and
2 m of free floor ahead of it. First it is told on `initialpose` that it stands where it believes to. Prints what was
observed as one line with "ok".

  reach    a goal 1.2 m ahead: accepted, feedback, result 4 (SUCCEEDED) not before it is there
  cancel   cancelled on the way: result 5 (CANCELED), and it stands
  preempt  another goal on the way: the first one ends with 6 (ABORTED) and a text, the second one is reached
  refuse   a goal in the frame odom, one 5 km away, one without an orientation, one with the id of another: not accepted
  long    a goal at X Y that takes longer than 90 s (of a real clock): feedback all the way, result 4
"""

import math
import sys
import threading
import time
import uuid
from typing import Any

import numpy
from judge import CANCEL_GOAL, FEEDBACK, GET_RESULT, SEND_GOAL, Diagnostics, Odometry, Robot, finish, until

ACTION = "navigate_to_pose/_action"
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6
# How exactly it arrives: the settings' 0.1 m and some for the odometry.
NEAR_M = 0.2
robot = Robot(sys.argv[1], sys.argv[2])
odometry, diagnostics = Odometry(robot), Diagnostics(robot)
frames: dict[str, Any] = {}
feedback: list[Any] = []
statuses: dict[bytes, list[int]] = {}


def transforms(message: Any) -> None:
    frames.update({it.child_frame_id: it.transform for it in message.transforms})


def status(message: Any, _: bytes) -> None:
    for it in message.status_list:
        known = statuses.setdefault(bytes(it.goal_info.goal_id.uuid), [])
        if not known or known[-1] != it.status:
            known.append(int(it.status))


robot.subscribe("/tf", "tf2_msgs/msg/TFMessage", transforms)
robot.subscribe(robot.named(f"{ACTION}/feedback"), FEEDBACK, feedback.append)
robot.subscribe_latched(robot.named(f"{ACTION}/status"), "action_msgs/msg/GoalStatusArray", status)


def yaw(q: Any) -> float:
    return math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def place() -> tuple[float, float, float]:
    """Where base_link is in the map: tf's two transforms, one after the other."""
    a, b = frames[f"{robot.frame}/odom"], frames[f"{robot.frame}/base_link"]
    turn, at = yaw(a.rotation), b.translation
    return (a.translation.x + math.cos(turn) * at.x - math.sin(turn) * at.y,
            a.translation.y + math.sin(turn) * at.x + math.cos(turn) * at.y, turn + yaw(b.rotation))


def ahead(metres: float) -> tuple[float, float, float]:
    x, y, heading = place()
    return x + metres * math.cos(heading), y + metres * math.sin(heading), heading


def goal_id(of: bytes) -> Any:
    return robot.type("unique_identifier_msgs/msg/UUID")(uuid=numpy.frombuffer(of, dtype=numpy.uint8))


def stamp(ns: int = 0) -> Any:
    return robot.type("builtin_interfaces/msg/Time")(sec=ns // 10**9, nanosec=ns % 10**9)


class Goal:
    """A goal with its client; `result` is there once the robot has answered get_result."""

    def __init__(self, to: tuple[float, float, float], frame: str = "map", rotation: bool = True,
                 of: bytes | None = None) -> None:
        self.id = of or uuid.uuid4().bytes
        self.result: Any = None
        self.ended = 0.0
        pose, header = robot.type("geometry_msgs/msg/Pose"), robot.type("std_msgs/msg/Header")
        point, turn = robot.type("geometry_msgs/msg/Point"), robot.type("geometry_msgs/msg/Quaternion")
        half = to[2] / 2.0
        q = turn(x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)) if rotation else turn(x=0.0, y=0.0, z=0.0, w=0.0)
        where = pose(position=point(x=to[0], y=to[1], z=0.0), orientation=q)
        whole = robot.type("geometry_msgs/msg/PoseStamped")(
            header=header(stamp=stamp(time.time_ns()), frame_id=frame), pose=where)
        goal = robot.type("nav2_msgs/action/NavigateToPose_Goal")(pose=whole, behavior_tree="")
        # Kept: a robot ends the goal of a client that is gone.
        self.client = robot.client(f"{ACTION}/send_goal", SEND_GOAL)
        self.answer = self.client.call(goal_id=goal_id(self.id), goal=goal)
        self.accepted = bool(self.answer and self.answer.accepted)
        if self.accepted:
            threading.Thread(target=self._wait, daemon=True).start()

    def _wait(self) -> None:
        self.result = robot.client(f"{ACTION}/get_result", GET_RESULT, 600.0).call(goal_id=goal_id(self.id))
        self.ended = time.monotonic()

    def cancel(self) -> int | None:
        """The return code: 0 = the goal is being cancelled."""
        info = robot.type("action_msgs/msg/GoalInfo")(goal_id=goal_id(self.id), stamp=stamp())
        answer = robot.client(f"{ACTION}/cancel_goal", CANCEL_GOAL).call(goal_info=info)
        ids = [bytes(it.goal_id.uuid) for it in answer.goals_canceling] if answer else []
        return answer.return_code if answer and (answer.return_code or ids == [self.id]) else None

    def end(self, timeout_s: float = 60.0) -> dict[str, Any]:
        """Waits for the result."""
        until(lambda: self.result is not None, timeout_s)
        time.sleep(0.3)
        result = self.result
        own = [it.feedback for it in feedback if bytes(it.goal_id.uuid) == self.id]
        return {"accepted": self.accepted, "statuses": statuses.get(self.id, []), "feedback": len(own),
                "distances_m": [round(it.distance_remaining, 2) for it in own[:: max(1, len(own) // 5)]],
                "frames": sorted({it.current_pose.header.frame_id for it in own}),
                "result": result and [int(result.status), int(result.result.error_code), result.result.error_msg]}


def certain() -> bool:
    """Tells it where it stands, as RViz does; whether it has taken that: its place is as told."""
    x, y, heading = place()
    to = x + 0.01, y, heading
    header, point = robot.type("std_msgs/msg/Header"), robot.type("geometry_msgs/msg/Point")
    turn, pose = robot.type("geometry_msgs/msg/Quaternion"), robot.type("geometry_msgs/msg/Pose")
    covariance = numpy.zeros(36)
    covariance[[0, 7, 35]] = 0.25, 0.25, 0.068
    where = pose(position=point(x=to[0], y=to[1], z=0.0),
                 orientation=turn(x=0.0, y=0.0, z=math.sin(heading / 2.0), w=math.cos(heading / 2.0)))
    publisher = robot.publisher("initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped")
    publisher.publish(
        header=header(stamp=stamp(time.time_ns()), frame_id="map"),
        pose=robot.type("geometry_msgs/msg/PoseWithCovariance")(pose=where, covariance=covariance))
    return until(lambda: off_m(to) < 0.003, 3.0)


def off_m(to: tuple[float, float, float]) -> float:
    return round(math.dist(place()[:2], to[:2]), 3)


def under_way() -> bool:
    return until(lambda: odometry.speed_mps() > 0.05, 15.0)


def reach() -> dict[str, Any]:
    to = ahead(1.2)
    goal = Goal(to)
    moved = under_way()
    waited = goal.result is None
    said = goal.end()
    late = Goal(ahead(0.5), of=goal.id)  # an id that is taken
    distances = said["distances_m"]
    ok = (said["result"] or [0])[0] == SUCCEEDED and moved and waited and off_m(to) < NEAR_M and said["feedback"] > 5
    # From the first feedback on: a client may end by it.
    ok = ok and said["frames"] == ["map"] and distances[0] > 1.0 > distances[-1] and not late.accepted
    ok = ok and said["statuses"][-1] == SUCCEEDED and said["result"][1] == 0
    again = robot.client(f"{ACTION}/get_result", GET_RESULT).call(goal_id=goal_id(goal.id))
    return {"ok": ok and again.status == SUCCEEDED, "moved": moved, "result_waited": waited, "off_m": off_m(to),
            "same_id_accepted": late.accepted, **said}


def cancel() -> dict[str, Any]:
    goal = Goal(ahead(1.5))
    moved = under_way()
    code = goal.cancel()
    said = goal.end(10.0)
    stood = until(lambda: abs(odometry.speed_mps()) < 0.005, 3.0)
    again = goal.cancel()  # 3 = it has ended already
    ok = moved and code == 0 and stood and (said["result"] or [0])[0] == CANCELED and again == 3
    return {"ok": ok and said["statuses"][-1] == CANCELED, "moved": moved, "code": code, "again": again,
            "stood": stood, **said}


def preempt() -> dict[str, Any]:
    to = ahead(0.9)
    first = Goal(ahead(1.5))
    moved = under_way()
    second = Goal(to)
    said, then = first.end(5.0), second.end()
    result = said["result"] or [0, 0, ""]
    ok = moved and result[0] == ABORTED and result[1] != 0 and result[2] != ""
    ok = ok and (then["result"] or [0])[0] == SUCCEEDED and off_m(to) < NEAR_M
    return {"ok": ok, "moved": moved, "first": said, "second": then, "off_m": off_m(to)}


def refuse() -> dict[str, Any]:
    near = ahead(1.0)
    goals = {"frame odom": Goal(near, frame="odom"), "5 km": Goal((5000.0, 0.0, 0.0)),
             "no orientation": Goal(near, rotation=False), "not finite": Goal((math.nan, 0.0, 0.0)),
             "no id": Goal(near, of=bytes(16))}
    began = time.monotonic()
    time.sleep(1.5)
    moved_m = odometry.moved_m(began)
    unknown = robot.client(f"{ACTION}/get_result", GET_RESULT).call(goal_id=goal_id(uuid.uuid4().bytes))
    accepted = {name: goal.answer and bool(goal.answer.accepted) for name, goal in goals.items()}
    ok = all(it is False for it in accepted.values()) and moved_m < 0.01
    return {"ok": ok and unknown is not None, "accepted": accepted, "moved_m": round(moved_m, 4),
            "unknown_goal": unknown and [int(unknown.status), unknown.result.error_msg]}


def long() -> dict[str, Any]:
    to = float(sys.argv[4]), float(sys.argv[5]), 0.0
    began = time.monotonic()
    goal, came, gap_s = Goal(to), began, 0.0
    while goal.accepted and goal.result is None and time.monotonic() < began + 600.0:
        known = len(feedback)
        until(lambda: len(feedback) > known or goal.result is not None, 10.0)
        came, gap_s = time.monotonic(), max(gap_s, time.monotonic() - came)
    took_s, said = time.monotonic() - began, goal.end(1.0)
    ok = (said["result"] or [0])[0] == SUCCEEDED and took_s > 90.0 and gap_s < 2.0 and off_m(to) < NEAR_M
    return {"ok": ok, "took_s": round(took_s, 1), "longest_gap_s": round(gap_s, 2), "off_m": off_m(to), **said}


needed = {f"{robot.frame}/odom", f"{robot.frame}/base_link"}
if not until(lambda: odometry.came.is_set() and needed <= set(frames), 10.0):
    finish({"ok": False, "problem": "no odometry, or no transforms"})
if not certain():
    finish({"ok": False, "problem": "initialpose is not taken", "said": sorted(diagnostics.said.get("refused", []))})
scenarios = {"reach": reach, "cancel": cancel, "preempt": preempt, "refuse": refuse, "long": long}
finish(scenarios[sys.argv[3]]())
