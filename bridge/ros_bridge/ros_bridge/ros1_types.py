"""ROS 1's definitions that belong together: each type with its parts, from the first place that has it, and the sums that follow.

Several of these sets exist beside each other: the one of the files, and one for each definition that a peer has sent in its connection's
header, because a node may have been built from another version of a package.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype

from ros_bridge import ros1_definition
from ros_bridge.definitions import HALVES, DefinitionFiles, Source
from ros_bridge.errors import TypeUnknownError
from ros_bridge.layout import PADDING
from ros_bridge.names import msg_name
from ros_bridge.ros1_definition import PRIMITIVES, SEPARATOR, Definition

if TYPE_CHECKING:
    from rosbags.interfaces.typing import FieldDesc, Typesdict
    from rosbags.typesys.store import Typestore

    from ros_bridge.mapping import TypeRules

MOST_NESTED = 50
PART_TITLE = "MSG:"
TIMES: Typesdict = {
    f"builtin_interfaces/msg/{name}": ([], [("sec", (Nodetype.BASE, ("int32", 0))), ("nanosec", (Nodetype.BASE, ("uint32", 0)))])
    for name in ("Time", "Duration")
}


class HeaderTexts:
    """What a peer has sent in a connection's header (``message_definition``): a type's text and those of all its parts."""

    def __init__(self, ros1_name: str, full_text: str) -> None:
        first, *parts = full_text.split(SEPARATOR)
        self._texts = {ros1_name: first}
        for part in parts:
            title, _, text = part.strip().partition("\n")
            if title.startswith(PART_TITLE):
                self._texts.setdefault(title.removeprefix(PART_TITLE).strip(), text)
        self._ros1_name = ros1_name

    @property
    def names(self) -> tuple[str, ...]:
        """The types whose texts it has."""
        return tuple(self._texts)

    def message(self, name: str) -> str | None:
        """Return the text of one of them."""
        return self._texts.get(name)

    def places(self) -> str:
        """Name the place, for people."""
        return f"the connection header of a node that has {self._ros1_name}"


class StoredTexts:
    """What rosbags has in a store."""

    def __init__(self, store: Typestore, place: str) -> None:
        self._store = store
        self._place = place

    def message(self, name: str) -> str | None:
        """Return the text of a type that is in the store."""
        if (full := msg_name(name)) not in self._store.fielddefs:
            return None
        return self._store.generate_msgdef(full)[0].split(SEPARATOR)[0]

    def places(self) -> str:
        """Name the place, for people."""
        return self._place


class Ros2Texts:
    """ROS 2's definitions, which for many packages are ROS 1's too; not where a rule says that fields differ."""

    def __init__(self, files: DefinitionFiles, store: StoredTexts, rules: TypeRules) -> None:
        self._places = (files, store)
        self._rules = rules
        self.ros2_names: dict[str, str] = {}  # of ROS 1's, where the rules do not tell them

    def message(self, name: str) -> str | None:
        """Return ROS 2's text, perhaps under another name."""
        ros2_name = self.ros2_names.get(name) or self._rules.to_ros2(name)
        if self._rules.fields(name, ros2_name):
            return None
        return next((text for place in self._places if (text := place.message(ros2_name)) is not None), None)

    def places(self) -> str:
        """Name the place, for people."""
        return "ROS 2's definition"


class Ros1Types:
    """One set of definitions; a type is in it with all its parts or not at all."""

    def __init__(self, sources: Iterable[Source]) -> None:
        self._sources: Sequence[Source] = tuple(sources)
        self._definitions: dict[str, Definition] = {}
        self._sums: dict[str, str] = {}
        self._places: dict[str, str] = {}
        self.fielddefs: Typesdict = dict(TIMES)

    def definition(self, name: str) -> Definition:
        """Return the definition of a type ``package/Name``; raises TypeUnknownError when it or a part of it is nowhere or can't be read."""
        if name not in self._definitions:
            self._load(ros1_definition.require_type_name(name), ())
        return self._definitions[name]

    def md5(self, name: str) -> str:
        """Return the sum of a message; raises as ``definition``."""
        if name not in self._sums:
            self._sums[name] = ros1_definition.md5(ros1_definition.sum_text(self.definition(name), self.md5))
        return self._sums[name]

    def service_md5(self, name: str) -> str:
        """Return the sum of a service; raises as ``definition``."""
        return ros1_definition.md5("".join(ros1_definition.sum_text(self.definition(name + half), self.md5) for half in HALVES))

    def full_text(self, name: str) -> str:
        """Return the definition of a type and of all its parts, as connection headers have it."""
        return ros1_definition.full_text(self.definition(name), self.definition)

    def place(self, name: str) -> str:
        """Name where the definition of a type that is loaded was found."""
        return self._places[name]

    def _load(self, name: str, around: tuple[str, ...]) -> None:
        if name in self._definitions:
            return
        if name in around:
            raise TypeUnknownError(f"message type {name} contains itself")
        if len(around) == MOST_NESTED:
            raise TypeUnknownError(f"message type {around[0]} has more than {MOST_NESTED} messages within each other")
        text, place = self._find(name)
        definition = ros1_definition.parse_definition(name, text)
        for part in definition.parts:
            self._load(part, (*around, name))
        fields = [(field.name, _kind(field.base, field.array)) for field in definition.fields]
        self.fielddefs[msg_name(name)] = ([], fields or [(PADDING, (Nodetype.BASE, ("uint8", 0)))])
        self._definitions[name] = definition
        self._places[name] = place

    def _find(self, name: str) -> tuple[str, str]:
        for source in self._sources:
            if (text := source.message(name)) is not None:
                return text, source.places()
        places = ", ".join(source.places() for source in self._sources[:-1])
        raise TypeUnknownError(f"message type {name}: ROS 1's definition is neither in {places} nor known from a publisher")


def _kind(base: str, array: str) -> FieldDesc:
    """Return a field's kind as rosbags has it."""
    element: tuple[Nodetype, object]
    if base in {"time", "duration"}:
        element = (Nodetype.NAME, f"builtin_interfaces/msg/{base.capitalize()}")
    elif base in PRIMITIVES:
        element = (Nodetype.BASE, (base, 0))
    else:
        element = (Nodetype.NAME, msg_name(base))
    if not array:
        return cast("FieldDesc", element)
    return cast("FieldDesc", (Nodetype.ARRAY, (element, int(array[1:-1]))) if array != "[]" else (Nodetype.SEQUENCE, (element, 0)))
