"""Holds lines of JSON against schemas: {"schemas": {verb: schema}, "lines": [[verb, line], ...]} on standard input.

Nothing may be in a line that its schema does not name, though schemas allow it for later versions.
"""

import json
import sys

from jsonschema import Draft202012Validator


def close(node, part=False):
    if isinstance(node, list):
        for item in node:
            close(item)
    if not isinstance(node, dict):
        return
    own = "properties" in node
    for key, value in node.items():
        if key in ("anyOf", "oneOf", "allOf"):
            for branch in value:
                close(branch, part or own)
        elif key in ("properties", "$defs", "patternProperties"):
            for inner in value.values():
                close(inner)
        elif key in ("items", "additionalProperties", "prefixItems"):
            close(value)
    if own and not part and "additionalProperties" not in node:
        node["unevaluatedProperties"] = False


asked = json.load(sys.stdin)
validators = {}
for verb, schema in asked["schemas"].items():
    Draft202012Validator.check_schema(schema)
    close(schema)
    validators[verb] = Draft202012Validator(schema)
wrong = 0
for verb, line in asked["lines"]:
    for error in validators[verb].iter_errors(line):
        wrong += 1
        inner = [f"{'/'.join(map(str, one.path))}: {one.message[:200]}" for one in error.context or []]
        print(f"{verb}: {json.dumps(line)[:300]}\n  {error.message[:300]}\n  " + "\n  ".join(inner[:12]))
print(f"{len(asked['lines'])} lines, {wrong} do not match")
sys.exit(1 if wrong else 0)
