"""Put the fields of a ROS 1 type and a ROS 2 type side by side: the same layout, or a plan that fills one from the other.

Rules, in this order: fields that a mapping names; then fields of the same name (letter case and trailing underscores aside). Fields
that only one of the two types has stay at zero in one direction and are lost in the other; where both have such fields, only
the user knows whether they are the same, and the pair is refused. Kinds of fields have to agree, except for single numbers in a mapping.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from rosbags.interfaces import Nodetype

from ros_bridge.errors import TypeDiffersError

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc
    from rosbags.typesys.store import Typestore

    from ros_bridge.mapping import TypeRules

PADDING = "structure_needs_at_least_one_member"  # ROS 2 gives an empty message one byte
HEADER = "std_msgs/msg/Header"
ALIASES = {"char": "uint8", "byte": "uint8", "octet": "uint8"}
NUMPY_OF_BYTES = {"byte": "uint8", "char": "uint8", "octet": "uint8"}
NUMBERS = frozenset({"int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64", "float32", "float64", "bool"})
Path = tuple[str, ...]
Convert = Callable[[Any], Any]


def msg_name(name: str) -> str:
    """Return ``package/msg/Name`` of ``package/Name``."""
    package, short = name.split("/")
    return f"{package}/msg/{short}"


def plain_name(name: str) -> str:
    """Return ``package/Name`` of ``package/msg/Name``."""
    package, _, short = name.split("/")
    return f"{package}/{short}"


@dataclass(frozen=True)
class Leaf:
    """A pair of fields by their paths in ROS 1 and ROS 2, and how a value gets from one to the other."""

    ros1: Path
    ros2: Path
    to_ros2: Convert
    to_ros1: Convert


@dataclass(frozen=True)
class Plan:
    """How objects of two types are filled from each other, and which fields have no counterpart."""

    ros1_type: str
    ros2_type: str
    leaves: tuple[Leaf, ...]
    only_ros1: tuple[str, ...]
    only_ros2: tuple[str, ...]


class Pairing:
    """Compares types of the two stores, in which they and their parts have to be registered."""

    def __init__(self, ros1: Typestore, ros2: Typestore, rules: TypeRules) -> None:
        self._ros1 = ros1
        self._ros2 = ros2
        self._rules = rules
        self._plans: dict[tuple[str, str], Plan] = {}

    def same_layout(self, ros1_type: str, ros2_type: str) -> bool:
        """Tell whether both put the same kinds of fields in the same order; names may differ, and ``Header.seq`` is known."""
        name1, name2 = msg_name(ros1_type), msg_name(ros2_type)
        if name1 == name2 == HEADER:
            return True
        if self._rules.fields(ros1_type, ros2_type):
            return False
        fields1, fields2 = self._ros1.fielddefs[name1][1], self._ros2.fielddefs[name2][1]
        return len(fields1) == len(fields2) and all(self._same_kind(one, two) for (_, one), (_, two) in zip(fields1, fields2, strict=True))

    def _same_kind(self, one: FieldDesc, two: FieldDesc) -> bool:
        if one[0] != two[0]:
            return False
        if one[0] == Nodetype.BASE:
            return shape(one) == shape(two)
        if one[0] == Nodetype.NAME:
            name1, name2 = str(one[1]), str(two[1])
            if "builtin_interfaces" in {name1.split("/", maxsplit=1)[0], name2.split("/", maxsplit=1)[0]}:
                return name1 == name2
            return self._related(name1, name2) and self.same_layout(plain_name(name1), plain_name(name2))
        element1, length1 = cast("tuple[FieldDesc, int]", one[1])
        element2, length2 = cast("tuple[FieldDesc, int]", two[1])
        return self._same_kind(element1, element2) and (one[0] == Nodetype.SEQUENCE or length1 == length2)

    def _related(self, name1: str, name2: str) -> bool:
        return name1 == name2 or self._rules.related(plain_name(name1), plain_name(name2))

    def plan(self, ros1_type: str, ros2_type: str) -> Plan:
        """Return how the two are filled from each other.

        Raises:
            TypeDiffersError: They can't be; the message names the field, and what to write into a mapping.
        """
        key = (ros1_type, ros2_type)
        if key not in self._plans:
            self._plans[key] = self._make_plan(ros1_type, ros2_type)
        return self._plans[key]

    def _make_plan(self, ros1_type: str, ros2_type: str) -> Plan:
        told = self._rules.fields(ros1_type, ros2_type)
        leaves = [self._told_leaf(ros1_type, ros2_type, *pair) for pair in told.items() if pair[1]]
        names1 = self._open_names(self._ros1, ros1_type, told.keys())
        names2 = self._open_names(self._ros2, ros2_type, [path for path in told.values() if path])
        common = [key for key in names1 if key in names2]
        leaves += [self._leaf(ros1_type, ros2_type, (names1.pop(key),), (names2.pop(key),)) for key in common]
        if names1 and names2:
            one, two = next(iter(names1.values())), next(iter(names2.values()))
            raise TypeDiffersError(
                f"message type {_both(ros1_type, ros2_type)} differs: only ROS 1 has field '{one}' and only ROS 2 has field '{two}'; "
                f"say in the configuration's 'types' whether they are the same (fields: {{{one}: {two}}}), or leave it out ({{{one}: ''}})",
            )
        return Plan(ros1_type, ros2_type, tuple(leaves), tuple(names1.values()), tuple(names2.values()))

    def _open_names(self, store: Typestore, name: str, told: object) -> dict[str, str]:
        """Return the fields that no mapping has touched, by the name under which they are compared."""
        touched = {path.split(".")[0].rstrip("_").lower() for path in cast("list[str]", told)}
        fields = [field for field, _ in store.fielddefs[msg_name(name)][1] if field != PADDING]
        return {key: field for field in fields if (key := field.rstrip("_").lower()) not in touched}

    def _told_leaf(self, ros1_type: str, ros2_type: str, path1: str, path2: str) -> Leaf:
        return self._leaf(ros1_type, ros2_type, tuple(path1.split(".")), tuple(path2.split(".")), told=True)

    def _leaf(self, ros1_type: str, ros2_type: str, path1: Path, path2: Path, *, told: bool = False) -> Leaf:
        kind1 = field_kind(self._ros1, ros1_type, path1, "ROS 1")
        kind2 = field_kind(self._ros2, ros2_type, path2, "ROS 2")
        converters = self._converters(kind1, kind2, told=told)
        if converters is None:
            raise TypeDiffersError(
                f"message type {_both(ros1_type, ros2_type)} differs: field '{'.'.join(path1)}' is {shape(kind1)} in ROS 1, "
                f"'{'.'.join(path2)}' is {shape(kind2)} in ROS 2",
            )
        return Leaf(path1, path2, *converters)

    def _converters(self, one: FieldDesc, two: FieldDesc, *, told: bool) -> tuple[Convert, Convert] | None:
        """Return how a value goes to ROS 2 and back; None when it can't."""
        if one[0] == Nodetype.NAME and two[0] == Nodetype.NAME:
            return self._nested(str(one[1]), str(two[1]), told=told)
        if one[0] == Nodetype.BASE and two[0] == Nodetype.BASE:
            if shape(one) == shape(two):
                return _same, _same
            numbers = shape(one) in NUMBERS and shape(two) in NUMBERS
            return (_number(shape(two)), _number(shape(one))) if told and numbers else None
        if one[0] != two[0]:
            return None
        element1, length1 = cast("tuple[FieldDesc, int]", one[1])
        element2, length2 = cast("tuple[FieldDesc, int]", two[1])
        if one[0] == Nodetype.ARRAY and length1 != length2:
            return None
        inner = self._converters(element1, element2, told=False)
        if inner is None or inner[0] is _same:
            return inner
        return _each(inner[0]), _each(inner[1])

    def _nested(self, name1: str, name2: str, *, told: bool) -> tuple[Convert, Convert] | None:
        if "builtin_interfaces" in {name1.split("/", maxsplit=1)[0], name2.split("/", maxsplit=1)[0]}:
            return (_same, _same) if name1 == name2 else None
        if not told and not self._related(name1, name2):
            return None
        plan = self.plan(plain_name(name1), plain_name(name2))
        return (lambda value: self.to_ros2(plan, value)), (lambda value: self.to_ros1(plan, value))

    def to_ros2(self, plan: Plan, source: object) -> object:
        """Return a ROS 2 object of what a ROS 1 object has."""
        target = blank(self._ros2, msg_name(plan.ros2_type))
        for leaf in plan.leaves:
            _put(target, leaf.ros2, leaf.to_ros2(_get(source, leaf.ros1)))
        return target

    def to_ros1(self, plan: Plan, source: object) -> object:
        """Return a ROS 1 object of what a ROS 2 object has."""
        target = blank(self._ros1, msg_name(plan.ros1_type))
        for leaf in plan.leaves:
            _put(target, leaf.ros1, leaf.to_ros1(_get(source, leaf.ros2)))
        return target


