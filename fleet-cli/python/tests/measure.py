"""What it costs to follow a fleet: measure.py ENDPOINT [SECONDS]. Prints one line of JSON."""

import json
import sys
import time

from xtb_fleet import Fleet

endpoint, seconds = sys.argv[1], float(sys.argv[2]) if len(sys.argv) > 2 else 60.0
with Fleet.connect(endpoint, identity="none", timeout_s=10.0) as fleet, fleet.states(queue=10_000) as stream:
    first = next(stream)
    robots, count, missed, ages = {first.robot: first["seq"]}, 0, 0, []
    began, cpu = time.monotonic(), time.process_time()
    while (now := time.monotonic()) - began < seconds:
        state = next(stream)
        count += 1
        ages.append(state.age)
        before = robots.get(state.robot)
        if before is not None:
            missed += state["seq"] - before - 1
        robots[state.robot] = state["seq"]
    took, used = time.monotonic() - began, time.process_time() - cpu
    ages.sort()
    print(
        json.dumps(
            {
                "robots": len(robots),
                "seconds": round(took, 1),
                "states_per_s": round(count / took, 1),
                "cores": round(used / took, 3),
                "dropped": stream.dropped,
                "missed": missed,
                "waited_p99_ms": round(1000 * ages[int(0.99 * len(ages))], 1),
            }
        )
    )
