"""Messages of either ROS world filled from plain values; `alula.common.plain` is the way back."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping
from typing import Any

from alula.runtime import fitting

_VECTOR_FIELDS = ["x", "y", "z"]


@dataclasses.dataclass(frozen=True)
class FieldTypes:
    """How one ROS version describes the fields of its messages, and names their types; any other type is a message's."""

    fields_of: Callable[[Any], dict[str, str]]
    """Returns the fields of a message or its class with their types."""
    message_class: Callable[[str], Any]
    """Returns the class of a message's type; raises ImportError or AttributeError."""
    element_of: Callable[[str], str]
    """Returns the type of a list's elements, "" where the type is no list's."""
    floats: Collection[str]
    integers: Mapping[str, fitting.Limits]
    classes: Mapping[str, type]
    """Types whose values are of one class: truth values and texts."""
    times: Mapping[str, type] = dataclasses.field(default_factory=dict)
    """Classes of times that are no messages; they are made of seconds and nanoseconds."""
    no_lists: tuple[type, ...] = (str, bytes)
    """Classes whose values can be iterated over and still are no lists."""

    def values_of(self, message: Any) -> dict[str, object]:
        """Return the values of a message's fields by name, not taken apart any further."""
        return {name: getattr(message, name) for name in self.fields_of(message)}

    def fill(self, message: Any, values: Mapping[str, object], place: str) -> Any:
        """Set the named fields of a message from plain values; return it.

        Numbers fit every numeric field that can hold them, a message or mapping fits a message, a sequence of three numbers
        fits a message with x, y and z.

        Raises:
            ValueError: a name or a value does not fit; the message names ``place`` and the field.
        """
        fields = self.fields_of(message)
        for name, value in values.items():
            fitting.check_name(name, fields, place)
            setattr(message, name, self._fitting(fields[name], value, f"{place}, {name}"))
        return message

    def _fitting(self, kind: str, value: Any, place: str) -> Any:
        """Return the value as the field's Python type."""
        if element := self.element_of(kind):
            return [self._fitting(element, part, where) for where, part in fitting.elements(value, kind, place, no_lists=self.no_lists)]
        if kind in self.floats:
            return float(fitting.number(value, kind, place))
        if kind in self.integers:
            return fitting.whole_number(value, kind, place, self.integers[kind])
        if kind in self.classes:
            return fitting.instance(self.classes[kind], value, kind, place)
        if kind in self.times:
            return _time(self.times[kind], value, kind, place)
        return self._message(kind, value, place)

    def _message(self, kind: str, value: Any, place: str) -> Any:
        wanted = self.message_class(kind)
        if isinstance(value, wanted):
            return value
        if isinstance(value, Mapping):
            return self.fill(wanted(), value, place)
        vector = list(self.fields_of(wanted)) == _VECTOR_FIELDS
        if vector and not isinstance(value, str) and hasattr(value, "__len__") and len(value) == len(_VECTOR_FIELDS):
            return self.fill(wanted(), dict(zip(_VECTOR_FIELDS, value, strict=True)), place)
        raise ValueError(f"{place} takes a {kind}{' or three numbers' if vector else ''}, not {value!r}")


def _time(wanted: type, value: Any, kind: str, place: str) -> Any:
    if isinstance(value, Mapping) and set(value) == {"sec", "nanosec"}:
        return wanted(value["sec"], value["nanosec"])
    return fitting.instance(wanted, value, kind, place)
