"""Any type that both worlds know, as bytes: ROS 1's serialization to CDR and back.

Where the layouts agree, rosbags writes functions that convert the bytes without making a message object; where they differ by a
mapping (``pairing``), messages are taken apart and put together again. ROS 2's definitions come from rosbags' Jazzy store and, for all
other packages, from the files in the ament prefixes. ROS 1's come from what a peer has said, else from ROS 1's files, else from rosbags'
Noetic store, else from ROS 2's, which for many packages are the same. Where a peer has said its sum, the place that has it counts.
"""

from __future__ import annotations

import struct
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ros_bridge import layout
from ros_bridge.definitions import HALVES, PARTS, SHARES_VARIABLE, DefinitionFiles, Source, ament_prefixes
from ros_bridge.errors import TypeDiffersError, TypeUnknownError
from ros_bridge.layout import PADDING
from ros_bridge.mapping import TypeRules
from ros_bridge.names import msg_name, plain_name
from ros_bridge.pairing import Pairing, message_in
from ros_bridge.ros1_definition import require_type_name
from ros_bridge.ros1_types import HeaderTexts, Ros1Types, Ros2Texts, StoredTexts

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict

__all__ = ["ServiceType", "TypePair", "Types", "ament_prefixes"]
BYTES = frozenset({"uint8", "int8", "byte", "char"})
ANY_SUM = frozenset({"", "*"})


BytesConverter = Callable[[bytes], bytes | memoryview]


