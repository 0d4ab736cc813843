"""The keys of a fleet, and which robot a received one belongs to (docs/protocol.md, Keys)."""

from __future__ import annotations

from .errors import Invalid
from .settings import check_robot

ANY = "*"


class Keys:
    """Made and read in one place."""

    def __init__(self, fleet: str, client: str) -> None:
        self.fleet = fleet
        self.client = client

    def of(self, robot: str, rest: str) -> str:
        """A key of one robot, or with :data:`ANY` of all."""
        return f"xtb/{self.fleet}/{robot}/{rest}"

    def cmd(self, robot: str) -> str:
        """Requests to it."""
        return self.of(robot, f"cmd/{self.client}")

    def teleop(self, robot: str) -> str:
        """Setpoints for it."""
        return self.of(robot, f"teleop/{self.client}")

    def estop(self, robot: str) -> str:
        """Its emergency stop; `all` = everybody's."""
        return self.of(robot, f"estop/{self.client}")

    def dispatch(self, rest: str) -> str:
        """A key of the dispatcher."""
        return f"xtb/{self.fleet}/dispatch/{rest}"

    def roster(self) -> str:
        """Which robots the simulator has."""
        return f"xtb/{self.fleet}/sim/roster"

    def robot_of(self, key: str, rest: str) -> str | None:
        """Whose key this is; None = it is not `rest` of a robot of this fleet."""
        head, tail = f"xtb/{self.fleet}/", f"/{rest}"
        if not key.startswith(head) or not key.endswith(tail):
            return None
        try:
            return check_robot(key[len(head) : -len(tail)])
        except Invalid:
            return None
