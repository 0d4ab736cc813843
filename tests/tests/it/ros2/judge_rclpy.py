"""judge_rclpy.py ENDPOINT ROBOT: does ROS 2's genuine type support read what a robot publishes and answers?

Plain Zenoh carries it (`pip install eclipse-zenoh`), rclpy's type support decodes and encodes it again (the wheels
`ros-kilted-rclpy`, `ros-kilted-rmw-fastrtps-cpp` and those of the packages, or Jazzy's); ROS_DOMAIN_ID counts.
tf2_msgs and nav2_msgs have no wheels. The fleet needs a map, such as with `sim --ros2 --world worlds/lab.toml`. Hears everything for 5 s, then calls `stop`, `reset` and the action's
`cancel_goal`. Prints one line: {"ok", "problems", "types": {name: count}}.
"""

import importlib
import json
import os
import struct
import sys
import time
from collections import Counter, defaultdict

import zenoh
import zenoh.ext
from rclpy.serialization import deserialize_message, serialize_message

NO_WHEEL = {"tf2_msgs", "nav2_msgs"}
EXPECTED = {
    "nav_msgs/msg/Odometry", "nav_msgs/msg/OccupancyGrid", "sensor_msgs/msg/Imu",
    "sensor_msgs/msg/Range", "sensor_msgs/msg/BatteryState", "diagnostic_msgs/msg/DiagnosticArray",
    "std_msgs/msg/String", "action_msgs/msg/GoalStatusArray", "std_srvs/srv/Trigger_Response",
    "action_msgs/srv/CancelGoal_Response",
}  # fmt: skip
endpoint, name = sys.argv[1], sys.argv[2].replace("-", "_")
domain = os.environ.get("ROS_DOMAIN_ID", "0")
problems: set[str] = set()
counts: Counter[str] = Counter()
latest: dict[str, object] = {}


def decode(bytes_: bytes, type_name: str) -> object:
    """Judges one message: it is decoded, and survives being encoded and decoded again."""
    package, kind, bare = type_name.split("/")
    if package in NO_WHEEL:
        return None
    bare, _, part = bare.partition("_")
    class_ = getattr(importlib.import_module(f"{package}.{kind}"), bare)
    class_ = getattr(class_, part) if part else class_
    message = deserialize_message(bytes_, class_)
    again = deserialize_message(serialize_message(message), class_)
    if str(again) != str(message):  # NaN is not equal to itself
        problems.add(f"{type_name}: {again} is not {message}")
    counts[type_name] += 1
    return message


def hear(sample: zenoh.Sample) -> None:
    _, *topic, dds, _hash = str(sample.key_expr).split("/@adv")[0].split("/")
    type_name = dds.replace("::dds_::", "::").removesuffix("_").replace("::", "/")
    try:
        latest["/".join(topic)] = decode(sample.payload.to_bytes(), type_name)
    except Exception as error:  # noqa: BLE001
        problems.add(f"{type_name}: {error}")
    attached = sample.attachment.to_bytes() if sample.attachment else b""
    if len(attached) != 33:
        problems.add(f"{type_name}: attachment of {len(attached)} bytes")


def call(session: zenoh.Session, service: str, type_name: str) -> object:
    """With a request that the genuine type support has made, padded as it is."""
    package, kind, bare = type_name.split("/")
    request = serialize_message(getattr(importlib.import_module(f"{package}.{kind}"), bare).Request())
    attachment = struct.pack("<qqB", 1, time.time_ns(), 16) + bytes(range(16))
    dds = f"{package}::{kind}::dds_::{bare}_"
    key = f"{domain}/{name}/{service}/{dds}/*"
    for reply in session.get(key, payload=request, attachment=attachment, timeout=5.0):
        if reply.ok:
            return decode(reply.ok.payload.to_bytes(), f"{type_name}_Response")
        problems.add(f"{service}: {reply.err.payload.to_bytes()!r}")
    problems.add(f"{service} does not answer")
    return None


config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)  # of what is latched
kept = zenoh.ext.declare_advanced_subscriber(session, f"{domain}/**", hear, history=history)
time.sleep(5.0)
verdicts: dict[str, object] = defaultdict(object)
for service in ("stop", "reset"):
    answer = call(session, service, "std_srvs/srv/Trigger")
    verdicts[service] = answer and [answer.success, answer.message]
cancelled = call(session, "navigate_to_pose/_action/cancel_goal", "action_msgs/srv/CancelGoal")
verdicts["cancel_goal"] = cancelled and [cancelled.return_code, len(cancelled.goals_canceling)]
if missing := EXPECTED - set(counts):
    problems.add(f"missing {sorted(missing)}")
odometry = latest.get(f"{name}/odom")
if odometry is None or odometry.child_frame_id != f"{name}/base_link":
    problems.add(f"odometry {odometry}")
print(json.dumps({"ok": not problems, "problems": sorted(problems), "types": counts, "answers": verdicts}), flush=True)
os._exit(bool(problems))
