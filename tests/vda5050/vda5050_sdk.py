"""The master control of vda5050-sdk (PyPI, VDA 5050 2.1.0) drives a robot: vda5050_sdk.py BROKER MANUFACTURER SERIAL.

Prints a line of JSON for each step; the last one is {"ok": true}.
"""

from __future__ import annotations

import asyncio
import json
import sys
import traceback
from collections.abc import Callable
from typing import Any

from vda5050 import MasterClient, MasterConfig, OrderBuilder, VehicleKey

BROKER, MANUFACTURER, SERIAL = sys.argv[1:4]
ROBOT = f"{MANUFACTURER}/{SERIAL}"
PATIENCE_S = 60.0


def say(step: str, **more: Any) -> None:
    print(json.dumps({"step": step, **more}), flush=True)


class Master:
    def __init__(self, client: MasterClient) -> None:
        self.client = client
        self.state: Any = None
        self.seen: list[str] = []
        self.complaints: list[str] = []
        self.issues: list[str] = []
        self.changed = asyncio.Event()
        client.on_state(self.on_state)
        client.on_error(lambda event: self.complaints.append(f"{event.error_type}: {event.error}"))
        client.on_progress_issue(self.on_issue)

    def on_issue(self, issue: Any, key: Any) -> None:
        # After an update it knows the nodes of that alone, and takes those of the base before for unknown.
        self.issues.append(issue.kind.value)
        if issue.kind.value not in ("UNKNOWN_NODE", "ORDER_COMPLETE"):
            self.complaints.append(str(issue))

    def on_state(self, state: Any, key: Any) -> None:
        self.state = state
        if state.last_node_id and self.seen[-1:] != [state.last_node_id]:
            self.seen.append(state.last_node_id)
        self.changed.set()

    async def until(self, what: str, holds: Callable[[Any], bool]) -> Any:
        async def look() -> Any:
            while self.state is None or not holds(self.state):
                self.changed.clear()
                await self.changed.wait()
            return self.state

        try:
            return await asyncio.wait_for(look(), PATIENCE_S)
        except asyncio.TimeoutError:
            raise AssertionError(f"waited in vain for {what}: {self.state}") from None


def error_types(state: Any) -> list[str]:
    return [error.error_type for error in state.errors]


def builder(order_id: str) -> OrderBuilder:
    return OrderBuilder(order_id=order_id, manufacturer=MANUFACTURER, serial_number=SERIAL)


async def traversed(master: Master, map_id: str) -> None:
    order = (
        builder("traversed")
        .add_node("a", x=0.0, y=0.0, map_id=map_id, allowed_deviation_xy=0.5)
        .add_edge("a", "b")
        .add_node("b", x=0.0, y=1.2, map_id=map_id, allowed_deviation_xy=0.5)
        .build()
    )
    result = await master.client.dispatch(order, target=ROBOT)
    assert result.accepted, result
    await master.until("under way", lambda state: state.order_id == "traversed" and state.driving)
    more = OrderBuilder.from_order(order).add_edge("b", "c").add_node("c", x=0.0, y=2.4, map_id=map_id, allowed_deviation_xy=0.5)
    result = await master.client.dispatch(more.build(), target=ROBOT)
    assert result.accepted, result
    await master.until("the update", lambda state: state.order_update_id == 1)
    state = await master.until("the end", lambda state: not state.node_states and state.last_node_id == "c")
    assert state.edge_states == [] and state.last_node_sequence_id == 4, state
    assert master.seen == ["a", "b", "c"], master.seen
    assert "ORDER_COMPLETE" in master.issues, master.issues
    say("traversed", seen=master.seen)


async def cancelled(master: Master, map_id: str) -> None:
    order = (
        builder("cancelled")
        .add_node("c", x=0.0, y=2.4, map_id=map_id, allowed_deviation_xy=0.5)
        .add_edge("c", "a")
        .add_node("a", x=0.0, y=0.2, map_id=map_id, allowed_deviation_xy=0.5)
        .build()
    )
    result = await master.client.dispatch(order, target=ROBOT)
    assert result.accepted, result
    await master.until("driving", lambda state: state.order_id == "cancelled" and state.driving)
    await master.client.cancel_order(ROBOT, action_id="cancel")

    def ended(state: Any) -> bool:
        states = [action.action_status.value for action in state.action_states if action.action_id == "cancel"]
        return states == ["FINISHED"]

    state = await master.until("cancelled", ended)
    assert not state.node_states and not state.driving, state
    say("cancelled")


async def refused(master: Master, map_id: str) -> None:
    await master.client.cancel_order(ROBOT, action_id="again")
    await master.until("nothing to cancel", lambda state: "noOrderToCancel" in error_types(state))
    position = master.state.agv_position
    other = (
        builder("elsewhere")
        .add_node("x", x=position.x, y=position.y, map_id="another-map")
        .add_edge("x", "y")
        .add_node("y", x=0.0, y=0.0, map_id="another-map")
        .build()
    )
    await master.client._publish_order(VehicleKey.parse(ROBOT), other)  # whatever the client thinks of it
    await master.until("another map", lambda state: "noRouteError" in error_types(state))
    await master.client.request_factsheet(ROBOT)
    say("refused", errors=error_types(master.state))


async def main() -> None:
    config = MasterConfig(broker_url=BROKER, validate_messages=True)
    async with MasterClient(config) as client:
        master = Master(client)
        state = await master.until(
            "a robot at its start", lambda state: state.agv_position and state.agv_position.position_initialized
        )
        map_id = state.agv_position.map_id
        await traversed(master, map_id)
        await cancelled(master, map_id)
        await refused(master, map_id)
        assert not master.complaints, master.complaints
    say("end", ok=True)


try:
    asyncio.run(main())
except BaseException:
    print(json.dumps({"ok": False, "error": traceback.format_exc()}), flush=True)
    sys.exit(1)
