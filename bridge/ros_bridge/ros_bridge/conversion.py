"""Any type that both worlds know, as bytes: ROS 1's serialization to CDR and back.

Where the layouts agree, rosbags writes functions that convert the bytes without making a message object; where they differ by a
mapping (``pairing``), messages are taken apart and put together again. ROS 2's definitions come from its Jazzy store and, for all
other packages, from the files in the ament prefixes. ROS 1's come from its Noetic store, else from what a publisher has said, else from
ROS 1's files, else from ROS 2's, which for many packages are the same.
"""

from __future__ import annotations

import re
import struct
import threading
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_bridge import layout, ros1_definition
from ros_bridge.definitions import DefinitionFiles, ament_prefixes
from ros_bridge.errors import TypeUnknownError
from ros_bridge.mapping import TypeRules
from ros_bridge.pairing import PADDING, Pairing, msg_name, plain_name
from ros_bridge.ros1_definition import Definition

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

__all__ = ["ServiceType", "TypePair", "Types", "ament_prefixes"]
BYTES = frozenset({"uint8", "int8", "byte", "char"})
PART = re.compile(r"^MSG: *(\S+)$")


BytesConverter = Callable[[bytes], bytes | memoryview]


@dataclass(frozen=True)
class TypePair:
    """A message type of ROS 1 and the one of ROS 2 that it becomes, both ``package/Name``.

    ``same_layout``: both have the same kinds of fields in the same order, but for ``Header.seq``; then the definition of either world
    tells the bytes of both. ``program`` is what the data plane runs between CDR and ROS 2's layout: the fields of the ROS 2 type as ROS 1
    serializes them, which with the same layout is a message of ROS 1. ``notes``: fields without a counterpart.
    """

    ros1_name: str
    ros2_name: str
    md5sum: str
    full_text: str
    begins_with_header: bool
    same_layout: bool
    notes: tuple[str, ...]
    program: tuple[int, ...]
    _ros1_to_ros2: BytesConverter
    _ros2_to_ros1: BytesConverter
    _cdr_to_layout: BytesConverter
    _layout_to_cdr: BytesConverter

    def to_ros2(self, ros1: bytes) -> bytes:
        """Convert a ROS 1 message to little-endian CDR with its 4 bytes of encapsulation; ``Header.seq`` falls away."""
        return bytes(self._ros1_to_ros2(ros1))

    def to_ros1(self, cdr: bytes, *, seq: int = 0) -> memoryview:
        """Convert CDR to a ROS 1 message; ``seq`` becomes ``header.seq`` when the message begins with a header."""
        ros1 = self._ros2_to_ros1(cdr)
        if self.begins_with_header and seq:
            # The view is read-only, what it views is not: no second copy of an image for four bytes.
            struct.pack_into("<I", cast("bytearray", cast("memoryview", ros1).obj), 0, seq & 0xFFFFFFFF)
        return cast("memoryview", ros1)

    def to_layout(self, cdr: bytes) -> bytes:
        """Convert CDR to ROS 2's layout."""
        return bytes(self._cdr_to_layout(cdr))

    def to_ros2_layout(self, ros1: bytes) -> bytes:
        """Convert a ROS 1 message to ROS 2's layout."""
        return ros1 if self.same_layout else self.to_layout(self.to_ros2(ros1))

    def to_ros1_from_layout(self, content: bytes, *, seq: int = 0) -> bytes:
        """Convert ROS 2's layout to a ROS 1 message; ``seq`` as in ``to_ros1``."""
        return content if self.same_layout else bytes(self.to_ros1(bytes(self._layout_to_cdr(content)), seq=seq))


@dataclass(frozen=True)
class ServiceType:
    """One service type in both worlds."""

    ros1_name: str
    ros2_name: str
    md5sum: str
    request: TypePair
    response: TypePair


