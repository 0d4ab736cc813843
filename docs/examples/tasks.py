"""Watch the fleet's tasks until all have ended: tasks.py tcp/127.0.0.1:7447 lab"""
import json, sys, time, zenoh

endpoint, fleet = sys.argv[1:3]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
shown, end = {}, time.monotonic() + 600


def pages(session):
    """All tasks, page after page; None = no answer, or not to all of it."""
    tasks, after, left_out = [], "t0", 1
    while left_out:
        replies = list(session.get(f"xtb/{fleet}/dispatch/tasks?format=json;after={after}", timeout=1.0))
        if not replies or replies[0].ok is None:
            return None
        page = json.loads(replies[0].ok.payload.to_string())
        tasks += page["tasks"]
        left_out, after = page["left_out"], page["tasks"][-1]["id"] if page["tasks"] else after
    return tasks


with zenoh.open(config) as session:
    while time.monotonic() < end:
        tasks = pages(session)
        for task in tasks or []:
            legs = f"{task['legs_done']}/{task['legs'] or 'any'}"
            line = [task["id"], task["state"], task["robot"] or "-", legs, task["reason"] or ""]
            if shown.get(task["id"]) != line:
                shown[task["id"]] = line
                print(*line, flush=True)
        if tasks and all(task["state"] in ("done", "failed", "cancelled") for task in tasks):
            sys.exit(any(task["state"] != "done" for task in tasks))
        time.sleep(0.2)
sys.exit("not all have ended in time")
