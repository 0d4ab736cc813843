"""Which router, which fleet, as whom: arguments, environment, identity and configuration file, as the programs."""

from __future__ import annotations

import os
import re
import secrets
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .errors import Invalid, NotAllowed

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found,unused-ignore]

DEFAULT_ENDPOINT = "tcp/127.0.0.1:7447"
DEFAULT_FLEET = "lab"
DEFAULT_TIMEOUT_S = 3.0
MOST_BYTES_OF_A_FILE = 1 << 20
TIMEOUT_MOST_S = 3600.0

_NAME = re.compile(r"[a-z0-9-]{1,32}")
_RESERVED = {"all", "sim", "dispatch", "traffic", "map", "identity"}
_TLS = "tls/"
_WITHOUT = "identity=None with XTB_IDENTITY= (empty), or identity='none', goes without the identity"
_ALLOWS = {
    "robot": "may be driven, under its own name",
    "viewer": "may look and call an emergency stop",
    "operator": "may look, drive, change tasks and the map, fetch recordings and call an emergency stop",
    "dashboard": "may serve the page, and do for its users what an operator may",
    "dispatcher": "may look, run a dispatcher and drive robots for its tasks",
    "traffic": "may look and run traffic control",
    "map": "may look and serve the map",
    "tracker": "may publish pose fixes",
    "recorder": "may look and record",
    "simulator": "may simulate robots",
    "router": "may route",
}
_MAY = {
    "look": {"viewer", "operator", "dashboard", "dispatcher", "traffic", "map", "recorder"},
    "call an emergency stop": {"viewer", "operator", "dashboard"},
    "control robots": {"operator", "dashboard"},
    "change tasks": {"operator", "dashboard"},
}


def check_name(text: str, what: str) -> str:
    """A name that can stand in a key."""
    if not isinstance(text, str) or not _NAME.fullmatch(text):
        raise Invalid("usage", f"{text!r} cannot be the name of a {what}", "1 to 32 of a-z 0-9 -")
    return text


def check_robot(text: str) -> str:
    """A robot's name."""
    check_name(text, "robot")
    if text in _RESERVED or text.startswith("-"):
        raise Invalid("usage", f"{text!r} cannot be the name of a robot")
    return text


@dataclass(frozen=True)
class Identity:
    """Who this program is to the router."""

    folder: Path
    fleet: str
    name: str
    role: str
    generation: int
    routers: tuple[str, ...]

    @property
    def stem(self) -> str:
        """What the names of its sessions begin with."""
        return {"dashboard": "web", "dispatcher": "dispatch"}.get(self.role, self.name)

    def file(self, name: str) -> Path:
        """One of `ca.pem`, `certificate.pem`, `key.pem`."""
        return self.folder / name


@dataclass(frozen=True)
class Settings:
    """How to reach a fleet, and as whom."""

    endpoints: tuple[str, ...]
    fleet: str
    client: str
    identity: Identity | None = None
    timeout_s: float = DEFAULT_TIMEOUT_S
    roster: tuple[str, ...] = field(default=())

    def may(self, action: str) -> None:
        """Raises :class:`NotAllowed` if the identity's role does not have this; asks nobody."""
        if self.identity is None or self.identity.role in _MAY[action]:
            return
        name, role = self.identity.name, self.identity.role
        message = f"{name} has the role {role}: {_ALLOWS.get(role, 'unknown to this release')}"
        raise NotAllowed("not_allowed", message, f"an operator can {action}: `fleet-cli pki add-person` adds one")


