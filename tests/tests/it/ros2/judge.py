"""What the judges of a robot's ROS 2 side share: types, the table of what is offered, and the foreign session.

Foreign code: zenoh-ros2-sdk (session, discovery, hashes, publishers, subscribers, clients) and rosbags (CDR, the
definitions of the standard messages, the hashes of actions). Needs `pip install zenoh-ros2-sdk==0.1.8
rosbags==0.11.9 xxhash`; ROS_DOMAIN_ID counts. The SDK would clone missing definitions with git: they are written into
a temporary folder from rosbags' store instead, and the few that rosbags has not from the texts below.
"""

from __future__ import annotations

import json
import os
import shutil
import struct
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, NoReturn

import xxhash
import zenoh
import zenoh.ext
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceClient, ROS2Subscriber, ZenohSession, get_registry
from zenoh_ros2_sdk.keyexpr import topic_keyexpr
from zenoh_ros2_sdk.qos import QosDurability, QosProfile, QosReliability
from zenoh_ros2_sdk.utils import (
    compute_service_type_hash,
    get_type_hash,
    load_dependencies_recursive,
    resolve_domain_id,
    ros2_to_dds_type,
)

FOLDER = tempfile.mkdtemp(prefix="judge-")
# ROS hashes `char` as uint8 (rosidl_adapter), rosbags as char: of all definitions it matters in this one only.
EVENT_INFO = "service_msgs/msg/ServiceEventInfo"
EVENT_INFO_TEXT = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number"
STORE = get_typestore(Stores.EMPTY)
STORE.register(get_typestore(Stores.ROS2_KILTED).fielddefs | get_types_from_msg(EVENT_INFO_TEXT, EVENT_INFO))
# An empty request is one byte of this name to ROS; the SDK refuses a definition without fields.
NO_FIELDS = "uint8 structure_needs_at_least_one_member"
SERVICES: dict[str, tuple[str, str]] = {
    "std_srvs/srv/Trigger": (NO_FIELDS, "bool success\nstring message"),
    "action_msgs/srv/CancelGoal": (
        "action_msgs/GoalInfo goal_info",
        "int8 return_code\naction_msgs/GoalInfo[] goals_canceling",
    ),
    "nav2_msgs/action/NavigateToPose_SendGoal": (
        "unique_identifier_msgs/UUID goal_id\nnav2_msgs/action/NavigateToPose_Goal goal",
        "bool accepted\nbuiltin_interfaces/Time stamp",
    ),
    "nav2_msgs/action/NavigateToPose_GetResult": (
        "unique_identifier_msgs/UUID goal_id",
        "int8 status\nnav2_msgs/action/NavigateToPose_Result result",
    ),
}
MESSAGES: dict[str, str] = {
    "nav2_msgs/action/NavigateToPose_Goal": "geometry_msgs/PoseStamped pose\nstring behavior_tree",
    "nav2_msgs/action/NavigateToPose_Result": "uint16 error_code\nstring error_msg",
    "nav2_msgs/action/NavigateToPose_Feedback": "geometry_msgs/PoseStamped current_pose\n"
    "builtin_interfaces/Duration navigation_time\nbuiltin_interfaces/Duration estimated_time_remaining\n"
    "int16 number_of_recoveries\nfloat32 distance_remaining",
    "nav2_msgs/action/NavigateToPose_FeedbackMessage": "unique_identifier_msgs/UUID goal_id\n"
    "nav2_msgs/action/NavigateToPose_Feedback feedback",
}
TRIGGER = "std_srvs/srv/Trigger"
CANCEL_GOAL = "action_msgs/srv/CancelGoal"
SEND_GOAL = "nav2_msgs/action/NavigateToPose_SendGoal"
GET_RESULT = "nav2_msgs/action/NavigateToPose_GetResult"
FEEDBACK = "nav2_msgs/action/NavigateToPose_FeedbackMessage"

DEFAULT = QosProfile()
SENSOR = QosProfile(reliability=QosReliability.BEST_EFFORT, history_depth=5)
LATCHED = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
TF = QosProfile(history_depth=100)


@dataclass(frozen=True)
class Channel:
    """One endpoint of the robot: `kind` is MP (publishes), MS (hears) or SS (serves)."""

    kind: str
    name: str
    type: str
    qos: QosProfile = DEFAULT


