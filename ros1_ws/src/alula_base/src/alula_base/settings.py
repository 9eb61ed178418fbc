"""What the robot's owner configures: which heartbeats, how long they may be silent, and what is called then. No ROS."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any, Callable, TypeVar, Union

from alula_base.errors import ConfigError

NAME = re.compile(r"[~/]?[A-Za-z]\w*(/\w+)*")
TYPE = re.compile(r"\w+/\w+")
LONGEST_S = 3600.0
Check = Callable[[str, Any], Any]
"""Takes the parameter's name and its value; returns what it stands for, or raises ConfigError."""


def _name(where: str, value: object) -> str:
    if not isinstance(value, str) or not NAME.fullmatch(value):
        raise ConfigError(f"{where} is {value!r}, expected a name on the graph, as /base/stop")
    return value


def _word(where: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{where} is {value!r}, expected a word")
    return value


def _type(where: str, value: object) -> str:
    if not isinstance(value, str) or not TYPE.fullmatch(value):
        raise ConfigError(f"{where} is {value!r}, expected a service's type, as std_srvs/SetBool")
    return value


def _positive(where: str, value: object) -> float:
    number = float(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else math.nan
    if not 0.0 < number <= LONGEST_S:
        raise ConfigError(f"{where} is {value!r}, expected a number above 0, of at most {LONGEST_S:g}")
    return number


def _from_zero(where: str, value: object) -> float:
    return 0.0 if value == 0 and not isinstance(value, bool) else _positive(where, value)


def _mapping(where: str, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ConfigError(f"{where} is {value!r}, expected keys and values")
    return value


def _list_of(check: Check) -> Check:
    def read(where: str, value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not value:
            raise ConfigError(f"{where} is {value!r}, expected a list that is not empty")
        return tuple(check(f"{where}[{index}]", one) for index, one in enumerate(value))

    return read


def _key(check: Check, default: Any = MISSING) -> Any:
    """Return a field that is read from the parameter of its name; without a default it is needed."""
    return field(metadata={"check": check}) if default is MISSING else field(default=default, metadata={"check": check})


AFTER_S = 0.0
"""For so long must the silence last on before a call is made; by default it is made at once."""


@dataclass(frozen=True)
class ServiceSettings:
    """Call a service, again until it answers, for ``within_s``; an answer whose ``success`` or ``accepted`` is false is none."""

    service: str = _key(_name)
    type: str = _key(_type)
    request: Mapping[str, Any] = field(default_factory=dict, metadata={"check": _mapping})
    within_s: float = _key(_positive, 2.0)
    after_s: float = _key(_from_zero, AFTER_S)


@dataclass(frozen=True)
class ZeroSettings:
    """Publish a geometry_msgs/Twist of zeros on a topic, ``rate_hz`` times a second for ``for_s``, or until the heartbeat is back."""

    zero: str = _key(_name)
    rate_hz: float = _key(_positive, 10.0)
    for_s: float = _key(_positive, 5.0)
    after_s: float = _key(_from_zero, AFTER_S)


@dataclass(frozen=True)
class CancelSettings:
    """Cancel all goals of an action, again until its server says that none is left, for ``within_s``."""

    cancel: str = _key(_name)
    within_s: float = _key(_positive, 5.0)
    after_s: float = _key(_from_zero, AFTER_S)


@dataclass(frozen=True)
class ScriptSettings:
    """Run a program with its arguments, without a shell; it is killed with all that it started after ``within_s``."""

    script: tuple[str, ...] = _key(_list_of(_word))
    within_s: float = _key(_positive, 10.0)
    after_s: float = _key(_from_zero, AFTER_S)


CallSettings = Union[ServiceSettings, ZeroSettings, CancelSettings, ScriptSettings]
KINDS: dict[str, type[CallSettings]] = {
    "service": ServiceSettings,
    "zero": ZeroSettings,
    "cancel": CancelSettings,
    "script": ScriptSettings,
}
"""By the key that says what is called."""


@dataclass(frozen=True)
class ReportSettings:
    """Report to a skillset in which state a resource is (its extern transitions): while all is heard, and from a silence on."""

    skillset: str = _key(_word)
    resource: str = _key(_word)
    heard: str = _key(_word)
    silent: str = _key(_word)


def _call(where: str, value: object) -> CallSettings:
    given = _mapping(where, value)
    kinds = [key for key in KINDS if key in given]
    if len(kinds) != 1:
        raise ConfigError(f"{where} has {' and '.join(kinds) or 'nothing to call'}, expected one of {', '.join(KINDS)}")
    return _read(where, given, KINDS[kinds[0]])


def _calls(where: str, value: object) -> dict[str, CallSettings]:
    given = _mapping(where, value)
    if not given:
        raise ConfigError(f"{where} is empty, expected what is called when nothing is heard, by name")
    return {name: _call(f"{where}/{name}", one) for name, one in given.items()}


def _report(where: str, value: object) -> ReportSettings:
    return _read(where, _mapping(where, value), ReportSettings)


@dataclass(frozen=True)
class Settings:
    """The private parameters of the node.

    Attributes:
        heartbeats: topics of any type.
        stop: what is called when one of them is silent, by name.
        silent_after_s: so long may nothing be heard of each.
        report: None: no skillset is told.
    """

    heartbeats: tuple[str, ...] = _key(_list_of(_name))
    stop: Mapping[str, CallSettings] = _key(_calls)
    silent_after_s: float = _key(_positive, 2.0)
    report: ReportSettings | None = field(default=None, metadata={"check": _report})


SettingsT = TypeVar("SettingsT")


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Read the node's private parameters.

    Raises:
        ConfigError: one is missing, unknown or wrong.
    """
    return _read("~", given, Settings)


def _read(where: str, given: Mapping[str, Any], kind: type[SettingsT]) -> SettingsT:
    """Read a group of parameters as their dataclass."""
    prefix = where if where == "~" else f"{where}/"
    known = {one.name: one for one in fields(kind)}  # type: ignore[arg-type]  # a dataclass
    unknown = sorted(given.keys() - known.keys())
    if unknown:
        raise ConfigError(f"unknown parameter {prefix}{unknown[0]}; known: {', '.join(known)}")
    needed = (one.name for one in known.values() if one.default is MISSING and one.default_factory is MISSING)
    missing = [name for name in needed if name not in given]
    if missing:
        raise ConfigError(f"parameter {prefix}{missing[0]} is missing")
    return kind(**{name: known[name].metadata["check"](f"{prefix}{name}", value) for name, value in given.items()})