def resolve(
    endpoint: str | list[str] | None,
    fleet: str | None,
    name: str | None,
    identity: str | os.PathLike[str] | None,
    timeout_s: float,
) -> Settings:
    """Arguments over environment over identity over configuration file over defaults."""
    config = _config()
    own = _identity(identity)
    endpoints = [endpoint] if isinstance(endpoint, str) else list(endpoint or [])
    endpoints = endpoints or [part for part in os.environ.get("XTB_CONNECT", "").split(",") if part]
    endpoints = endpoints or list(own.routers if own else config.get("connect", [])) or [DEFAULT_ENDPOINT]
    _check_endpoints(endpoints, own)
    named = fleet or os.environ.get("XTB_FLEET") or config.get("fleet")
    if own and named and named != own.fleet:
        raise Invalid(
            "usage", f"fleet {named} is asked for, but the identity of {own.name} is of fleet {own.fleet}", _WITHOUT
        )
    stem = own.stem if own else "python"
    if name is not None and own and name != stem and not name.startswith(f"{stem}-"):
        raise Invalid("usage", f"{name} is not a name of {own.name}", f"it is {stem}, or begins with {stem}-")
    client = name or f"{stem}-{secrets.token_hex(3)}"
    if not 0 < timeout_s <= TIMEOUT_MOST_S:
        raise Invalid("usage", f"a timeout of {timeout_s} s: above 0, at most {TIMEOUT_MOST_S:.0f} s")
    return Settings(
        endpoints=tuple(endpoints),
        fleet=check_name(own.fleet if own else named or DEFAULT_FLEET, "fleet"),
        client=check_name(client, "client"),
        identity=own,
        timeout_s=timeout_s,
        roster=tuple(check_robot(robot["name"]) for robot in config.get("robots", [])),
    )


def _check_endpoints(endpoints: list[str], own: Identity | None) -> None:
    for each in endpoints:
        if own and not each.startswith(_TLS):
            raise Invalid("usage", f"{each} has no TLS: the identity of {own.name} is not used there", _WITHOUT)
        if not own and each.startswith(_TLS):
            hint = "`fleet-cli enrol NAME.xtbid` makes one; identity=DIR names its folder"
            raise Invalid("usage", f"{each} needs an identity, and there is none", hint)


def _home() -> Path | None:
    """`~/.config/xtb`."""
    for name, below in (("XDG_CONFIG_HOME", ""), ("HOME", ".config")):
        base = Path(os.environ.get(name, ""))
        if base.is_absolute():
            return base / below / "xtb"
    return None


def _text(path: Path) -> str:
    try:
        if not path.is_file() or path.stat().st_size > MOST_BYTES_OF_A_FILE:
            raise Invalid("config", f"{path} is not a file that can be read")
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise Invalid("config", f"cannot read {path}: {error}") from None


def _toml(path: Path) -> dict[str, Any]:
    try:
        values: dict[str, Any] = tomllib.loads(_text(path))
        return values
    except tomllib.TOMLDecodeError as error:
        raise Invalid("config", f"in {path}: {error}") from None


def _config() -> dict[str, Any]:
    named = os.environ.get("XTB_CONFIG")
    home = _home()
    path = Path(named) if named else home / "fleet.toml" if home else None
    if path is None or not (named or path.exists()):
        return {}
    config = _toml(path)
    robots = config.get("robots", [])
    good = (
        config.keys() <= {"fleet", "connect", "robots", "aliases"}
        and isinstance(config.get("fleet", ""), str)
        and _texts(config.get("connect", []))
        and isinstance(robots, list)
        and all(isinstance(robot, dict) and isinstance(robot.get("name"), str) for robot in robots)
    )
    if not good:
        raise Invalid("config", f"{path} is not a fleet config", "`fleet-cli doctor` says what is wrong in it")
    return config


def _texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(each, str) for each in value)


def _identity(named: str | os.PathLike[str] | None) -> Identity | None:
    if named is None and "XTB_IDENTITY" in os.environ:
        named = os.environ["XTB_IDENTITY"] or "none"
    if named is not None:
        return None if os.fspath(named) in ("", "none") else _enrolled(Path(named))
    home = _home()
    folder = home / "identity" if home else None
    return _enrolled(folder) if folder and (folder / "identity.toml").exists() else None


def _enrolled(folder: Path) -> Identity:
    hint = "`fleet-cli enrol NAME.xtbid` makes an identity's folder; identity='none' goes without"
    try:
        facts = _toml(folder / "identity.toml")
        for name in ("ca.pem", "certificate.pem", "key.pem"):
            _text(folder / name)
    except Invalid as error:
        raise Invalid("config", f"the identity cannot be used: {error.message}", hint) from None
    texts = all(isinstance(facts.get(key), str) for key in ("fleet", "name", "role"))
    generation = facts.get("generation")
    if facts.get("version") != 1 or not texts or type(generation) is not int or not _texts(facts.get("routers")):
        raise Invalid("config", f"{folder} holds no identity that this release can read", hint)
    return Identity(
        folder=folder.absolute(),
        fleet=facts["fleet"],
        name=check_name(facts["name"], "person or service"),
        role=facts["role"],
        generation=generation,
        routers=tuple(facts["routers"]),
    )
