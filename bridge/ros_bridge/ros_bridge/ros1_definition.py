"""Definitions as ROS 1 reads them: fields and constants of a ``.msg`` text, and the MD5 sums that ROS 1 peers compare.

The rule (ROS wiki, "ROS/Technical Overview", and what genmsg does): constants first, in order, as ``type name=value``; then
fields as ``type name``, where a message type is replaced by its own sum; comments and blanks removed. A service's sum is taken
over the texts of request and response, one behind the other without anything between.

Not rosbags' ``generate_msgdef``: it knows no services, sums constants by their values instead of as they are written (``0x10`` as
``16``), and takes underscores off the ends of names. A peer with the other sum refuses the connection. A test tells when it is right.
"""

from __future__ import annotations

import hashlib
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

from ros_bridge.errors import TypeUnknownError

NUMBERS = {f"{kind}int{bits}" for kind in ("", "u") for bits in (8, 16, 32, 64)} | {"float32", "float64"}
PRIMITIVES = frozenset({*NUMBERS, "bool", "string", "time", "duration", "byte", "char"})
# What ROS 2 calls the two primitives that it has made into messages.
ROS2_TIMES = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}
SEPARATOR = "=" * 80
CONSTANT = re.compile(r"(?P<base>\w+)\s+(?P<name>\w+)\s*=(?P<value>.*)")  # a string's value reaches to the end of the line, # included
FIELD = re.compile(r"(?P<base>[A-Za-z][A-Za-z0-9_]*(/[A-Za-z][A-Za-z0-9_]*)?)(?P<array>\[\d{0,10}\])?")
FIELD_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
TYPE_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*/[A-Za-z][A-Za-z0-9_]*")
ROS2_ALONE = frozenset({"wstring", "octet", "boolean"})


@dataclass(frozen=True)
class Field:
    """One field: ``base`` is a primitive or ``package/Name``, ``array`` is empty, ``[]`` or ``[N]``."""

    base: str
    array: str
    name: str


@dataclass(frozen=True)
class Definition:
    """A message definition: its text as written, its constants as the sum wants them, its fields."""

    type_name: str
    text: str
    constants: tuple[str, ...]
    fields: tuple[Field, ...]

    @property
    def parts(self) -> tuple[str, ...]:
        """The message types that fields have, each once, in order."""
        return tuple(dict.fromkeys(field.base for field in self.fields if field.base not in PRIMITIVES))


def require_type_name(name: str) -> str:
    """Return a type's name if it is ``package/Name``; raises TypeUnknownError."""
    if TYPE_NAME.fullmatch(name) is None:
        raise TypeUnknownError(f"'{name}' is no name of a type; those are package/Name, such as std_msgs/String")
    return name


def parse_definition(type_name: str, text: str) -> Definition:
    """Read a ``.msg`` text; ``type_name`` is ``package/Name``.

    Raises:
        TypeUnknownError: A line is none that ROS 1 could have, such as a default value or a bounded type.
    """
    constants: list[str] = []
    fields: list[Field] = []
    for line in text.splitlines():
        code = line.split("#")[0].strip()
        if not code:
            continue
        constant = CONSTANT.fullmatch(line.strip() if code.startswith("string ") else code)
        if constant is not None:
            constants.append(f"{constant['base']} {constant['name']}={constant['value'].strip()}")
        else:
            fields.append(_field(type_name, code))
    twice = next((name for name, number in Counter(field.name for field in fields).items() if number > 1), None)
    if twice is not None:
        raise TypeUnknownError(f"{type_name}: two fields are called '{twice}'")
    return Definition(type_name, text, tuple(constants), tuple(fields))


def _field(type_name: str, code: str) -> Field:
    words = code.split()
    match = FIELD.fullmatch(words[0])
    if match is None or len(words) != 2 or FIELD_NAME.fullmatch(words[1]) is None:
        raise TypeUnknownError(f"{type_name}: '{code}' can't be a ROS 1 field; ROS 1 has neither bounded types nor default values")
    if match["base"] in ROS2_ALONE:
        raise TypeUnknownError(f"{type_name}: field '{words[1]}' is a {match['base']}, and ROS 1 has no such kind of field")
    base = ROS2_TIMES.get(match["base"], match["base"])
    if base == "Header":
        base = "std_msgs/Header"
    elif "/" not in base and base not in PRIMITIVES:
        base = f"{type_name.split('/', maxsplit=1)[0]}/{base}"
    return Field(base, match["array"] or "", words[1])


def sum_text(definition: Definition, md5_of: Callable[[str], str]) -> str:
    """Return the text whose MD5 is the type's sum; ``md5_of`` gives the sum of a field's type."""
    lines = list(definition.constants)
    lines += [
        f"{field.base}{field.array} {field.name}" if field.base in PRIMITIVES else f"{md5_of(field.base)} {field.name}"
        for field in definition.fields
    ]
    return "\n".join(lines)


def md5(text: str) -> str:
    """Return the MD5 sum of a text in hexadecimal; ROS 1 uses it as a fingerprint, not for security."""
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def full_text(definition: Definition, definition_of: Callable[[str], Definition]) -> str:
    """Return the definition followed by those of all its parts, as rosbag and rostopic want it in a connection's header."""
    seen: dict[str, Definition] = {}

    def collect(parts: tuple[str, ...]) -> None:
        for part in parts:
            if part not in seen:
                seen[part] = definition_of(part)
                collect(seen[part].parts)

    collect(definition.parts)
    return "\n".join([definition.text, *(f"{SEPARATOR}\nMSG: {name}\n{part.text}" for name, part in seen.items())])
