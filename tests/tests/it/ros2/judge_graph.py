"""judge_graph.py ENDPOINT ROBOT [--until-gone]: does a foreign graph show exactly what a robot offers?

Discovery and type hashes are zenoh-ros2-sdk's, the latter from message definitions; the hashes of the action's services
are rosbags'. Prints {"ok", "missing", "unexpected", "wrong_hash", "wrong_qos"} as one line. With --until-gone then
prints `ready`, reads a line (the agent has been killed then) and prints {"ok", "gone_s"}: when the graph was empty.
"""

import argparse
import sys
import time

from judge import Channel, Robot, finish, offered, say, type_hash
from zenoh_ros2_sdk import get_service_info, get_service_names_and_types, get_topic_info, get_topic_names_and_types
from zenoh_ros2_sdk.qos import QosProfile

arguments = argparse.ArgumentParser()
arguments.add_argument("endpoint")
arguments.add_argument("robot")
arguments.add_argument("--until-gone", action="store_true")
options = arguments.parse_args()
robot = Robot(options.endpoint, options.robot)


def seen() -> list[tuple[Channel, str, str]]:
    """All endpoints of the robot's nodes: endpoint, hash and node."""
    found = []

    def note(kind: str, name: str, type_name: str, it: object) -> None:
        if it.node_namespace == robot.namespace:
            found.append((Channel(kind, name, type_name, QosProfile.decode(it.qos)), it.type_hash, it.node_name))

    for name, _ in get_topic_names_and_types(include_hidden_topics=True, **robot.at):
        info = get_topic_info(name, verbose=True, **robot.at)
        for kind, endpoints in (("MP", info.publishers), ("MS", info.subscribers)) if info else ():
            for it in endpoints:
                note(kind, name, it.topic_type, it)
    for name, _ in get_service_names_and_types(include_hidden_services=True, **robot.at):
        info = get_service_info(name, verbose=True, **robot.at)
        for kind, endpoints in (("SS", info.servers), ("SC", info.clients)) if info else ():
            for it in endpoints:
                note(kind, name, it.service_type, it)
    return found


def nodes() -> int:
    """The robot's nodes; the SDK's discovery has endpoints only."""
    pattern = f"@ros2_lv/{robot.domain}/*/*/*/NN/%/{robot.namespace.replace('/', '%')}/*"
    return sum(reply.ok is not None for reply in robot.sdk.liveliness.get(pattern, timeout=1.0))


def said(channel: Channel) -> str:
    return f"{channel.kind} {channel.name} {channel.type}"


def compare() -> dict:
    expected = {said(it): it for it in offered(robot.namespace)}
    endpoints = seen()
    found = {said(it): (it, hash_, node) for it, hash_, node in endpoints}
    both = [name for name in expected if name in found]
    verdict = {
        "missing": sorted(set(expected) - set(found)),
        "unexpected": sorted(set(found) - set(expected)),
        "wrong_hash": [f"{it}: {found[it][1]}" for it in both if found[it][1] != type_hash(expected[it].type)],
        "wrong_qos": [f"{it}: {found[it][0].qos.encode()}" for it in both if found[it][0].qos != expected[it].qos],
    }
    twice = len(endpoints) - len(found)
    names = sorted({node for _, _, node in endpoints})
    ok = not any(verdict.values()) and not twice and names == ["xtb_agent"] and nodes() == 1
    return {"ok": ok, **verdict, "endpoints": len(endpoints), "twice": twice, "nodes": names}


end = time.monotonic() + 10.0
verdict = compare()
while not verdict["ok"] and time.monotonic() < end:
    time.sleep(0.5)
    verdict = compare()
if not (options.until_gone and verdict["ok"]):
    finish(verdict)
say(verdict)
print("ready", flush=True)
sys.stdin.readline()
killed = time.monotonic()
while (left := len(seen()) + nodes()) and time.monotonic() < killed + 90.0:
    time.sleep(0.02)
finish({"ok": left == 0, "gone_s": round(time.monotonic() - killed, 3), "left": left})
