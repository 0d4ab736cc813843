"""Send a robot to a point of the map: goto.py tcp/127.0.0.1:7447 lab xtb-1 1.0 2.0"""
import json, sys, time, uuid, zenoh

endpoint, fleet, robot = sys.argv[1:4]
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with zenoh.open(config) as session:
    def ask(key, **message):  # the first answer, or None
        for reply in session.get(f"xtb/{fleet}/{robot}/{key}", timeout=1.0, **message):
            return json.loads(reply.ok.payload.to_string())
        time.sleep(0.2)

    body = {"goto": {"x_m": float(sys.argv[4]), "y_m": float(sys.argv[5])}}
    request = json.dumps({"id": str(uuid.uuid4()), "body": body})
    reply = None
    for attempt in range(10):  # no answer means "unknown": ask again with the same id
        reply = reply or ask("cmd/python", payload=request, encoding="application/json")
    if reply is None or "error" in reply["result"]:
        sys.exit(f"not accepted: {reply}")
    end = time.monotonic() + 120
    while time.monotonic() < end:
        goal = (ask("state?format=json") or {}).get("goal") or {}
        if goal.get("id") == reply["result"]["ok"]["goal"]:
            print(goal["status"], goal["distance_m"], flush=True)
            if goal["status"] not in ("accepted", "running", "blocked"):
                sys.exit(goal["status"] != "reached")
        time.sleep(0.2)
sys.exit("not reached in time")
