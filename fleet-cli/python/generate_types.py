"""Makes src/xtb_fleet/messages.py from src/xtb_fleet/schemas.json; with --check it only compares.

The schemas are those of the messages (core/protocol/tests/it/schemas.rs compares them).
"""

from __future__ import annotations

import json
import keyword
import sys
import textwrap
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent / "src" / "xtb_fleet"
SCHEMAS = HERE / "schemas.json"
MESSAGES = HERE / "messages.py"
PLAIN = {"string": "str", "number": "float", "integer": "int", "boolean": "bool", "null": "None"}
HEAD = '''"""Messages as they stand on the wire in JSON. Made by generate_types.py: not to be edited.

A newer robot may say more: other fields, and other words where a `Literal` lists those of today.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict, Union
'''

Schema = dict[str, Any]


class Generator:
    """Writes one Python type a definition, those that it needs before it."""

    def __init__(self, definitions: dict[str, Schema], names: dict[str, str], strict: bool) -> None:
        self.definitions = definitions
        self.names = names
        self.strict = strict  # every field of `required` is always there
        self.out: list[str] = []

    def all(self) -> str:
        for name in sorted(self.definitions):
            if self.names[name] is not None and not self.names[name].startswith("="):
                self.definition(self.names[name], self.definitions[name])
        return "\n".join(self.out)

    def named(self, name: str) -> str:
        return self.names[name].removeprefix("=")

    def definition(self, name: str, schema: Schema) -> None:
        if "properties" in schema or "oneOf" in schema and not consts(schema):
            self.objects(name, schema)
        else:
            self.alias(name, self.type(name, schema), schema)

    def alias(self, name: str, what: str, schema: Schema) -> None:
        self.out.append(f"\n{name} = {what}\n{docstring(schema)}")

    def objects(self, name: str, schema: Schema) -> None:
        if "properties" in schema:
            self.typed_dict(name, schema, schema["properties"], set(schema.get("required", [])))
            return
        # One of several objects with one field each, and perhaps of some words.
        parts = schema["oneOf"]
        words = [part["const"] for part in parts if "const" in part]
        fields = {key: {"description": part.get("description", ""), **value}
                  for part in parts if "properties" in part for key, value in part["properties"].items()}
        if not words:
            self.typed_dict(name, schema, fields, set())
            return
        self.typed_dict(f"{name}Choice", schema, fields, set())
        self.alias(name, f"Union[{literal(words)}, {name}Choice]", schema)

    def typed_dict(self, name: str, schema: Schema, fields: Schema, required: set[str]) -> None:
        types = {field: self.type(f"{name}{camel(field)}", what) for field, what in fields.items()}
        always = [field for field in fields if field in required]
        at_times = [field for field in fields if field not in required]
        if any(keyword.iskeyword(field) for field in fields):
            pairs = ", ".join(f'"{field}": {json.dumps(types[field])}' for field in fields)
            total = "" if not at_times else ", total=False"
            self.out.append(f'\n{name} = TypedDict("{name}", {{{pairs}}}{total})\n{docstring(schema)}')
            return
        base = "TypedDict"
        if always and at_times:
            self.klass(f"_{name}Always", "TypedDict", "", always, types, fields)
            base, always = f"_{name}Always", []
        total = ", total=False" if at_times else ""
        self.klass(name, f"{base}{total}", schema.get("description", ""), always or at_times, types, fields)

    def klass(self, name: str, base: str, says: str, names: list[str], types: dict[str, str],
              fields: Schema) -> None:
        lines = [f"\nclass {name}({base}):"]
        if says:
            lines.append(indented(f'"""{clean(says)}"""'))
        for field in names:
            lines.append(f"    {field}: {types[field]}")
            if fields[field].get("description"):
                lines.append(indented(f'"""{clean(fields[field]["description"])}"""'))
        if len(lines) == 1:
            lines.append("    pass")
        self.out.append("\n".join(lines) + "\n")

    def type(self, name: str, schema: Schema) -> str:
        if "$ref" in schema:
            return self.named(schema["$ref"].rsplit("/", 1)[1])
        if words := consts(schema):
            return literal(words)
        if "anyOf" in schema:
            return " | ".join(self.type(name, part) for part in schema["anyOf"])
        kinds = schema.get("type", [])
        kinds = [kinds] if isinstance(kinds, str) else kinds
        return " | ".join(self.kind(name, kind, schema) for kind in kinds) or "Any"

    def kind(self, name: str, kind: str, schema: Schema) -> str:
        if kind == "array":
            return f"list[{self.type(name, schema.get('items', {}))}]"
        if kind == "object" and isinstance(schema.get("additionalProperties"), dict):
            return f"dict[str, {self.type(name, schema['additionalProperties'])}]"
        if kind == "object" and schema.get("properties"):
            self.objects(name, schema)
            return name
        if kind == "object":
            return "dict[str, Any]"
        return PLAIN[kind]


def consts(schema: Schema) -> list[str]:
    """The words of an enumeration; empty if it is none."""
    parts = schema.get("oneOf", [])
    words: list[str] = schema.get("enum", []) if not parts else []
    for part in parts:
        words = words + ([part["const"]] if "const" in part else part.get("enum", []))
    return words if all("const" in part or "enum" in part for part in parts) else []


def literal(words: list[str]) -> str:
    return f"Literal[{', '.join(json.dumps(word) for word in words)}]"


def camel(text: str) -> str:
    return "".join(part.capitalize() for part in text.split("_"))


def clean(text: str) -> str:
    return " ".join(text.replace("\\", "\\\\").split())


def docstring(schema: Schema) -> str:
    says = schema.get("description", "")
    return "\n".join(textwrap.wrap(f'"""{clean(says)}"""', 100)) + "\n" if says else ""


def indented(text: str) -> str:
    return "\n".join(textwrap.wrap(text, 96, initial_indent="    ", subsequent_indent="    "))


def made() -> str:
    """The text of messages.py."""
    schemas: dict[str, dict[str, Schema]] = json.loads(SCHEMAS.read_text("utf-8"))
    received, sent = schemas["received"], schemas["sent"]
    # What is sent may leave out what has a default: a type of its own where that makes a difference.
    differs = {name for name in sent if name in received and sent[name] != received[name]}
    names = {name: f"{name}Input" if name in differs else f"={name}" if name in received else name
             for name in sent}
    parts = [
        Generator(received, {name: name for name in received}, True).all(),
        Generator(sent, names, False).all(),
    ]
    return HEAD + "\n".join(parts)


def main() -> None:
    if sys.argv[1:] == ["--check"]:
        if MESSAGES.read_text("utf-8") != made():
            sys.exit("messages.py is not what generate_types.py makes of schemas.json: run it")
    else:
        MESSAGES.write_text(made(), "utf-8")


if __name__ == "__main__":
    main()
