"""dynamic_reconfigure for a node's settings: the ranges are those of the settings' definition, what is out of them is refused."""

from __future__ import annotations

from dataclasses import asdict, fields, replace
from types import SimpleNamespace
from typing import TYPE_CHECKING, Generic, TypeVar

import rospy
from dynamic_reconfigure.server import Server

from perception_core.tunable import Range, SettingsError, check_ranges, ranges

if TYPE_CHECKING:
    from collections.abc import Callable

    from _typeshed import DataclassInstance

    Settings = TypeVar("Settings", bound=DataclassInstance)
else:
    Settings = TypeVar("Settings")

KINDS = {float: "double", int: "int", bool: "bool", str: "str"}


class TunableSettings(Generic[Settings]):
    """Serve ``~set_parameters``: check a change as a whole, hand the new settings to ``apply``, publish ``~parameter_updates``.

    The tools of dynamic_reconfigure (rqt_reconfigure, dynparam) work with it. A value out of its range is refused with a sentence, and
    nothing is changed; the usual server would take the nearest value that is allowed.
    """

    def __init__(self, settings: Settings, apply: Callable[[Settings], None]) -> None:
        self._settings, self._apply = settings, apply
        self._started = False
        self._server = _RefusingServer(description(settings), self._on_change)
        self._started = True

    def _on_change(self, config: dict[str, object], _level: int) -> dict[str, object]:
        unknown = sorted(config.keys() - ranges(self._settings).keys() - {"groups"})
        if unknown:
            raise SettingsError(f"~{unknown[0]} can't be changed; these can: {', '.join(ranges(self._settings))}")
        wanted = {name: type(getattr(self._settings, name))(config[name]) for name in ranges(self._settings)}
        changed = replace(self._settings, **wanted)
        check_ranges(changed)
        if self._started and changed != self._settings:
            different = {name: value for name, value in wanted.items() if value != getattr(self._settings, name)}
            rospy.loginfo(f"parameters changed: {different}")
            self._apply(changed)
        self._settings = changed
        return config


class _RefusingServer(Server):  # type: ignore[misc]  # the package has no types
    """The package's server without its clamping: what is out of range goes to the callback, which refuses it."""

    def _clamp(self, config: dict[str, object]) -> None:
        """Leave the values as they were given."""


def description(settings: DataclassInstance) -> SimpleNamespace:
    """Return the tunable fields in the form of the module that dynamic_reconfigure's generator would write."""
    known = ranges(settings)
    values = {name: value for name, value in asdict(settings).items() if name in known}
    parameters = [_parameter(f.name, getattr(settings, f.name), known[f.name]) for f in fields(settings) if f.name in known]
    group = {"name": "Default", "type": "", "state": True, "cstate": "true", "id": 0, "parent": 0, "field": "default", "groups": []}
    names = {"upper": "DEFAULT", "lower": "groups", "class": "DEFAULT", "parentname": "", "parentclass": ""}
    return SimpleNamespace(
        defaults=values,
        min={name: _as(values[name], allowed.low) for name, allowed in known.items()},
        max={name: _as(values[name], allowed.high) for name, allowed in known.items()},
        level=dict.fromkeys(known, 0),
        type={parameter["name"]: parameter["type"] for parameter in parameters},
        all_level=0,
        config_description={**group, **names, "parameters": parameters},
    )


def _as(like: object, value: float) -> object:
    return int(value) if isinstance(like, int) else float(value)


def _parameter(name: str, default: object, allowed: Range) -> dict[str, object]:
    return {
        "name": name,
        "type": KINDS[type(default)],
        "level": 0,
        "description": allowed.doc,
        "default": default,
        "min": _as(default, allowed.low),
        "max": _as(default, allowed.high),
        "edit_method": "",
    }