@dataclass(frozen=True)
class TypePair:
    """A message type of ROS 1 and the one of ROS 2 that it becomes, both ``package/Name``.

    ``same_layout``: both have the same kinds of fields in the same order, but for ``Header.seq``; then the definition of either world
    tells the bytes of both. ``program`` is what the data plane runs between CDR and ROS 2's layout: the fields of the ROS 2 type as ROS 1
    serializes them, which with the same layout is a message of ROS 1. ``notes``: fields without a counterpart, and renamed ones.
    ``place``: where ROS 1's definition was found.
    """

    ros1_name: str
    ros2_name: str
    md5sum: str
    full_text: str
    begins_with_header: bool
    same_layout: bool
    notes: tuple[str, ...]
    program: tuple[int, ...]
    place: str
    _to_layout: BytesConverter  # from ROS 1
    _from_layout: BytesConverter  # to ROS 1
    _cdr_to_layout: BytesConverter
    _layout_to_cdr: BytesConverter

    def to_ros2(self, ros1: bytes) -> bytes:
        """Convert a ROS 1 message to little-endian CDR with its 4 bytes of encapsulation; ``Header.seq`` falls away."""
        return bytes(self._layout_to_cdr(self.to_ros2_layout(ros1)))

    def to_ros1(self, cdr: bytes, *, seq: int = 0) -> memoryview:
        """Convert CDR to a ROS 1 message; ``seq`` becomes ``header.seq`` when the message begins with a header."""
        content = self._cdr_to_layout(cdr)
        return self._numbered(content if self.same_layout else bytearray(self._from_layout(bytes(content))), seq)

    def to_layout(self, cdr: bytes) -> bytes:
        """Convert CDR to ROS 2's layout."""
        return bytes(self._cdr_to_layout(cdr))

    def to_ros2_layout(self, ros1: bytes) -> bytes:
        """Convert a ROS 1 message to ROS 2's layout."""
        return ros1 if self.same_layout else bytes(self._to_layout(ros1))

    def to_ros1_from_layout(self, content: bytes, *, seq: int = 0) -> bytes:
        """Convert ROS 2's layout to a ROS 1 message; ``seq`` as in ``to_ros1``."""
        return content if self.same_layout else bytes(self._numbered(bytearray(self._from_layout(content)), seq))

    def _numbered(self, ros1: bytearray | bytes | memoryview, seq: int) -> memoryview:
        view = memoryview(ros1)
        if self.begins_with_header and seq:
            # The view of a converter is read-only, what it views is not: no second copy of an image for four bytes.
            struct.pack_into("<I", cast("bytearray", view.obj), 0, seq & 0xFFFFFFFF)
        return view


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
        self._ros2 = get_typestore(Stores.ROS2_JAZZY)
        jazzy = StoredTexts(self._ros2, "rosbags' store of Jazzy")
        self._ros2_texts = Ros2Texts(self._ros2_files, jazzy, self.rules)
        self._ros1_files = ros1_files or DefinitionFiles(())
        self._noetic = StoredTexts(get_typestore(Stores.ROS1_NOETIC), "rosbags' store of Noetic")
        self._sources = (self._ros1_files, self._noetic, self._ros2_texts)
        self._found = Ros1Types(self._sources)
        self._others: list[Ros1Types] | None = None
        self._told: dict[tuple[str, str], Ros1Types] = {}
        self._last_told: dict[str, Ros1Types] = {}
        self._pairings: dict[Ros1Types, Pairing] = {}

    def message(self, ros1_name: str, ros2_name: str = "", md5sum: str = "") -> TypePair:
        """Return the pair of a ROS 1 type and a ROS 2 type, both ``package/Name``; without the second, the rules tell it.

        With ``md5sum``, what a peer in ROS 1 has said, the definition that has this sum counts.

        Raises:
            TypeUnknownError: No definition is found.
            TypeDiffersError: The worlds lay it out differently, and neither names nor rules tell which field is which; or no definition
                has that sum.
        """
        with self._lock:
            ros2_name = self._name_in_ros2(ros1_name, ros2_name)
            self._load_ros2(ros2_name)
            return self._message(self._with_sum(ros1_name, md5sum, Ros1Types.md5, ros1_name), ros1_name, ros2_name)

    def service(self, ros1_name: str, ros2_name: str = "", md5sum: str = "") -> ServiceType:
        """Return a service type by its names ``package/Name``; ``md5sum`` and what it raises are as ``message`` has them."""
        with self._lock:
            ros2_name = self._name_in_ros2(ros1_name, ros2_name)
            if not self._ros2_files.has_service(ros2_name):
                raise TypeUnknownError(
                    f"service type {ros2_name}: no {ros2_name.replace('/', '/srv/')}.srv in {self._ros2_files.places()}; "
                    "build the package in the ROS 2 world",
                )
            for half in HALVES:
                self._name_in_ros2(ros1_name + half, ros2_name + half)
                self._load_ros2(ros2_name + half)
            ros1 = self._with_sum(ros1_name, md5sum, Ros1Types.service_md5, ros1_name + HALVES[0])
            request, response = (self._message(ros1, ros1_name + half, ros2_name + half) for half in HALVES)
            return ServiceType(ros1_name, ros2_name, ros1.service_md5(ros1_name), request, response)

    def require_action(self, ros2_name: str) -> None:
        """Check that ROS 2 has the action type ``package/Name``; raises TypeUnknownError."""
        with self._lock:
            if self._ros2_files.message(require_type_name(ros2_name) + PARTS[0]) is None:
                raise TypeUnknownError(
                    f"action type {ros2_name}: no {ros2_name.replace('/', '/action/')}.action in {self._ros2_files.places()}; "
                    "build the package in the ROS 2 world",
                )

    def learn(self, ros1_name: str, full_text: str, md5sum: str) -> None:
        """Take the definition that a ROS 1 peer sent in its connection's header (``message_definition``), with all its parts and its sum.

        Whoever asks for a type of its package without saying a sum gets the definition that was learned last. Raises TypeUnknownError.
        """
        with self._lock:
            header = HeaderTexts(ros1_name, full_text)
            ros1 = Ros1Types([header, *self._sources])
            if (own_sum := ros1.md5(ros1_name)) != md5sum:
                raise TypeUnknownError(f"the text that comes with {ros1_name} has MD5 sum {own_sum}, and its node says {md5sum}")
            ros1 = self._told.setdefault((ros1_name, md5sum), ros1)
            package = ros1_name.partition("/")[0]
            for name in header.names:
                if name.partition("/")[0] != package:
                    continue
                try:
                    self._told.setdefault((name, ros1.md5(name)), ros1)
                except TypeUnknownError:
                    continue  # a part that nothing has
                self._last_told[name] = ros1

    def knows_ros1(self, ros1_name: str) -> bool:
        """Return whether ROS 1's own definition of a type is at hand, without asking a publisher."""
        with self._lock:
            own = (self._ros1_files, self._noetic)
            return ros1_name in self._last_told or any(source.message(ros1_name) is not None for source in own)

    def bulky(self, ros2_name: str) -> bool:
        """Return whether messages of a ROS 2 type, once paired, can be large: whether there is an array of bytes without an end."""
        with self._lock:
            return _has_byte_arrays(self._ros2.fielddefs, msg_name(ros2_name), set())

    def _name_in_ros2(self, ros1_name: str, told: str) -> str:
        """Return the name of a type in ROS 2, and remember one that the rules do not tell; raises TypeUnknownError when it is none."""
        ros2_name = require_type_name(told) if told else self.rules.to_ros2(require_type_name(ros1_name))
        if ros2_name != self.rules.to_ros2(require_type_name(ros1_name)):
            self._ros2_texts.ros2_names[ros1_name] = ros2_name
        return ros2_name

    def _with_sum(self, name: str, md5sum: str, sum_of: Callable[[Ros1Types, str], str], message: str) -> Ros1Types:
        """Return the definitions by which a type has the sum; where none is asked for, those that a peer told last, or the first.

        ``message`` is the type, or a half of the service.
        """
        preferred = self._last_told.get(message, self._found)
        if md5sum in ANY_SUM:
            return preferred
        own_sum = sum_of(preferred, name)  # raises what is wrong with it
        if own_sum == md5sum:
            return preferred
        for ros1 in self._candidates(name, md5sum):
            try:
                if sum_of(ros1, name) == md5sum:
                    return ros1
            except TypeUnknownError:
                continue
        raise TypeDiffersError(
            f"type {name}: its node in ROS 1 has a definition with MD5 sum {md5sum}, here it is {own_sum} "
            f"(from {preferred.place(message)}); put the node's package {name.partition('/')[0]}, with its msg, srv and action files, "
            f"into a folder of ${SHARES_VARIABLE}",
        )

    def _candidates(self, name: str, md5sum: str) -> Iterator[Ros1Types]:
        if (name, md5sum) in self._told:
            yield self._told[name, md5sum]
        yield self._found
        if self._others is None:  # a set for each place, which comes before the others in it
            places: list[Source] = [*self._ros1_files.each(), self._noetic, self._ros2_texts]
            self._others = [Ros1Types([place, *self._sources]) for place in places]
        yield from self._others

    def _message(self, ros1: Ros1Types, ros1_name: str, ros2_name: str) -> TypePair:
        definition = ros1.definition(ros1_name)
        layout.compile_program(ros1.fielddefs, msg_name(ros1_name))  # it may come from a peer, and has to be of a sensible size
        name2 = msg_name(ros2_name)
        program = layout.compile_program(self._ros2.fielddefs, name2)
        if ros1 not in self._pairings:
            self._pairings[ros1] = Pairing(ros1.fielddefs, self._ros2.fielddefs, self.rules)
        pairing = self._pairings[ros1]
        same_layout = pairing.same_layout(ros1_name, ros2_name)
        if same_layout:
            notes = pairing.renamed(ros1_name, ros2_name)
        else:
            plan = pairing.plan(ros1_name, ros2_name)
            notes = (
                *(f"only ROS 1 has field '{name}'" for name in plan.only_ros1),
                *(f"only ROS 2 has field '{name}'" for name in plan.only_ros2),
            )
        self._ros2.get_msgdef(name2)  # writes the converters now, not when the first message waits for them
        return TypePair(
            ros1_name,
            ros2_name,
            ros1.md5(ros1_name),
            ros1.full_text(ros1_name),
            begins_with_header=bool(definition.fields) and definition.fields[0].base + definition.fields[0].array == "std_msgs/Header",
            same_layout=same_layout,
            notes=notes,
            program=program,
            place=ros1.place(ros1_name),
            _to_layout=lambda raw: pairing.to_ros2(ros1_name, ros2_name, raw),
            _from_layout=lambda content: pairing.to_ros1(ros1_name, ros2_name, content),
            _cdr_to_layout=lambda raw: self._ros2.cdr_to_ros1(raw, name2),
            _layout_to_cdr=lambda raw: self._ros2.ros1_to_cdr(raw, name2),
        )

    def _load_ros2(self, ros2_name: str) -> None:
        if msg_name(ros2_name) in self._ros2.fielddefs:
            return
        text = self._ros2_files.message(ros2_name)
        if text is None:
            raise TypeUnknownError(
                f"message type {ros2_name}: no {ros2_name.replace('/', '/msg/')}.msg in {self._ros2_files.places()}; "
                "build the package in the ROS 2 world",
            )
        fields = _fielddefs(ros2_name, text)
        for _, kind in fields[msg_name(ros2_name)][1]:
            if (part := message_in(kind)) is not None and not part.startswith("builtin_interfaces/"):
                self._load_ros2(plain_name(part))
        self._ros2.register(fields)


def _fielddefs(plain: str, text: str) -> Typesdict:
    """Parse a text of ROS 2 for rosbags, with the byte that it puts into a message without fields; raises TypeUnknownError."""
    name = msg_name(plain)
    try:
        constants, fields = get_types_from_msg(text, name)[name]
    except Exception as error:
        raise TypeUnknownError(f"message type {plain}: its definition can't be read: {error}") from error
    return {name: (constants, fields or [(PADDING, (Nodetype.BASE, ("uint8", 0)))])}


def _has_byte_arrays(definitions: Typesdict, name: str, seen: set[str]) -> bool:
    if name in seen or name not in definitions:
        return False
    seen.add(name)
    return any(_is_byte_array(kind) or _has_byte_arrays(definitions, message_in(kind) or "", seen) for _, kind in definitions[name][1])


def _is_byte_array(kind: FieldDesc) -> bool:
    if kind[0] != Nodetype.SEQUENCE:
        return False
    element = cast("tuple[FieldDesc, int]", kind[1])[0]
    return element[0] == Nodetype.BASE and cast("tuple[str, int]", element[1])[0] in BYTES
