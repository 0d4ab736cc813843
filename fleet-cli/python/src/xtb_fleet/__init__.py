"""Drive, watch and stop the robots of an XTB fleet from Python.

>>> from xtb_fleet import Fleet
>>> with Fleet.connect() as fleet:
...     robot = fleet["xtb-1"]
...     with robot.lease():
...         robot.goto(1.0, 2.0).wait()
"""

from __future__ import annotations

from . import messages
from .dispatch import Dispatch, Task, Tasks
from .errors import (
    FleetError,
    GoalEnded,
    Invalid,
    LeaseLost,
    NotAllowed,
    NotThere,
    OutcomeUnknown,
    Refused,
    TimedOut,
)
from .fleet import Fleet, RobotInfo, Robots
from .lease import Lease
from .robot import Goal, GoalEnd, Robot
from .stops import Outcome, StopReport
from .streams import State, Stream
from .teleop import Teleop

__version__ = "0.1.0"
__all__ = [
    "Dispatch",
    "Fleet",
    "FleetError",
    "Goal",
    "GoalEnd",
    "GoalEnded",
    "Invalid",
    "Lease",
    "LeaseLost",
    "NotAllowed",
    "NotThere",
    "Outcome",
    "OutcomeUnknown",
    "Refused",
    "Robot",
    "RobotInfo",
    "Robots",
    "State",
    "StopReport",
    "Stream",
    "Task",
    "Tasks",
    "Teleop",
    "TimedOut",
    "messages",
]
