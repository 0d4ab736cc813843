"""Watch the fleet's tasks until all have ended: tasks.py tcp/127.0.0.1:7447 lab"""
import json, sys, time, zenoh

endpoint, fleet = sys.argv[1:3]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
shown, end = {}, time.monotonic() + 600
with zenoh.open(config) as session:
    while time.monotonic() < end:
        for reply in session.get(f"xtb/{fleet}/dispatch/tasks?format=json", timeout=1.0):
            tasks = json.loads(reply.ok.payload.to_string())["tasks"]
            for task in tasks:
                legs = f"{task['legs_done']}/{task['legs'] or 'any'}"
                line = [task["id"], task["state"], task["robot"] or "-", legs, task["reason"] or ""]
                if shown.get(task["id"]) != line:
                    shown[task["id"]] = line
                    print(*line, flush=True)
            if tasks and all(task["state"] in ("done", "failed", "cancelled") for task in tasks):
                sys.exit(any(task["state"] != "done" for task in tasks))
        time.sleep(0.2)
sys.exit("not all have ended in time")
