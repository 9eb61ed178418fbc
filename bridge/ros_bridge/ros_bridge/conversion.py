"""Any type that both worlds know, as bytes: ROS 1's serialization to CDR and back, without making a message object.

rosbags writes the converting functions. ROS 2's definitions come from its Jazzy store and, for all other packages, from the ``.msg``
and ``.srv`` files in the ament prefixes; ROS 1's from its Noetic store, else from the same files, which both worlds build.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_bridge import ros1_definition
from ros_bridge.errors import TypeDiffersError, TypeUnknownError
from ros_bridge.ros1_definition import Definition

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

PADDING = "structure_needs_at_least_one_member"  # ROS 2 gives an empty message one byte
HEADER = "std_msgs/msg/Header"


@dataclass(frozen=True)
class TypePair:
    """A message type of ROS 1 and the one of ROS 2 that it becomes, both ``package/Name``.

    ``same_layout``: both have the same kinds of fields in the same order, but for ``Header.seq``; then the definition of either world
    tells the bytes of both.
    """

    ros1_name: str
    ros2_name: str
    md5sum: str
    full_text: str
    begins_with_header: bool
    same_layout: bool
    _ros1_to_ros2: Callable[[bytes], memoryview]
    _ros2_to_ros1: Callable[[bytes], memoryview]

    def to_ros2(self, ros1: bytes) -> bytes:
        """Convert a ROS 1 message to little-endian CDR with its 4 bytes of encapsulation; ``Header.seq`` falls away."""
        return bytes(self._ros1_to_ros2(ros1))

    def to_ros1(self, cdr: bytes, *, seq: int = 0) -> memoryview:
        """Convert CDR to a ROS 1 message; ``seq`` becomes ``header.seq`` when the message begins with a header."""
        ros1 = self._ros2_to_ros1(cdr)
        if self.begins_with_header and seq:
            # The view is read-only, what it views is not: no second copy of an image for four bytes.
            struct.pack_into("<I", cast("bytearray", ros1.obj), 0, seq & 0xFFFFFFFF)
        return ros1


@dataclass(frozen=True)
class ServiceType:
    """One service type in both worlds."""

    ros1_name: str
    md5sum: str
    request: TypePair
    response: TypePair


class Types:
    """The types of both worlds, looked up by their ROS 1 names and kept."""

    def __init__(self, prefixes: Iterable[Path]) -> None:
        """Look for definitions below ``<prefix>/share`` in the order given (the ament prefix path)."""
        self._shares = [prefix / "share" for prefix in prefixes]
        self._ros2 = get_typestore(Stores.ROS2_JAZZY)
        self._ros1 = get_typestore(Stores.ROS1_NOETIC)
        self._definitions: dict[str, Definition] = {}
        self._sums: dict[str, str] = {}

    def message(self, ros1_name: str, ros2_name: str = "") -> TypePair:
        """Return the pair of a ROS 1 type and a ROS 2 type, both ``package/Name``; without the second, the mapping rules tell it.

        Raises:
            TypeUnknownError: No definition is found.
            TypeDiffersError: The worlds lay it out differently.
        """
        ros2_name = ros2_name or ros1_name
        self._load_ros2(ros2_name)
        self._load_ros1(ros1_name)
        return self._message(ros1_name, ros2_name)

    def service(self, ros1_name: str) -> ServiceType:
        """Return a service type by its name ``package/Name``; raises as ``message`` does."""
        package, name = ros1_name.split("/")
        halves = self._service_text(package, name)
        sums = []
        for suffix, text in zip(("Request", "Response"), halves, strict=True):
            half = f"{ros1_name}_{suffix}"
            self._adopt_ros2(half, text)
            self._adopt_ros1(half, text)
            sums.append(ros1_definition.sum_text(self._definitions[half], self._md5))
        request, response = (self._message(f"{ros1_name}_{suffix}", f"{ros1_name}_{suffix}") for suffix in ("Request", "Response"))
        return ServiceType(ros1_name, ros1_definition.md5("".join(sums)), request, response)

    def defined(self, ros1_name: str, ros2_name: str, text: str) -> TypePair:
        """Return the pair of types whose definition is no file of its own, such as an action's goal; raises as ``message`` does."""
        self._adopt_ros2(ros2_name, text)
        if ros1_name not in self._definitions:
            self._adopt_ros1(ros1_name, text)
        return self._message(ros1_name, ros2_name)

    def _message(self, ros1_name: str, ros2_name: str) -> TypePair:
        definition = self._definitions[ros1_name]
        name = _ros2_name(ros2_name)
        require_same_layout(_ros2_name(ros1_name), name, self._ros1, self._ros2)
        self._ros2.get_msgdef(name)  # writes the converters now, not when the first message waits for them
        return TypePair(
            ros1_name,
            ros2_name,
            self._md5(ros1_name),
            ros1_definition.full_text(definition, self._definitions.__getitem__),
            begins_with_header=bool(definition.fields) and definition.fields[0].base + definition.fields[0].array == "std_msgs/Header",
            same_layout=True,
            _ros1_to_ros2=lambda raw: self._ros2.ros1_to_cdr(raw, name),
            _ros2_to_ros1=lambda raw: self._ros2.cdr_to_ros1(raw, name),
        )

    def _md5(self, ros1_name: str) -> str:
        if ros1_name not in self._sums:
            self._sums[ros1_name] = ros1_definition.md5(ros1_definition.sum_text(self._definitions[ros1_name], self._md5))
        return self._sums[ros1_name]

    def _load_ros1(self, ros1_name: str) -> None:
        if ros1_name in self._definitions:
            return
        name = _ros2_name(ros1_name)
        if name in self._ros1.fielddefs:
            text = _stored_text(self._ros1, name)
        else:
            text = self._file_text(ros1_name) or _stored_text(self._ros2, name)
        self._adopt_ros1(ros1_name, text)

    def _adopt_ros1(self, ros1_name: str, text: str) -> None:
        definition = ros1_definition.parse_definition(ros1_name, text)
        self._definitions[ros1_name] = definition
        for part in definition.parts:
            self._load_ros1(part)
        if _ros2_name(ros1_name) not in self._ros1.fielddefs:
            self._ros1.register(_fielddefs(ros1_name, text))

    def _load_ros2(self, ros1_name: str) -> None:
        if _ros2_name(ros1_name) in self._ros2.fielddefs:
            return
        text = self._file_text(ros1_name)
        if text is None:
            package, short = ros1_name.split("/")
            raise TypeUnknownError(
                f"message type {ros1_name}: no {package}/msg/{short}.msg in {self._places()}; build the package in the ROS 2 world",
            )
        self._adopt_ros2(ros1_name, text)

    def _adopt_ros2(self, ros1_name: str, text: str) -> None:
        for part in ros1_definition.parse_definition(ros1_name, text).parts:
            self._load_ros2(part)
        if _ros2_name(ros1_name) not in self._ros2.fielddefs:
            self._ros2.register(_fielddefs(ros1_name, text))

    def _file_text(self, ros1_name: str) -> str | None:
        package, short = ros1_name.split("/")
        path = self._find(package, "msg", f"{short}.msg")
        return None if path is None else path.read_text(encoding="utf-8")

    def _service_text(self, package: str, name: str) -> list[str]:
        path = self._find(package, "srv", f"{name}.srv")
        if path is None:
            raise TypeUnknownError(
                f"service type {package}/{name}: no {package}/srv/{name}.srv in {self._places()}; build the package in the ROS 2 world",
            )
        lines = path.read_text(encoding="utf-8").splitlines()
        divider = [line.strip() for line in lines].index("---")
        return ["\n".join(lines[:divider]), "\n".join(lines[divider + 1 :])]

    def _find(self, package: str, kind: str, file: str) -> Path | None:
        candidates = (share / package / kind / file for share in self._shares)
        return next((path for path in candidates if path.is_file()), None)

    def _places(self) -> str:
        return ", ".join(map(str, self._shares)) or "an empty ament prefix path"