def _both(ros1_type: str, ros2_type: str) -> str:
    return ros1_type if ros1_type == ros2_type else f"{ros1_type} (ROS 2: {ros2_type})"


def field_kind(store: Typestore, name: str, path: Path, world: str) -> FieldDesc:
    """Return the kind of the field at a path of a type; raises TypeDiffersError when there is none."""
    fields: Mapping[str, FieldDesc] = dict(store.fielddefs[msg_name(name)][1])
    key = next((field for field in fields if field.rstrip("_").lower() == path[0].rstrip("_").lower()), None)
    if key is None:
        raise TypeDiffersError(f"message type {name}: a mapping names field '{path[0]}', which it does not have in {world}")
    if len(path) == 1:
        return fields[key]
    if fields[key][0] != Nodetype.NAME:
        raise TypeDiffersError(f"message type {name}: a mapping goes into field '{key}' ({shape(fields[key])}), which is no message")
    return field_kind(store, plain_name(str(fields[key][1])), path[1:], world)


def shape(field: FieldDesc) -> str:
    """Name a field's kind without what does not change its bytes: bounds, and char and byte for uint8."""
    kind, inner = field
    if kind == Nodetype.BASE:
        base = cast("tuple[str, int]", inner)[0]
        return ALIASES.get(base, base)
    if kind == Nodetype.NAME:
        return plain_name(str(inner))
    element, length = cast("tuple[FieldDesc, int]", inner)
    return f"{shape(element)}[{length if kind == Nodetype.ARRAY else ''}]"


