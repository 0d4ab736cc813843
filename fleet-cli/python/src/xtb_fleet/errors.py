"""What can go wrong, each with a code for programs and a hint for people."""

from __future__ import annotations


class FleetError(Exception):
    """What happened, in words; `code` says what kind, `hint` what to do."""

    def __init__(self, code: str, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.code = code
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} ({self.hint})" if self.hint else self.message


class Invalid(FleetError):
    """What was asked for is not possible: an argument, an endpoint, a file. Nothing was sent."""


class NotAllowed(FleetError):
    """The role of the identity does not allow it (nothing was sent), or the router does not admit the identity."""


class NotThere(FleetError):
    """No router, no robot or no dispatcher answers."""


class OutcomeUnknown(FleetError):
    """A request was sent and not answered: it may have been carried out."""


class Refused(FleetError):
    """The robot or the dispatcher refused; `code` is its own, such as `lease_held` or `latched`."""


class LeaseLost(Refused):
    """Control was taken, or the robot has restarted."""


class GoalEnded(FleetError):
    """A goal was not reached; `code` is how it ended, such as `failed` or `cancelled`."""


class TimedOut(FleetError, TimeoutError):
    """What was waited for has not happened yet, and may still happen."""


class Malformed(FleetError):
    """A message from the wire that is none of the protocol; it counts as not received."""

    def __init__(self, message: str) -> None:
        super().__init__("malformed", message)