def ament_prefixes() -> list[Path]:
    """Return the prefixes in which this environment looks for ROS 2 packages."""
    return [Path(prefix) for prefix in os.environ.get("AMENT_PREFIX_PATH", sys.prefix).split(os.pathsep) if prefix]


def _ros2_name(ros1_name: str) -> str:
    package, name = ros1_name.split("/")
    return f"{package}/msg/{name}"


def _stored_text(store: Typestore, name: str) -> str:
    return store.generate_msgdef(name)[0].split(ros1_definition.SEPARATOR)[0]


def _fielddefs(ros1_name: str, text: str) -> Typesdict:
    """Parse a text for rosbags, with the byte that ROS 2 puts into a message without fields."""
    name = _ros2_name(ros1_name)
    constants, fields = get_types_from_msg(text, name)[name]
    return {name: (constants, fields or [(PADDING, (Nodetype.BASE, ("uint8", 0)))])}


def require_same_layout(ros1_name: str, ros2_name: str, ros1: Typestore, ros2: Typestore) -> None:
    """Check that both worlds put the same kinds of fields in the same order; names may differ, and ``Header.seq`` is known.

    Raises:
        TypeDiffersError: They don't; the message names the first field that differs.
    """
    if ros1_name == ros2_name == HEADER:
        return
    name = ros1_name if ros1_name == ros2_name else f"{ros1_name} to {ros2_name}"
    left, right = ros1.fielddefs[ros1_name][1], ros2.fielddefs[ros2_name][1]
    for (left_field, left_type), (right_field, right_type) in zip(left, right, strict=False):
        left_part, right_part = _shape(left_type), _shape(right_type)
        if left_part != right_part:
            raise TypeDiffersError(
                f"message type {name} differs: field '{left_field}' is {left_part} in ROS 1, '{right_field}' is {right_part} in ROS 2",
            )
        part = left_part.split("[")[0]
        if "/msg/" in part and not part.startswith("builtin_interfaces"):
            require_same_layout(part, part, ros1, ros2)
    if len(left) != len(right):
        longer, world = (left, "ROS 1") if len(left) > len(right) else (right, "ROS 2")
        raise TypeDiffersError(f"message type {name} differs: only {world} has field '{longer[min(len(left), len(right))][0]}'")


def _shape(field: FieldDesc) -> str:
    """Name a field's type without what does not change its bytes: bounds, and char and byte for uint8."""
    kind, inner = field
    if kind == Nodetype.BASE:
        base = cast("tuple[str, int]", inner)[0]
        return {"char": "uint8", "byte": "uint8"}.get(base, base)
    if kind == Nodetype.NAME:
        return str(inner)
    element, length = cast("tuple[FieldDesc, int]", inner)
    return f"{_shape(element)}[{length if kind == Nodetype.ARRAY else ''}]"
