"""Put the fields of a ROS 1 type and a ROS 2 type side by side: the same layout, or a plan that fills one from the other.

Fields that a mapping names come first, then fields of the same name (letter case and underscores aside). Fields of different
names are one field only where all kinds agree, place by place, and neither name stands at another place: then it was renamed. Fields
that only one of the two types has stay at zero in one direction and are lost in the other; where both have such fields, only
the user knows whether they are the same, and the pair is refused. Kinds of fields have to agree, except for single numbers in a mapping.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

from rosbags.interfaces import Nodetype

from ros_bridge.errors import TypeDiffersError
from ros_bridge.layout import HEADER
from ros_bridge.names import msg_name, plain_name
from ros_bridge.values import Codec, fields_of

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict

    from ros_bridge.mapping import TypeRules

ALIASES = {"char": "uint8", "byte": "uint8", "octet": "uint8"}
NUMBERS = {"bool": "<?", "int8": "<b", "uint8": "<B", "float32": "<f", "float64": "<d"}
NUMBERS |= {
    f"{sign}int{bits}": f"<{code.upper() if sign else code}" for sign in ("", "u") for bits, code in ((16, "h"), (32, "i"), (64, "q"))
}
TIMES = "builtin_interfaces/"
Path = tuple[str, ...]
Convert = Callable[[Any], Any]


@dataclass(frozen=True)
class Leaf:
    """A pair of fields by their paths in ROS 1 and ROS 2, and how a value gets from one to the other."""

    ros1: Path
    ros2: Path
    to_ros2: Convert
    to_ros1: Convert


@dataclass(frozen=True)
class Plan:
    """How values of two types are filled from each other, and which fields have no counterpart."""

    ros1_type: str
    ros2_type: str
    leaves: tuple[Leaf, ...]
    only_ros1: tuple[str, ...]
    only_ros2: tuple[str, ...]

    def to_ros2(self, source: Mapping[str, Any]) -> dict[str, Any]:
        """Return what a message of ROS 2 has of one of ROS 1."""
        target: dict[str, Any] = {}
        for leaf in self.leaves:
            _put(target, leaf.ros2, leaf.to_ros2(_get(source, leaf.ros1)))
        return target

    def to_ros1(self, source: Mapping[str, Any]) -> dict[str, Any]:
        """Return what a message of ROS 1 has of one of ROS 2."""
        target: dict[str, Any] = {}
        for leaf in self.leaves:
            _put(target, leaf.ros1, leaf.to_ros1(_get(source, leaf.ros2)))
        return target


class Pairing:
    """Compares the types of two sets of definitions, in which they and their parts have to be."""

    def __init__(self, ros1: Typesdict, ros2: Typesdict, rules: TypeRules) -> None:
        self._ros1, self._ros2 = ros1, ros2
        self._codec1, self._codec2 = Codec(ros1), Codec(ros2)
        self._rules = rules
        self._same: dict[tuple[str, str], bool] = {}
        self._plans: dict[tuple[str, str], Plan] = {}

    def to_ros2(self, ros1_type: str, ros2_type: str, ros1: bytes) -> bytes:
        """Convert a message by their plan to ROS 2's layout; raises WireError."""
        value = self.plan(ros1_type, ros2_type).to_ros2(self._codec1.read(msg_name(ros1_type), ros1))
        return self._codec2.write(msg_name(ros2_type), value)

    def to_ros1(self, ros1_type: str, ros2_type: str, content: bytes) -> bytes:
        """Convert a message in ROS 2's layout by their plan; raises WireError."""
        value = self.plan(ros1_type, ros2_type).to_ros1(self._codec2.read(msg_name(ros2_type), content))
        return self._codec1.write(msg_name(ros1_type), value)

    def same_layout(self, ros1_type: str, ros2_type: str) -> bool:
        """Return whether both put the same fields in the same order; some may have been renamed, and ``Header.seq`` is known."""
        key = (ros1_type, ros2_type)
        if key not in self._same:
            self._same[key] = self._lie_alike(ros1_type, ros2_type)
        return self._same[key]

    def _lie_alike(self, ros1_type: str, ros2_type: str) -> bool:
        name1, name2 = msg_name(ros1_type), msg_name(ros2_type)
        if name1 == name2 == HEADER:
            return True
        if self._rules.fields(ros1_type, ros2_type):
            return False
        fields1, fields2 = fields_of(self._ros1, name1), fields_of(self._ros2, name2)
        alike = len(fields1) == len(fields2) and all(self._same_kind(one, two) for (_, one), (_, two) in zip(fields1, fields2, strict=True))
        if not alike:
            return False
        keys1, keys2 = keys_of([name for name, _ in fields1], [name for name, _ in fields2])
        return not any(one != two and (one in keys2 or two in keys1) for one, two in zip(keys1, keys2, strict=True))

    def renamed(self, ros1_type: str, ros2_type: str) -> tuple[str, ...]:
        """Return the fields that have another name at the same place, for people, of types of the same layout."""
        return tuple(dict.fromkeys(self._renamed(ros1_type, ros2_type, set())))

    def _renamed(self, ros1_type: str, ros2_type: str, seen: set[tuple[str, str]]) -> list[str]:
        if (ros1_type, ros2_type) in seen or msg_name(ros1_type) == HEADER:
            return []
        seen.add((ros1_type, ros2_type))
        fields1, fields2 = fields_of(self._ros1, msg_name(ros1_type)), fields_of(self._ros2, msg_name(ros2_type))
        found: list[str] = []
        for (one, kind1), (two, kind2) in zip(fields1, fields2, strict=True):
            if one.rstrip("_") != two.rstrip("_"):
                found.append(f"{ros1_type}'s field '{one}' is '{two}' in ROS 2")
            part1, part2 = message_in(kind1), message_in(kind2)
            if part1 is not None and part2 is not None and not part1.startswith(TIMES):
                found += self._renamed(plain_name(part1), plain_name(part2), seen)
        return found

    def _same_kind(self, one: FieldDesc, two: FieldDesc) -> bool:
        if one[0] != two[0]:
            return False
        if one[0] == Nodetype.BASE:
            return shape(one) == shape(two)
        if one[0] == Nodetype.NAME:
            name1, name2 = str(one[1]), str(two[1])
            if name1.startswith(TIMES) and name2.startswith(TIMES):
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
        leaves = [self._leaf(ros1_type, ros2_type, *pair, told=True) for pair in told.items() if pair[1]]
        fields1 = _untouched(self._ros1, ros1_type, told)
        fields2 = _untouched(self._ros2, ros2_type, [path for path in told.values() if path])
        keys1, keys2 = keys_of(fields1, fields2)
        names1, names2 = dict(zip(keys1, fields1, strict=True)), dict(zip(keys2, fields2, strict=True))
        if not self._rules.only_told(ros1_type, ros2_type):
            common = [key for key in names1 if key in names2]
            leaves += [self._leaf(ros1_type, ros2_type, names1.pop(key), names2.pop(key), told=False) for key in common]
            if names1 and names2:
                raise TypeDiffersError(self._refusal(ros1_type, ros2_type, next(iter(names1.values())), next(iter(names2.values()))))
        return Plan(ros1_type, ros2_type, tuple(leaves), tuple(names1.values()), tuple(names2.values()))

    def _refusal(self, ros1_type: str, ros2_type: str, one: str, two: str) -> str:
        """Return which fields have no counterpart, and the mapping to write for them, in words."""
        both = _both(ros1_type, ros2_type)
        problem = f"message type {both} differs: only ROS 1 has field '{one}' and only ROS 2 has field '{two}'; "
        hint = self._hint(ros1_type, ros2_type, one, two)
        if hint is None:
            return f"{problem}say in the configuration's 'types' that it is left out (fields: {{{one}: ''}}), or what it is"
        return f"{problem}say in the configuration's 'types' if they are the same (fields: {hint}), or leave it out ({{{one}: ''}})"

    def _hint(self, ros1_type: str, ros2_type: str, one: str, two: str) -> str | None:
        """Return a mapping of the two that can be: of the fields, or of one's parts that the other type has beside each other."""
        _, kind1 = find_field(self._ros1, ros1_type, (one,), "ROS 1")
        _, kind2 = find_field(self._ros2, ros2_type, (two,), "ROS 2")
        try:
            if self._converters(kind1, kind2, told=True) is not None:
                return f"{{{one}: {two}}}"
        except TypeDiffersError:  # of their parts
            return None
        pairs = [f"{one}.{part}: {field}" for part, field in self._parts_in(self._ros1, kind1, self._ros2, ros2_type)]
        pairs = pairs or [f"{field}: {two}.{part}" for part, field in self._parts_in(self._ros2, kind2, self._ros1, ros1_type)]
        return f"{{{', '.join(pairs)}}}" if pairs else None

    def _parts_in(self, within: Typesdict, kind: FieldDesc, other: Typesdict, other_type: str) -> list[tuple[str, str]]:
        """Return the parts of a field, each with the field of the other type that has its name and kind; none if one has none."""
        if kind[0] != Nodetype.NAME:
            return []
        fields, parts = dict(fields_of(other, msg_name(other_type))), dict(fields_of(within, str(kind[1])))
        keys1, keys2 = keys_of(list(parts), list(fields))
        names = dict(zip(keys2, fields, strict=True))
        found = [(part, names[key]) for key, part in zip(keys1, parts, strict=True) if key in names]
        fit = all(self._converters(parts[part], fields[field], told=True) is not None for part, field in found)
        return found if fit and len(found) == len(parts) else []

    def _leaf(self, ros1_type: str, ros2_type: str, path1: str, path2: str, *, told: bool) -> Leaf:
        found1, kind1 = find_field(self._ros1, ros1_type, tuple(path1.split(".")), "ROS 1")
        found2, kind2 = find_field(self._ros2, ros2_type, tuple(path2.split(".")), "ROS 2")
        converters = self._converters(kind1, kind2, told=told)
        if converters is None:
            raise TypeDiffersError(
                f"message type {_both(ros1_type, ros2_type)} differs: field '{path1}' is {shape(kind1)} in ROS 1, "
                f"'{path2}' is {shape(kind2)} in ROS 2{_rule_hint(kind1, kind2)}",
            )
        return Leaf(found1, found2, *converters)

    def _converters(self, one: FieldDesc, two: FieldDesc, *, told: bool) -> tuple[Convert, Convert] | None:
        """Return how a value goes to ROS 2 and back; None when it can't."""
        if one[0] == Nodetype.NAME and two[0] == Nodetype.NAME:
            return self._nested(str(one[1]), str(two[1]), told=told)
        if one[0] == Nodetype.BASE and two[0] == Nodetype.BASE:
            if shape(one) == shape(two):
                return _same, _same
            numbers = shape(one) in NUMBERS and shape(two) in NUMBERS
            return (_number(shape(one), shape(two)), _number(shape(two), shape(one))) if told and numbers else None
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
        if name1.startswith(TIMES) and name2.startswith(TIMES):
            return (_same, _same) if name1 == name2 else None
        if not told and not self._related(name1, name2):
            return None
        if self.same_layout(plain_name(name1), plain_name(name2)):
            return self._by_place(name1, name2)
        plan = self.plan(plain_name(name1), plain_name(name2))
        return plan.to_ros2, plan.to_ros1

    def _by_place(self, name1: str, name2: str) -> tuple[Convert, Convert]:
        """Return how a message within one goes over whose fields lie alike, under these names or others."""
        codec1, codec2 = self._codec1, self._codec2
        return (
            lambda value: codec2.read(name2, codec1.write(name1, value)),
            lambda value: codec1.read(name1, codec2.write(name2, value)),
        )