def offered(namespace: str) -> Iterator[Channel]:
    """Everything that a robot offers and takes (the table of docs and core/ros2/src/offer.rs, written again)."""
    action = f"{namespace}/navigate_to_pose/_action"
    yield Channel("MP", f"{namespace}/odom", "nav_msgs/msg/Odometry")
    yield Channel("MP", "/tf", "tf2_msgs/msg/TFMessage", TF)
    yield Channel("MP", "/tf_static", "tf2_msgs/msg/TFMessage", LATCHED)
    yield Channel("MP", f"{namespace}/robot_description", "std_msgs/msg/String", LATCHED)
    yield Channel("MP", f"{namespace}/imu", "sensor_msgs/msg/Imu", SENSOR)
    for end in ("front", "rear"):
        for i in range(6):
            yield Channel("MP", f"{namespace}/range/{end}_{i}", "sensor_msgs/msg/Range", SENSOR)
    yield Channel("MP", f"{namespace}/battery_state", "sensor_msgs/msg/BatteryState")
    yield Channel("MP", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    yield Channel("MP", f"{namespace}/plan", "nav_msgs/msg/Path", LATCHED)
    yield Channel("MP", f"{action}/status", "action_msgs/msg/GoalStatusArray", LATCHED)
    yield Channel("MP", f"{action}/feedback", FEEDBACK)
    yield Channel("MS", f"{namespace}/cmd_vel", "geometry_msgs/msg/TwistStamped")
    yield Channel("MS", f"{namespace}/cmd_vel", "geometry_msgs/msg/Twist")
    yield Channel("MS", f"{namespace}/goal_pose", "geometry_msgs/msg/PoseStamped")
    yield Channel("MS", f"{namespace}/initialpose", "geometry_msgs/msg/PoseWithCovarianceStamped")
    for name in ("stop", "estop", "reset", "take_control", "release_control"):
        yield Channel("SS", f"{namespace}/{name}", TRIGGER)
    yield Channel("SS", f"{action}/send_goal", SEND_GOAL)
    yield Channel("SS", f"{action}/get_result", GET_RESULT)
    yield Channel("SS", f"{action}/cancel_goal", CANCEL_GOAL)


def type_hash(name: str) -> str:
    """By the SDK from the definitions; for an action's services by rosbags, as the SDK knows only /srv/."""
    registry = get_registry()
    if name in SERVICES and "/srv/" in name:
        request, response = SERVICES[name]
        needed = {}
        for part in SERVICES[name]:
            needed |= load_dependencies_recursive(name, part, registry)
        return compute_service_type_hash(name, request, response, needed)
    if name in SERVICES:
        return STORE.hash_rihs01(name)
    path = registry.get_msg_file_path(name)
    assert path, f"no definition of {name}"
    text = path.read_text()
    return get_type_hash(name, text, load_dependencies_recursive(name, text, registry))


class Robot:
    """A robot seen with foreign software. `endpoint` is the router's, such as tcp/127.0.0.1:7447."""

    def __init__(self, endpoint: str, robot: str) -> None:
        self.frame = robot.replace("-", "_")
        self.namespace = f"/{self.frame}"
        self.ip, port = endpoint.removeprefix("tcp/").rsplit(":", 1)
        self.port = int(port)
        self.at = {"router_ip": self.ip, "router_port": self.port}
        get_registry(str(definitions()))
        self.sdk = ZenohSession.get_instance(self.ip, self.port)
        self.zenoh = self.sdk.session
        self.domain = resolve_domain_id(None)
        self.kept: list[Any] = []
        for name in (*MESSAGES, "action_msgs/msg/GoalInfo"):  # what the SDK's client does not look for by itself
            self.type(name)

    def key(self, name: str, type_name: str) -> str:
        """The key that carries it."""
        return topic_keyexpr(self.domain, name, ros2_to_dds_type(type_name), type_hash(type_name))

    def named(self, name: str) -> str:
        """A name in the robot's namespace."""
        return f"{self.namespace}/{name}"

    def publisher(self, name: str, type_name: str, **more: Any) -> ROS2Publisher:
        """Of a topic in the robot's namespace."""
        return ROS2Publisher(self.named(name), type_name, **self.at, **more)

    def subscribe(self, name: str, type_name: str, each: Callable[[Any], None]) -> ROS2Subscriber:
        """To a topic, by its full name."""
        return ROS2Subscriber(name, type_name, each, **self.at)

    def client(self, name: str, type_name: str, timeout: float = 5.0) -> ROS2ServiceClient:
        """Of a service in the robot's namespace."""
        request, response = SERVICES[type_name]
        hash_ = type_hash(type_name)
        return ROS2ServiceClient(
            self.named(name), type_name, request, response, type_hash=hash_, timeout=timeout, **self.at
        )

    def subscribe_latched(self, name: str, type_name: str, each: Callable[[Any, bytes], None]) -> None:
        """As rmw_zenoh does it: zenoh-ext's AdvancedSubscriber with history, of every sample, with its attachment."""
        self.type(type_name)

        def hear(sample: zenoh.Sample) -> None:
            message = self.sdk.store.deserialize_cdr(sample.payload.to_bytes(), type_name)
            each(message, sample.attachment.to_bytes() if sample.attachment else b"")

        history = zenoh.ext.HistoryConfig(detect_late_publishers=True, max_samples=1)
        recovery = zenoh.ext.RecoveryConfig(heartbeat=True)
        self.kept.append(zenoh.ext.declare_advanced_subscriber(
            self.zenoh, self.key(name, type_name), hear, history=history, recovery=recovery, subscriber_detection=True
        ))

    def type(self, name: str) -> Any:
        """The class of a message, with all that it consists of."""
        return self.sdk.register_message_type(None, name)

    def trigger(self, name: str) -> dict[str, Any]:
        """Calls one of the robot's services of type Trigger."""
        client = self.client(name, TRIGGER)
        answer = client.call(structure_needs_at_least_one_member=0)
        client.close()
        return {"answered": answer is not None} if answer is None else {
            "answered": True, "success": bool(answer.success), "message": answer.message
        }


class Odometry:
    """Where the robot has been, by its odometry."""

    def __init__(self, robot: Robot) -> None:
        self.poses: list[tuple[float, float, float, float]] = []  # when, x, y, speed
        self.orientation: Any = None
        self.came = threading.Event()
        robot.subscribe(robot.named("odom"), "nav_msgs/msg/Odometry", self._hear)

    def _hear(self, message: Any) -> None:
        place = message.pose.pose.position
        self.orientation = message.pose.pose.orientation
        self.poses.append((time.monotonic(), place.x, place.y, message.twist.twist.linear.x))
        self.came.set()

    def since(self, when: float) -> list[tuple[float, float, float, float]]:
        """All that came after that time of the monotonic clock."""
        return [pose for pose in self.poses if pose[0] >= when]

    def way_m(self, when: float) -> float:
        """The length of the way since then."""
        poses = self.since(when)
        return sum(((b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2) ** 0.5 for a, b in pairwise(poses))

    def moved_m(self, when: float) -> float:
        """How far it is from where it was then, at the farthest."""
        poses = self.since(when)
        return max((((b[1] - poses[0][1]) ** 2 + (b[2] - poses[0][2]) ** 2) ** 0.5 for b in poses), default=0.0)

    def speed_mps(self) -> float:
        """The latest."""
        return self.poses[-1][3] if self.poses else 0.0


class Diagnostics:
    """What a robot last said of itself in /diagnostics, and all that it has said."""

    def __init__(self, robot: Robot) -> None:
        self.name = f"{robot.frame}: robot"
        self.latest: dict[str, str] = {}
        self.said: dict[str, set[str]] = {}
        robot.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", self._hear)

    def _hear(self, message: Any) -> None:
        for status in (status for status in message.status if status.name == self.name):
            self.latest = {it.key: it.value for it in status.values} | {"message": status.message}
            for key, value in self.latest.items():
                self.said.setdefault(key, set()).add(value)


def gid_of(token: str) -> bytes:
    """The gid that rmw_zenoh gives to the endpoint of this token: XXH3-128, low half first, little endian."""
    return xxhash.xxh3_128(token.encode()).intdigest().to_bytes(16, "little")


def attachment(sequence: int, source_ns: int, gid: bytes) -> bytes:
    """What rmw_zenoh attaches, by hand."""
    return struct.pack("<qqB", sequence, source_ns, len(gid)) + gid


def until(true: Callable[[], Any], timeout_s: float) -> bool:
    """Waits until it is so."""
    end = time.monotonic() + timeout_s
    while not true():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def definitions() -> Path:
    """A folder with all definitions, as the SDK wants them; the actions' parts are made known to rosbags too."""
    folder = Path(FOLDER)

    def write(name: str, text: str, ending: str) -> None:
        package, kind, bare = name.split("/")
        path = folder / package / kind / f"{bare}.{ending}"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n")

    for name in list(STORE.types):
        write(name, STORE.generate_msgdef(name, ros_version=2)[0].split("=" * 80)[0], "msg")
    for name, text in MESSAGES.items():
        write(name, text, "msg")
        STORE.register(get_types_from_msg(text, name))
    for name, (request, response) in SERVICES.items():
        write(name, f"{request}\n---\n{response}", "srv")
        if "/action/" in name:
            event = f"service_msgs/ServiceEventInfo info\n{name}_Request[<=1] request\n{name}_Response[<=1] response"
            whole = "\n".join(f"{name}_{part} {part.lower()}_message" for part in ("Request", "Response", "Event"))
            for part, text in (("_Request", request), ("_Response", response), ("_Event", event), ("", whole)):
                STORE.register(get_types_from_msg(text, name + part))
    return folder


def fail(*error: Any) -> NoReturn:
    """What is raised ends the program too: it would hang."""
    traceback.print_exception(*error)
    shutil.rmtree(FOLDER, ignore_errors=True)
    os._exit(1)


sys.excepthook = fail


def say(verdict: dict[str, Any]) -> None:
    """Prints one line; numbers that JSON has not are text."""
    text = json.dumps(verdict, default=str)
    print(text.replace("NaN", '"NaN"').replace("-Infinity", '"-inf"').replace("Infinity", '"inf"'), flush=True)


def finish(verdict: dict[str, Any]) -> NoReturn:
    """Prints one line, and ends at once: the SDK's session never closes by itself."""
    say(verdict)
    sys.stderr.flush()
    shutil.rmtree(FOLDER, ignore_errors=True)
    os._exit(0 if verdict["ok"] else 1)
