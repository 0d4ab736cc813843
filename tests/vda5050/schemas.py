"""Checks every message of a broker against the official schemas: schemas.py HOST PORT FOLDER.

Prints "listening", and at the end of its input {"messages": {topic: count}, "faults": [...]}.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import jsonschema
import paho.mqtt.client as mqtt

HOST, PORT, FOLDER = sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])
SCHEMAS: dict[str, Any] = {}
COUNT: Counter[str] = Counter()
FAULTS: list[str] = []
OURS = ("connection", "state", "factsheet")


def validator(level: str, name: str) -> Any:
    file = {"v2": "v21", "v3": "v3"}[level] + f"-{name}.json"
    if file not in SCHEMAS:
        schema = json.loads((FOLDER / file).read_text())
        SCHEMAS[file] = jsonschema.Draft202012Validator(schema, format_checker=jsonschema.FormatChecker())
    return SCHEMAS[file]


def on_message(client: Any, userdata: Any, message: Any) -> None:
    *_, name = levels = message.topic.split("/")
    if len(levels) != 5 or name not in OURS:
        return
    COUNT[name] += 1
    faults = [error.message[:200] for error in validator(levels[1], name).iter_errors(json.loads(message.payload))]
    FAULTS.extend(f"{message.topic}: {fault}" for fault in faults)


client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
client.on_message = on_message
client.on_connect = lambda client, *rest: client.subscribe("#", qos=1)
client.on_subscribe = lambda *rest: print("listening", flush=True)
client.connect(HOST, PORT)
client.loop_start()
sys.stdin.read()
client.loop_stop()
print(json.dumps({"messages": COUNT, "faults": FAULTS[:20]}), flush=True)
