"""judge_decode.py ENDPOINT ROBOT: does foreign software read what a robot publishes?

And is it plausible? Subscribes to each topic with zenoh-ros2-sdk, to the latched ones as a late joiner with zenoh-ext's
AdvancedSubscriber (what rmw_zenoh uses; the SDK's own history finds topics in the root namespace only, and is judged
with /tf_static). Decoding is rosbags', with definitions whose hashes are in the keys. Attachments are read by plain
Zenoh subscribers; their gids must be those of the tokens, by xxhash.
Prints {"ok", "problems", "topics": {name: {"count", "seen"}}}; a topic that has not come within 15 s is a problem.
"""

import math
import struct
import sys
import time
import xml.etree.ElementTree
from collections import defaultdict
from typing import Any

import zenoh
from judge import LATCHED, Channel, Robot, finish, gid_of, offered, until
from zenoh_ros2_sdk import ROS2Subscriber

# Silent without a goal.
MAY_BE_SILENT = ("plan", "feedback")
robot = Robot(sys.argv[1], sys.argv[2])
frame = robot.frame
problems: set[str] = set()
messages: dict[str, list[tuple[float, Any]]] = defaultdict(list)
attachments: dict[str, list[bytes]] = defaultdict(list)


def check(true: bool, problem: str) -> None:
    if not true:
        problems.add(problem)


def unit(q: Any, name: str) -> None:
    norm = math.hypot(q.x, q.y, q.z, q.w)
    check(abs(norm - 1.0) < 1e-6, f"{name}: quaternion of norm {norm}")


def finite(vector: Any, name: str) -> None:
    check(all(math.isfinite(it) for it in (vector.x, vector.y, vector.z)), f"{name}: {vector}")


def judge(channel: Channel, came_s: float, it: Any) -> Any:
    """Judges one message; returns what is worth showing of it."""
    name = channel.name
    bare = name.removeprefix(f"{robot.namespace}/")

    def stamped(header: Any, expected: str, within_s: float = 2.0) -> None:
        age_s = came_s - header.stamp.sec - header.stamp.nanosec * 1e-9
        check(abs(age_s) < within_s, f"{name}: stamped {age_s:.3f} s ago")
        check(header.frame_id == expected, f"{name}: frame {header.frame_id!r}, not {expected!r}")

    if bare == "odom":
        stamped(it.header, f"{frame}/odom")
        check(it.child_frame_id == f"{frame}/base_link", f"odom: child {it.child_frame_id!r}")
        unit(it.pose.pose.orientation, name)
        finite(it.pose.pose.position, name)
        finite(it.twist.twist.linear, name)
        return [it.pose.pose.position.x, it.pose.pose.position.y]
    if bare in ("/tf", "/tf_static"):
        pairs = []
        for transform in it.transforms:
            # What is latched has the time of its making.
            stamped(transform.header, transform.header.frame_id, 2.0 if bare == "/tf" else math.inf)
            unit(transform.transform.rotation, name)
            finite(transform.transform.translation, name)
            pairs.append(f"{transform.header.frame_id} > {transform.child_frame_id}")
        return pairs
    if bare == "robot_description":
        root = xml.etree.ElementTree.fromstring(it.data)
        links = [link.get("name") for link in root.iter("link")]
        ends = [end.get("link") for joint in root.iter("joint") for end in (joint.find("parent"), joint.find("child"))]
        check(root.tag == "robot" and f"{frame}/base_link" in links, f"{name}: {root.tag} {links}")
        check(set(ends) <= set(links), f"{name}: joints of no link {set(ends) - set(links)}")
        return links
    if bare == "imu":
        stamped(it.header, f"{frame}/imu_link")
        check(it.linear_acceleration_covariance[0] == -1, "imu: it says that it measures acceleration")
        finite(it.angular_velocity, name)
        return it.angular_velocity.z
    if bare.startswith("range/"):
        stamped(it.header, f"{frame}/ir_{bare.removeprefix('range/')}")
        check(it.range == math.inf or 0.1 - 1e-6 <= it.range <= 0.8 + 1e-6, f"{name}: {it.range} m")
        limits = [it.radiation_type, round(it.min_range, 6), round(it.max_range, 6)]
        check(limits == [1, 0.1, 0.8] and it.field_of_view > 0, f"{name}: {limits} {it.field_of_view}")
        return it.range
    if bare == "battery_state":
        stamped(it.header, it.header.frame_id)
        check(math.isnan(it.voltage) or 0 < it.voltage < 100, f"{name}: {it.voltage} V")
        check(math.isnan(it.percentage) or 0 <= it.percentage <= 1, f"{name}: {it.percentage}")
        return it.voltage
    if bare == "/diagnostics":
        stamped(it.header, it.header.frame_id)
        return [[level(status), status.name, status.message] for status in it.status]
    if bare.endswith("/status"):
        return [int(goal.status) for goal in it.status_list]
    if bare == "plan":
        check(it.header.frame_id == "map", f"plan: frame {it.header.frame_id!r}")
        return len(it.poses)
    return str(it)


