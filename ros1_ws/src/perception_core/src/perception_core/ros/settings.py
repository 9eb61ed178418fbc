"""A node's private parameters as a frozen dataclass: defaults in code, types and ranges checked, unknown names refused."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from typing import TYPE_CHECKING, TypeVar

import rospy

from perception_core.tunable import SettingsError, check_ranges

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Settings = TypeVar("Settings", bound=DataclassInstance)


def read_settings(defaults: Settings) -> Settings:
    """Return the defaults with the parameter server's values for the node; a wrong value is logged, and ends the process with 2."""
    try:
        return override(defaults, rospy.get_param("~", {}))
    except SettingsError as error:
        rospy.logfatal("%s", error)
        sys.exit(2)


def override(defaults: Settings, given: dict[str, object]) -> Settings:
    """Return the defaults with these values; an int serves where a float is expected."""
    known = {field.name: getattr(defaults, field.name) for field in fields(defaults)}
    unknown = sorted(given.keys() - known.keys())
    if unknown:
        raise SettingsError(f"unknown parameter ~{unknown[0]}; known: {', '.join(sorted(known))}")
    checked = {name: _checked(name, value, known[name]) for name, value in given.items()}
    changed = replace(defaults, **checked)
    check_ranges(changed)
    return changed


def _checked(name: str, value: object, default: object) -> object:
    if isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if type(value) is not type(default):
        raise SettingsError(f"~{name} is {value!r}, expected a {type(default).__name__} like {default!r}")
    return value