def blank(store: Typestore, name: str) -> object:
    """Return an object of a type with all fields zero, empty or false."""
    values = [_zero(store, kind) for _, kind in store.fielddefs[name][1]]
    return store.types[name](*cast("list[Any]", values))


def _zero(store: Typestore, field: FieldDesc) -> object:
    kind, inner = field
    if kind == Nodetype.NAME:
        return blank(store, str(inner))
    if kind == Nodetype.BASE:
        base = cast("tuple[str, int]", inner)[0]
        return {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}.get(base, 0)
    element, length = cast("tuple[FieldDesc, int]", inner)
    number = length if kind == Nodetype.ARRAY else 0
    base = cast("tuple[str, int]", element[1])[0] if element[0] == Nodetype.BASE else ""
    if base and base != "string":
        return np.zeros(number, dtype=NUMPY_OF_BYTES.get(base, base))
    return [_zero(store, element) for _ in range(number)]


def _same(value: object) -> object:
    return value


def _number(kind: str) -> Convert:
    return bool if kind == "bool" else float if kind.startswith("float") else int


def _each(convert: Convert) -> Convert:
    return lambda values: [convert(value) for value in values]


def _get(source: object, path: Path) -> object:
    for name in path:
        source = getattr(source, _attribute(source, name))
    return source


def _put(target: object, path: Path, value: object) -> None:
    for name in path[:-1]:
        target = getattr(target, _attribute(target, name))
    object.__setattr__(target, _attribute(target, path[-1]), value)


def _attribute(source: object, name: str) -> str:
    """Return the attribute of a field: as it is, or as rosbags spells a name that is a keyword or has another case in its stores."""
    if hasattr(source, name):
        return name
    wanted = name.rstrip("_").lower()
    return next(field.name for field in dataclasses.fields(source) if field.name.rstrip("_").lower() == wanted)  # type: ignore[arg-type]