class Types:
    """The types of both worlds, looked up by their names and kept; safe to use from several threads."""

    def __init__(self, prefixes: Iterable[Path], rules: TypeRules | None = None, ros1_files: DefinitionFiles | None = None) -> None:
        """Look for ROS 2's definitions below ``<prefix>/share`` in the order given (the ament prefix path)."""
        self.rules = rules or TypeRules()
        self._lock = threading.RLock()
        self._ros2_files = DefinitionFiles(prefix / "share" for prefix in prefixes)
        self._ros1_files = ros1_files or DefinitionFiles(())
        self._ros2 = get_typestore(Stores.ROS2_JAZZY)
        self._ros1 = get_typestore(Stores.ROS1_NOETIC)
        self._pairing = Pairing(self._ros1, self._ros2, self.rules)
        self._told: dict[str, str] = {}
        self._definitions: dict[str, Definition] = {}
        self._sums: dict[str, str] = {}

    def message(self, ros1_name: str, ros2_name: str = "") -> TypePair:
        """Return the pair of a ROS 1 type and a ROS 2 type, both ``package/Name``; without the second, the rules tell it.

        Raises:
            TypeUnknownError: No definition is found.
            TypeDiffersError: The worlds lay it out differently, and neither names nor rules tell which field is which.
        """
        ros2_name = ros2_name or self.rules.to_ros2(ros1_name)
        with self._lock:
            self._load_ros2(ros2_name)
            self._load_ros1(ros1_name)
            return self._message(ros1_name, ros2_name)

    def service(self, ros1_name: str, ros2_name: str = "") -> ServiceType:
        """Return a service type by its names ``package/Name``; raises as ``message`` does."""
        ros2_name = ros2_name or self.rules.to_ros2(ros1_name)
        with self._lock:
            ros2_texts = self._ros2_files.service(ros2_name)
            if ros2_texts is None:
                raise TypeUnknownError(
                    f"service type {ros2_name}: no {ros2_name.replace('/', '/srv/')}.srv in {self._ros2_files.places()}; "
                    "build the package in the ROS 2 world",
                )
            ros1_texts = self._ros1_files.service(ros1_name) or ros2_texts
            halves, sums = [], []
            for suffix, text1, text2 in zip(("_Request", "_Response"), ros1_texts, ros2_texts, strict=True):
                self._adopt_ros2(ros2_name + suffix, text2)
                self._adopt_ros1(ros1_name + suffix, text1)
                sums.append(ros1_definition.sum_text(self._definitions[ros1_name + suffix], self._md5))
                halves.append(self._message(ros1_name + suffix, ros2_name + suffix))
            return ServiceType(ros1_name, ros2_name, ros1_definition.md5("".join(sums)), *halves)

    def learn(self, ros1_name: str, full_text: str) -> None:
        """Take the definition that a ROS 1 publisher sent in its connection's header (``message_definition``), with all its parts.

        A type that is loaded already keeps the definition that it has.
        """
        first, *parts = full_text.split(ros1_definition.SEPARATOR)
        with self._lock:
            self._told.setdefault(ros1_name, first)
            for part in parts:
                title, _, text = part.strip().partition("\n")
                if (match := PART.match(title)) is not None:
                    self._told.setdefault(match[1], text)

    def knows_ros1(self, ros1_name: str) -> bool:
        """Tell whether ROS 1's own definition of a type is at hand, without asking a publisher."""
        with self._lock:
            return ros1_name in self._told or msg_name(ros1_name) in self._ros1.fielddefs or self._ros1_files.message(ros1_name) is not None

    def bulky(self, ros2_name: str) -> bool:
        """Tell whether messages of a ROS 2 type, once paired, can be large: whether there is an array of bytes without an end."""
        with self._lock:
            return _has_byte_arrays(self._ros2, (Nodetype.NAME, msg_name(ros2_name)))

    def defined(self, ros1_name: str, ros2_name: str, text: str) -> TypePair:
        """Return the pair of types whose definition is no file of its own, such as an action's goal; raises as ``message`` does."""
        with self._lock:
            self._adopt_ros2(ros2_name, text)
            if ros1_name not in self._definitions:
                self._adopt_ros1(ros1_name, self._told.get(ros1_name) or self._ros1_files.message(ros1_name) or text)
            return self._message(ros1_name, ros2_name)

    def _message(self, ros1_name: str, ros2_name: str) -> TypePair:
        definition = self._definitions[ros1_name]
        to_ros2, to_ros1, same_layout, notes = self._converters(ros1_name, ros2_name)
        name2 = msg_name(ros2_name)
        return TypePair(
            ros1_name,
            ros2_name,
            self._md5(ros1_name),
            ros1_definition.full_text(definition, self._definitions.__getitem__),
            begins_with_header=bool(definition.fields) and definition.fields[0].base + definition.fields[0].array == "std_msgs/Header",
            same_layout=same_layout,
            notes=notes,
            program=layout.compile_program(self._ros2.fielddefs, name2),
            _ros1_to_ros2=to_ros2,
            _ros2_to_ros1=to_ros1,
            _cdr_to_layout=lambda raw: self._ros2.cdr_to_ros1(raw, name2),
            _layout_to_cdr=lambda raw: self._ros2.ros1_to_cdr(raw, name2),
        )

    def _converters(self, ros1_name: str, ros2_name: str) -> tuple[BytesConverter, BytesConverter, bool, tuple[str, ...]]:
        """Return how bytes go to ROS 2 and back, whether as they lie, and which fields have no counterpart."""
        name1, name2 = msg_name(ros1_name), msg_name(ros2_name)
        self._ros2.get_msgdef(name2)  # writes the converters now, not when the first message waits for them
        if self._pairing.same_layout(ros1_name, ros2_name):
            return (lambda raw: self._ros2.ros1_to_cdr(raw, name2)), (lambda raw: self._ros2.cdr_to_ros1(raw, name2)), True, ()
        plan = self._pairing.plan(ros1_name, ros2_name)
        self._ros1.get_msgdef(name1)

        def to_ros2(raw: bytes) -> memoryview:
            return self._ros2.serialize_cdr(self._pairing.to_ros2(plan, self._ros1.deserialize_ros1(raw, name1)), name2)

        def to_ros1(raw: bytes) -> memoryview:
            return self._ros1.serialize_ros1(self._pairing.to_ros1(plan, self._ros2.deserialize_cdr(raw, name2)), name1)

        notes = [f"only ROS 1 has field '{name}'" for name in plan.only_ros1]
        notes += [f"only ROS 2 has field '{name}'" for name in plan.only_ros2]
        return to_ros2, to_ros1, False, tuple(notes)

    def _md5(self, ros1_name: str) -> str:
        if ros1_name not in self._sums:
            self._sums[ros1_name] = ros1_definition.md5(ros1_definition.sum_text(self._definitions[ros1_name], self._md5))
        return self._sums[ros1_name]

    def _load_ros1(self, ros1_name: str) -> None:
        if ros1_name not in self._definitions:
            self._adopt_ros1(ros1_name, self._ros1_text(ros1_name))

    def _ros1_text(self, ros1_name: str) -> str:
        name = msg_name(ros1_name)
        if name in self._ros1.fielddefs:
            return _stored_text(self._ros1, name)
        text = self._told.get(ros1_name) or self._ros1_files.message(ros1_name)
        ros2_name = self.rules.to_ros2(ros1_name)
        if text is None and not self.rules.fields(ros1_name, ros2_name):  # then it is ROS 2's, perhaps under another name
            stored = msg_name(ros2_name) in self._ros2.fielddefs
            text = self._ros2_files.message(ros2_name) or (_stored_text(self._ros2, msg_name(ros2_name)) if stored else None)
        if text is None:
            raise TypeUnknownError(
                f"message type {ros1_name}: ROS 1's definition is neither in {self._ros1_files.places()} nor known from a publisher",
            )
        return text

    def _adopt_ros1(self, ros1_name: str, text: str) -> None:
        definition = ros1_definition.parse_definition(ros1_name, text)
        self._definitions[ros1_name] = definition
        for part in definition.parts:
            self._load_ros1(part)
        if msg_name(ros1_name) not in self._ros1.fielddefs:
            self._ros1.register(_fielddefs(ros1_name, text))

    def _load_ros2(self, ros2_name: str) -> None:
        if msg_name(ros2_name) in self._ros2.fielddefs:
            return
        text = self._ros2_files.message(ros2_name)
        if text is None:
            raise TypeUnknownError(
                f"message type {ros2_name}: no {ros2_name.replace('/', '/msg/')}.msg in {self._ros2_files.places()}; "
                "build the package in the ROS 2 world",
            )
        self._adopt_ros2(ros2_name, text)

    def _adopt_ros2(self, ros2_name: str, text: str) -> None:
        fields = _fielddefs(ros2_name, text)
        for _, kind in fields[msg_name(ros2_name)][1]:
            if (part := _part(kind)) is not None and not part.startswith("builtin_interfaces/"):
                self._load_ros2(plain_name(part))
        if msg_name(ros2_name) not in self._ros2.fielddefs:
            self._ros2.register(fields)


