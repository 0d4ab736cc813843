"""What rosbags says of the types and bytes of xtb-ros2: hashes computed from the definitions, messages decoded.

In, on stdin: {"types": [{"name", "store"}], "messages": [{"name", "store", "hex"}]}; a store is jazzy, kilted or
lyrical. Out: the same lists with "hash", and with "hex" (encoded again) and "value". The services and the action, which
rosbags does not have, are defined here as in their .srv and .action files.
"""

import json
import math
import sys

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.base import BASE_NAMES

STORES = {
    "jazzy": Stores.ROS2_JAZZY,
    "kilted": Stores.ROS2_KILTED,
    "lyrical": Stores.ROS2_LYRICAL,
}
UUID = "unique_identifier_msgs/msg/UUID"
TIME = "builtin_interfaces/msg/Time"
DURATION = "builtin_interfaces/msg/Duration"
POSE = "geometry_msgs/msg/PoseStamped"
INFO = "action_msgs/msg/GoalInfo"
INTROSPECTION = "service_msgs/msg/ServiceEventInfo"
ACTION = "nav2_msgs/action/NavigateToPose"
GOAL = {"pose": POSE, "behavior_tree": "string"}
RESULT = {"error_code": "uint16", "error_msg": "string"}
FEEDBACK = {
    "current_pose": POSE,
    "navigation_time": DURATION,
    "estimated_time_remaining": DURATION,
    "number_of_recoveries": "int16",
    "distance_remaining": "float32",
}
LYRICAL = {"position_tracking_error": "float32", "heading_tracking_error": "float32"}
NOTHING = {"structure_needs_at_least_one_member": "uint8"}
VERDICT = {"success": "bool", "message": "string"}


def field(kind):
    """`T`, `T[]` (any number) or `T[<1]` (one at most)."""
    name, _, sequence = kind.partition("[")
    base = (Nodetype.BASE, (name, 0)) if name in BASE_NAMES else (Nodetype.NAME, name)
    if not sequence:
        return base
    return (Nodetype.SEQUENCE, (base, 1 if sequence == "<1]" else 0))


def service(name, request, response):
    """A service's own type, as rosidl makes it, and those that it is made of."""
    return {
        f"{name}_Request": request,
        f"{name}_Response": response,
        f"{name}_Event": {
            "info": INTROSPECTION,
            "request": f"{name}_Request[<1]",
            "response": f"{name}_Response[<1]",
        },
        name: {
            "request_message": f"{name}_Request",
            "response_message": f"{name}_Response",
            "event_message": f"{name}_Event",
        },
    }


def definitions(store):
    feedback = FEEDBACK | (LYRICAL if store == "lyrical" else {})
    return {
        f"{ACTION}_Goal": GOAL,
        f"{ACTION}_Result": RESULT,
        f"{ACTION}_Feedback": feedback,
        f"{ACTION}_FeedbackMessage": {"goal_id": UUID, "feedback": f"{ACTION}_Feedback"},
        **service("std_srvs/srv/Trigger", NOTHING, VERDICT),
        **service("std_srvs/srv/SetBool", {"data": "bool"}, VERDICT),
        **service(
            "action_msgs/srv/CancelGoal",
            {"goal_info": INFO},
            {"return_code": "int8", "goals_canceling": f"{INFO}[]"},
        ),
        **service(
            f"{ACTION}_SendGoal",
            {"goal_id": UUID, "goal": f"{ACTION}_Goal"},
            {"accepted": "bool", "stamp": TIME},
        ),
        **service(
            f"{ACTION}_GetResult",
            {"goal_id": UUID},
            {"status": "int8", "result": f"{ACTION}_Result"},
        ),
    }


def typestore(store):
    types = get_typestore(STORES[store])
    # rosidl makes `char` of a .msg file an uint8; rosbags leaves it what it is.
    constants, fields = types.fielddefs[INTROSPECTION]
    gid = (Nodetype.ARRAY, ((Nodetype.BASE, ("uint8", 0)), 16))
    fields = [(key, gid if key == "client_gid" else kind) for key, kind in fields]
    types.fielddefs[INTROSPECTION] = (constants, fields)
    for name, fields in definitions(store).items():
        types.register({name: ([], [(key, field(kind)) for key, kind in fields.items()])})
    return types


def plain(value):
    """As JSON has it: numbers that are none become texts."""
    if hasattr(value, "__msgtype__"):
        names = [name for name in value.__dataclass_fields__ if name.islower() and name[0] != "_"]
        return {name: plain(getattr(value, name)) for name in names}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, list):
        return [plain(element) for element in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


def main():
    asked = json.load(sys.stdin)
    stores = {name: typestore(name) for name in STORES}
    for it in asked["types"]:
        it["hash"] = stores[it["store"]].hash_rihs01(it["name"])
    for it in asked["messages"]:
        types = stores[it["store"]]
        message = types.deserialize_cdr(bytes.fromhex(it["hex"]), it["name"])
        it["hex"] = bytes(types.serialize_cdr(message, it["name"])).hex()
        it["value"] = plain(message)
    json.dump(asked, sys.stdout)


main()