def level(status: Any) -> int:
    """rosbags has a byte as an int or as a byte."""
    found = status.level if isinstance(status.level, int) else status.level[0]
    check(found in (0, 1, 2, 3), f"/diagnostics: level {found}")
    return found


def ours(channel: Channel, it: Any) -> bool:
    """Whether it is of this robot: topics in the root namespace are everybody's."""
    if channel.type.endswith("TFMessage"):
        return any(transform.child_frame_id.startswith(f"{frame}/") for transform in it.transforms)
    return not channel.name.startswith("/diagnostics") or any(one.hardware_id == sys.argv[2] for one in it.status)


def hear(channel: Channel) -> None:
    """Messages by the SDK or, latched, by zenoh-ext; attachments by plain Zenoh."""
    def note(it: Any) -> None:
        if ours(channel, it):
            messages[channel.name].append((time.time(), it))

    def note_latched(it: Any, attachment: bytes) -> None:
        note(it)
        attachments[channel.name].append(attachment)

    if channel.qos == LATCHED:
        robot.subscribe_latched(channel.name, channel.type, note_latched)
        return
    robot.subscribe(channel.name, channel.type, note)

    def attached(sample: zenoh.Sample) -> None:
        attachments[channel.name].append(sample.attachment.to_bytes() if sample.attachment else b"")

    robot.kept.append(robot.zenoh.declare_subscriber(robot.key(channel.name, channel.type), attached))


published = [channel for channel in offered(robot.namespace) if channel.kind == "MP"]
began_s = time.time()
for channel in published:
    hear(channel)
loud = [channel.name for channel in published if not channel.name.endswith(MAY_BE_SILENT)]
until(lambda: all(messages[name] for name in loud), 15.0)
# The SDK's own late joining.
late: list[Any] = []
ROS2Subscriber("/tf_static", "tf2_msgs/msg/TFMessage", late.append, qos=LATCHED, **robot.at)
check(until(lambda: late, 5.0), "/tf_static: the SDK, coming late, has not got it")
time.sleep(max(0.0, began_s + 3.0 - time.time()))

tokens = robot.sdk.liveliness.get(f"@ros2_lv/{robot.domain}/*/*/*/MP/**", timeout=2.0)
gids = {gid_of(str(token.ok.key_expr)) for token in tokens if token.ok}
topics = {}
for channel in published:
    got = list(messages[channel.name])
    check(bool(got) or channel.name.endswith(MAY_BE_SILENT), f"{channel.name}: nothing came")
    seen = [judge(channel, came_s, it) for came_s, it in got]
    sizes = sorted({len(it) for it in attachments[channel.name]})
    check(sizes in ([], [33]), f"{channel.name}: attachments of {sizes} bytes")
    check(bool(sizes) or not got, f"{channel.name}: no attachment was seen")
    by_gid = defaultdict(list)
    for it in (it for it in attachments[channel.name] if len(it) == 33):
        sequence, source_ns, length, gid = struct.unpack("<qqB16s", it)
        by_gid[gid].append(sequence)
        check(length == 16 and gid != bytes(16), f"{channel.name}: gid {gid.hex()} of {length}")
        limit_s = 2.0 if channel.qos != LATCHED else math.inf
        check(began_s - limit_s < source_ns * 1e-9 < time.time() + 2.0, f"{channel.name}: made at {source_ns}")
    check(set(by_gid) <= gids, f"{channel.name}: the gid is that of no token")
    for numbers in by_gid.values():
        check(numbers[0] >= 1 and numbers == list(range(numbers[0], numbers[0] + len(numbers))),
              f"{channel.name}: numbers {numbers[:5]} and so on are not one after the other")
    topics[channel.name] = {"count": len(got), "gids": len(by_gid), "seen": seen[-1] if seen else None}

pairs = {pair for name in ("/tf", "/tf_static") for _, it in messages[name] for pair in (
    f"{transform.header.frame_id} > {transform.child_frame_id}" for transform in it.transforms)}
sensors = [f"ir_{end}_{i}" for end in ("front", "rear") for i in range(6)] + ["imu_link"]
needed = {f"map > {frame}/odom", f"{frame}/odom > {frame}/base_link"}
needed |= {f"{frame}/base_link > {frame}/{it}" for it in sensors}
check(needed <= pairs, f"tf: missing {sorted(needed - pairs)}")
for name, at_least in ((robot.named("odom"), 20), ("/tf", 20), (robot.named("imu"), 20)):
    check(topics[name]["count"] >= at_least, f"{name}: {topics[name]['count']} in 3 s")
finish({"ok": not problems, "problems": sorted(problems), "topics": topics})
