#!/usr/bin/env python3
"""Where the instructions of `scale` go: a table of shares from files that callgrind wrote, one column each.

    CARGO_PROFILE_DIST_DEBUG=line-tables-only CARGO_PROFILE_DIST_STRIP=none \\
        cargo build --profile dist -p xtb-sim --example scale
    valgrind --tool=callgrind --toggle-collect='scale::go_on' --callgrind-out-file=100.out \
        target/dist/examples/scale 100
    python3 core/sim/examples/scale/profile.py 100.out

Code of the standard library is counted for the part whose code stands before it in the program, which has it inlined.
"""

import collections
import re
import sys

PARTS = [
    ("core/sim/src/(infrared|range_curves|converter)", "range finders and converter"),
    ("core/sim/src/(vehicle|drive|servos|platform|gears|receiver|supply)", "drive, servos, platform, receiver"),
    ("core/sim/src/(board|gyro|bno|line)", "board, gyro and their lines"),
    ("core/sim|parry2d|glamx", "world: what is near, meets and touches"),
    ("core/board-codec|core/protocol|crc", "frames, read and written"),
    ("core/control", "controller"),
    ("core/nav", "pose filter"),
    ("core/robot", "agent"),
    ("/libm-", "sine, arctangent, exponential"),
    ("malloc|string/", "copies and allocations"),
]
OWN = re.compile(r"core/[a-z0-9-]+/src/|/crc-|parry2d|glamx")


def part(path):
    return next((name for pattern, name in PARTS if re.search(pattern, path)), "other")


def shares(path):
    names = {}
    cost = collections.Counter()
    file = owner = ""
    is_call = False
    with open(path, encoding="utf-8", errors="replace") as lines:
        for line in lines:
            head = re.match(r"(fl|fi|fe|fn|cfi|cfl)=(?:\((\d+)\))?\s*(.*)", line)
            if head and head[1] != "fn":
                if head[3]:
                    names[head[2]] = head[3]
                if head[1] in ("fl", "fi", "fe"):
                    file = names.get(head[2], head[3])
                    if head[1] == "fl":
                        owner = file
                    elif OWN.search(file):
                        owner = file
            elif line.startswith("calls="):
                is_call = True
            elif count := re.match(r"[+\-*]?\d* (\d+)$", line):
                if not is_call:
                    cost[part(file if OWN.search(file) else owner)] += int(count[1])
                is_call = False
    return cost


def main():
    columns = [shares(path) for path in sys.argv[1:]]
    rows = [name for _, name in PARTS] + ["other"]
    print("| part |", " | ".join(path.removesuffix(".out") for path in sys.argv[1:]), "|")
    print("| --- |" + " ---: |" * len(columns))
    for row in rows:
        parts = (f"{100 * cost[row] / cost.total():.1f} %" for cost in columns)
        print(f"| {row} |", " | ".join(parts), "|")


if __name__ == "__main__":
    main()
