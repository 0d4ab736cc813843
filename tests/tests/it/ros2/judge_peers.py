"""judge_peers.py ENDPOINT NODE talker|listener: two foreign nodes, which know the router alone, hear each other.

Both are zenoh-ros2-sdk's with its default session, which is a peer's as rmw_zenoh's. Prints one line with "ok": the
listener has heard ten messages one after the other, the talker has spoken until somebody has said so.
"""

import sys
import time

from judge import DEFAULT, Robot, finish, until
from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber

STRING = "std_msgs/msg/String"
robot = Robot(sys.argv[1], sys.argv[2])
heard: list[str] = []


def listen(name: str) -> None:
    ROS2Subscriber(name, STRING, lambda message: heard.append(message.data), qos=DEFAULT, **robot.at)


def talk() -> None:
    listen("/heard")
    publisher = ROS2Publisher("/chatter", STRING, **robot.at)
    for number in range(600):
        publisher.publish(data=str(number))
        time.sleep(0.05)
        if heard:
            break
    finish({"ok": bool(heard), "spoke": number + 1})


def hear() -> None:
    publisher = ROS2Publisher("/heard", STRING, **robot.at)
    listen("/chatter")
    enough = until(lambda: len(heard) >= 10, 30.0)
    numbers = [int(it) for it in heard[:10]]
    for _ in range(20):
        publisher.publish(data="enough")
        time.sleep(0.05)
    finish({"ok": enough and numbers == list(range(numbers[0], numbers[0] + 10)), "heard": numbers})


{"talker": talk, "listener": hear}[sys.argv[3]]()