def _part(kind: FieldDesc) -> str | None:
    """Return the message type in a field's kind, if there is one."""
    if kind[0] == Nodetype.NAME:
        return str(kind[1])
    return None if kind[0] == Nodetype.BASE else _part(cast("tuple[FieldDesc, int]", kind[1])[0])


def _has_byte_arrays(store: Typestore, kind: FieldDesc) -> bool:
    if kind[0] == Nodetype.NAME:
        return str(kind[1]) in store.fielddefs and any(_has_byte_arrays(store, part) for _, part in store.fielddefs[str(kind[1])][1])
    if kind[0] == Nodetype.BASE:
        return False
    element = cast("tuple[FieldDesc, int]", kind[1])[0]
    bytes_in_it = element[0] == Nodetype.BASE and cast("tuple[str, int]", element[1])[0] in BYTES
    return (bytes_in_it and kind[0] == Nodetype.SEQUENCE) or _has_byte_arrays(store, element)


def _stored_text(store: Typestore, name: str) -> str:
    return store.generate_msgdef(name)[0].split(ros1_definition.SEPARATOR)[0]


def _fielddefs(plain: str, text: str) -> Typesdict:
    """Parse a text for rosbags, with the byte that ROS 2 puts into a message without fields; raises TypeUnknownError."""
    name = msg_name(plain)
    try:
        constants, fields = get_types_from_msg(text, name)[name]
    except Exception as error:
        raise TypeUnknownError(f"message type {plain}: its definition can't be read: {error}") from error
    return {name: (constants, fields or [(PADDING, (Nodetype.BASE, ("uint8", 0)))])}
