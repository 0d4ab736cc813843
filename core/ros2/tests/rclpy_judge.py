"""What the genuine type support of ROS 2 (rclpy's) says of the messages of xtb-ros2: the same as rosbags_judge.py.

In, on stdin: {"types": [{"name"}], "messages": [{"name", "hex"}]}. Out: the same lists with "hash", from the JSON that
rosidl has generated beside each type, and with "value" and "same": whether the message survives being encoded and
decoded once more (bytes are not compared: padding is not initialised there). A type whose package is not installed,
such as nav2_msgs, which has no wheel, is answered with null.
"""

import importlib
import json
import math
import sys
from pathlib import Path

from rclpy.serialization import deserialize_message, serialize_message


def message_class(name):
    """`std_srvs/srv/Trigger_Request` or `std_msgs/msg/String`; None if its package is not there."""
    package, kind, bare = name.split("/")
    try:
        module = importlib.import_module(f"{package}.{kind}")
    except ModuleNotFoundError:
        return None
    bare, _, part = bare.partition("_")
    found = getattr(module, bare)
    return getattr(found, part) if part else found


def published_hash(name):
    package, kind, bare = name.split("/")
    path = Path(sys.prefix) / "share" / package / kind / f"{bare}.json"
    if not path.is_file():
        return None
    hashes = json.loads(path.read_text())["type_hashes"]
    return next(it["hash_string"] for it in hashes if it["type_name"] == name)


def plain(value):
    """As JSON has it: numbers that are none become texts."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, bytes):
        return value[0]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(element) for element in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


asked = json.load(sys.stdin)
for it in asked["types"]:
    it["hash"] = published_hash(it["name"])
for it in asked["messages"]:
    kind = message_class(it["name"])
    if kind is None:
        it["value"] = it["same"] = None
        continue
    message = deserialize_message(bytes.fromhex(it["hex"]), kind)
    it["value"] = plain(message)
    it["same"] = plain(deserialize_message(serialize_message(message), kind)) == it["value"]
json.dump(asked, sys.stdout)
