"""Send a robot to a point of the map: goto.py tcp/127.0.0.1:7447 lab xtb-1 1.0 2.0"""
import json, sys, threading, time, uuid, zenoh

endpoint, fleet, robot = sys.argv[1:4]
base, client = f"xtb/{fleet}/{robot}", f"python-{uuid.uuid4().hex[:8]}"
lease = None
config = zenoh.Config()
config.insert_json5("mode", '"client"')
config.insert_json5("connect/endpoints", json.dumps([endpoint]))
with zenoh.open(config) as session:
    def get(key, body=None):
        message = {}
        if body is not None:
            request = {"id": str(uuid.uuid4()), "lease": lease, "body": body}
            message = {"payload": json.dumps(request), "encoding": "application/json"}
        return lambda: session.get(f"{base}/{key}", timeout=1.0, **message)

    def ask(query):  # the first answer, or None
        for reply in query():
            return json.loads(reply.ok.payload.to_string())
        time.sleep(0.2)

    def command(body):
        query, reply = get(f"cmd/{client}", body), None
        for attempt in range(10):  # no answer means "unknown": ask again with the same id
            reply = reply or ask(query)
        if reply is None or "error" in reply["result"]:
            sys.exit(f"not accepted: {reply}")
        return reply["result"]["ok"]

    def retain():  # a lease that is silent for 500 ms ends the goal, for 900 ms it is free again
        query = get(f"cmd/{client}", {"retain": {}})
        while not done.wait(0.1):
            query()

    lease, done = command({"acquire": {}})["lease"], threading.Event()
    threading.Thread(target=retain, daemon=True).start()
    try:
        mine = command({"goto": {"x_m": float(sys.argv[4]), "y_m": float(sys.argv[5])}})["goal"]
        end = time.monotonic() + 120
        while time.monotonic() < end:
            goal = (ask(get("state?format=json")) or {}).get("goal") or {}
            if goal.get("id") == mine:
                print(goal["status"], goal["distance_m"], goal["reason"] or "", flush=True)
                if goal["status"] not in ("accepted", "running", "blocked"):
                    sys.exit(goal["status"] != "reached")
            time.sleep(0.2)
    finally:  # Ctrl-C too: to give the lease back ends a goal that still runs
        done.set()
        ask(get(f"cmd/{client}", {"release": {}}))
sys.exit("not reached in time")
