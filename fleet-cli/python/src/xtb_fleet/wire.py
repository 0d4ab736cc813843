"""Bytes from the wire into values, and back: bounds, finite numbers, harmless texts.

Everything that is received goes through :func:`read`. It is compared with the schemas that the messages' types are
made from: what a type promises is there. More fields and other words (a newer robot) are taken as they are, but for
numbers that are not finite and characters that could do something to a terminal or hide in a text.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from functools import lru_cache
from importlib import resources
from typing import Any

from .errors import Invalid, Malformed

MOST_BYTES = 64 * 1024
"""Of a message of a robot."""
MOST_BYTES_OF_TASKS = 4 * 1024 * 1024
"""Of a message of the dispatcher or the simulator."""

Check = Callable[[Any, str], Any]


def read(kind: str, payload: bytes, most: int = MOST_BYTES) -> Any:
    """A message of this type.

    Raises :class:`Malformed`.
    """
    if len(payload) > most:
        raise Malformed(f"{kind}: {len(payload)} bytes, at most {most} are read")
    try:
        value = json.loads(payload, parse_constant=_not_json)
        return _check(kind)(value, kind)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"{kind}: {escaped(str(error))[:200]}") from None


def write(message: Any) -> bytes:
    """A message in JSON; numbers must be finite."""
    try:
        return json.dumps(message, allow_nan=False, separators=(",", ":")).encode()
    except (TypeError, ValueError) as error:
        raise Invalid("usage", f"this cannot be sent: {error}") from None


def escaped(text: str) -> str:
    """The text with every character that is not seen as its escape: nothing clears a terminal or forges a line."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _not_json(word: str) -> Any:
    raise ValueError(f"{word} is not finite")


@lru_cache(maxsize=1)
def _received() -> dict[str, dict[str, Any]]:
    text = resources.files("xtb_fleet").joinpath("schemas.json").read_text("utf-8")
    definitions: dict[str, dict[str, Any]] = json.loads(text)["received"]
    return definitions


@lru_cache(maxsize=None)
def _check(name: str) -> Check:
    return _compiled(_received()[name])


def _compiled(schema: dict[str, Any]) -> Check:
    """A schema as a function: it returns the value with its texts escaped, or raises `ValueError`."""
    if "$ref" in schema:
        name = schema["$ref"].rsplit("/", 1)[1]
        return lambda value, place: _check(name)(value, place)  # at the first message: they refer to each other
    if "anyOf" in schema:
        parts = [part for part in schema["anyOf"] if part.get("type") != "null"]
        if len(parts) == 1:
            inner = _compiled(parts[0])
            return lambda value, place: None if value is None else inner(value, place)
        return _anything
    if "oneOf" in schema:
        return _one_of(schema["oneOf"])
    kinds = schema.get("type", [])
    if isinstance(kinds, list):
        plain = [kind for kind in kinds if kind != "null"]
        if len(plain) != 1:
            return _anything
        inner = _kind(plain[0], schema)
        return lambda value, place: None if value is None else inner(value, place)
    return _kind(kinds, schema)


def _kind(kind: str, schema: dict[str, Any]) -> Check:
    if kind == "array":
        return _array(_compiled(schema["items"])) if "items" in schema else _array(_anything)
    if kind == "object":
        return _object(schema)
    return {"number": _number, "integer": _integer, "boolean": _boolean, "string": _text}.get(kind, _anything)


def _one_of(parts: list[dict[str, Any]]) -> Check:
    """Words, or objects with one field each; other words and other fields than those of today are taken too."""
    words = any("const" in part or "enum" in part for part in parts)
    fields = {name: _compiled(inner) for part in parts for name, inner in part.get("properties", {}).items()}

    def check(value: Any, place: str) -> Any:
        if isinstance(value, str) and words:
            return _text(value, place)
        if not isinstance(value, dict) or not fields:
            raise ValueError(f"{place} is {_what(value)}")
        return {escaped(name): fields.get(name, _anything)(inner, f"{place}.{name}") for name, inner in value.items()}

    return check


def _object(schema: dict[str, Any]) -> Check:
    if isinstance(schema.get("additionalProperties"), dict):
        each = _compiled(schema["additionalProperties"])

        def check_each(value: Any, place: str) -> Any:
            if not isinstance(value, dict):
                raise ValueError(f"{place} is {_what(value)}")
            return {escaped(name): each(inner, place) for name, inner in value.items()}

        return check_each
    fields = {name: _compiled(inner) for name, inner in schema.get("properties", {}).items()}
    required = frozenset(schema.get("required", ()))

    def check(value: Any, place: str) -> Any:
        if not isinstance(value, dict):
            raise ValueError(f"{place} is {_what(value)}")
        if not required <= value.keys():
            raise ValueError(f"{place} lacks {', '.join(sorted(required - value.keys()))}")
        return {
            name if name in fields else escaped(name): fields.get(name, _anything)(inner, name)
            for name, inner in value.items()
        }

    return check


def _array(each: Check) -> Check:
    def check(value: Any, place: str) -> Any:
        if not isinstance(value, list):
            raise ValueError(f"{place} is {_what(value)}")
        return [each(inner, place) for inner in value]

    return check


def _number(value: Any, place: str) -> Any:
    if type(value) is float and math.isfinite(value) or type(value) is int and abs(value) < 1 << 64:
        return value
    raise ValueError(f"{place} is {_what(value)}")


def _integer(value: Any, place: str) -> Any:
    if type(value) is int and abs(value) < 1 << 64:
        return value
    raise ValueError(f"{place} is {_what(value)}")


def _boolean(value: Any, place: str) -> Any:
    if isinstance(value, bool):
        return value
    raise ValueError(f"{place} is {_what(value)}")


def _text(value: Any, place: str) -> Any:
    if isinstance(value, str):
        return escaped(value)
    raise ValueError(f"{place} is {_what(value)}")


def _anything(value: Any, place: str) -> Any:
    """What the schemas of today do not know."""
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, (int, float)):
        return _number(value, place)
    if isinstance(value, str):
        return escaped(value)
    if isinstance(value, list):
        return [_anything(inner, place) for inner in value]
    return {escaped(name): _anything(inner, place) for name, inner in value.items()}


def _what(value: Any) -> str:
    return escaped(repr(value))[:60]