def _rule_hint(kind1: FieldDesc, kind2: FieldDesc) -> str:
    """Return what to write into a mapping if two messages are one under two names."""
    one, two = message_in(kind1), message_in(kind2)
    if one is None or two is None or one == two:
        return ""
    rule = f"{{ros1: {plain_name(one)}, ros2: {plain_name(two)}}}"
    return f"; if these are one type, say so in the configuration's 'types' ({rule})"


def _both(ros1_type: str, ros2_type: str) -> str:
    return ros1_type if ros1_type == ros2_type else f"{ros1_type} (ROS 2: {ros2_type})"


def keys_of(names1: Sequence[str], names2: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the names of two types' fields as they are compared: those of the same name, then without case and underscores.

    A name that is not the only one of its type that is left under that spelling stays as it is.
    """
    both = set(names1) & set(names2)
    numbers = [Counter(_folded(name) for name in names if name not in both) for names in (names1, names2)]
    alone = {folded for folded in numbers[0] | numbers[1] if all(number[folded] <= 1 for number in numbers)}

    def key(name: str) -> str:
        return name if name in both or _folded(name) not in alone else f"~{_folded(name)}"

    return [key(name) for name in names1], [key(name) for name in names2]


def _folded(name: str) -> str:
    return name.replace("_", "").lower()


def _untouched(definitions: Typesdict, name: str, told: Iterable[str]) -> list[str]:
    """Return the fields that no mapping has touched."""
    touched = {_folded(path.split(".")[0]) for path in told}
    return [field for field, _ in fields_of(definitions, msg_name(name)) if _folded(field) not in touched]


def find_field(definitions: Typesdict, name: str, path: Path, world: str) -> tuple[Path, FieldDesc]:
    """Return the field at a path of a type, by its exact names, and its kind; raises TypeDiffersError when there is none."""
    fields: Mapping[str, FieldDesc] = dict(fields_of(definitions, msg_name(name)))
    alike = [field for field in fields if _folded(field) == _folded(path[0])]
    if not alike:
        raise TypeDiffersError(f"message type {name}: a mapping names field '{path[0]}', which it does not have in {world}")
    key = path[0] if path[0] in alike else alike[0]
    if len(path) == 1:
        return (key,), fields[key]
    if fields[key][0] != Nodetype.NAME:
        raise TypeDiffersError(f"message type {name}: a mapping goes into field '{key}' ({shape(fields[key])}), which is no message")
    rest, kind = find_field(definitions, plain_name(str(fields[key][1])), path[1:], world)
    return (key, *rest), kind


def message_in(kind: FieldDesc) -> str | None:
    """Return the message type ``package/msg/Name`` in a field's kind, if there is one."""
    if kind[0] == Nodetype.NAME:
        return str(kind[1])
    return None if kind[0] == Nodetype.BASE else message_in(cast("tuple[FieldDesc, int]", kind[1])[0])


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


def _same(value: object) -> object:
    return value


def _number(one: str, two: str) -> Convert:
    """Return what makes a number of another kind; it raises struct.error for one that does not fit."""
    kind = bool if two == "bool" else float if two.startswith("float") else int
    return lambda value: struct.pack(NUMBERS[two], kind(struct.unpack(NUMBERS[one], value)[0]))


def _each(convert: Convert) -> Convert:
    return lambda values: [convert(value) for value in values]


def _get(source: Mapping[str, Any], path: Path) -> Any:
    for name in path:
        source = source[name]
    return source


def _put(target: dict[str, Any], path: Path, value: object) -> None:
    for name in path[:-1]:
        target = target.setdefault(name, {})
    target[path[-1]] = value
