"""Drives a robot until it is killed: drives.py ENDPOINT ROBOT teleop|goto. Prints a line when it has begun."""

import sys
import time

from xtb_fleet import Fleet

endpoint, name, how = sys.argv[1:4]
with Fleet.connect(endpoint, identity="none", timeout_s=10.0) as fleet:
    robot = fleet[name]
    with robot.lease():
        if how == "goto":
            place = robot.state
            goal = robot.goto(place.x, place.y + 4.0, via="direct")
            print("driving", flush=True)
            goal.wait()
        else:
            with robot.teleop(deadman=2.0) as hand:
                print("driving", flush=True)
                while True:
                    hand.drive(0.5)
                    time.sleep(0.05)
