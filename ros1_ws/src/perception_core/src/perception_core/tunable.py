"""Settings with a range and a description; one definition serves start-up, checks and dynamic_reconfigure."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Number = TypeVar("Number", int, float)
KEY = "tunable"


class SettingsError(ValueError):
    """A parameter is unknown, of the wrong type or out of range."""


@dataclass(frozen=True)
class Range:
    """The range within which a setting may be changed while the node runs, and its meaning."""

    low: float
    high: float
    doc: str


def tunable(default: Number, low: Number, high: Number, doc: str) -> Number:
    """Return a dataclass field of a number that may be changed within a range, both ends included."""
    made: Number = field(default=default, metadata={KEY: Range(low, high, doc)})
    return made


def ranges(settings: DataclassInstance | type[DataclassInstance]) -> dict[str, Range]:
    """Return the ranges of the tunable fields, in their order."""
    return {f.name: f.metadata[KEY] for f in fields(settings) if KEY in f.metadata}


def check_ranges(settings: DataclassInstance) -> None:
    """Raise SettingsError naming the first field that is out of its range."""
    for name, allowed in ranges(settings).items():
        value = getattr(settings, name)
        if not allowed.low <= value <= allowed.high:
            raise SettingsError(f"~{name} is {value!r}, expected {allowed.low:g} to {allowed.high:g} ({allowed.doc})")
