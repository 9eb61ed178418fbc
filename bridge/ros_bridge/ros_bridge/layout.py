"""Layout programs: what the native data plane runs to convert a type's bytes, compiled from its definition.

An operation is four numbers: a code and its operands, as ``layout.hpp`` of ros_bridge_native has them. Fields of fixed size that lie
one behind the other without padding in CDR become one copy, also arrays of such messages: an image is four copies and two strings.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, cast

from rosbags.interfaces import Nodetype

from ros_bridge.errors import TypeUnknownError

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rosbags.interfaces.typing import FieldDesc, Typesdict

HEADER = "std_msgs/msg/Header"
PADDING = "structure_needs_at_least_one_member"  # ROS 2 gives an empty message one byte
SIZES = {"bool": 1, "byte": 1, "char": 1, "octet": 1, "float32": 4, "float64": 8}
SIZES |= {f"{sign}int{bits}": bits // 8 for sign in ("", "u") for bits in (8, 16, 32, 64)}
MOST_REPETITIONS = 1 << 20
MOST_OPERATIONS = 100_000  # a few types that have each other ten times make millions
MOST_BYTES = 1 << 30


class Code(IntEnum):
    """What an operation does; operands are named as in ``Operation``."""

    FIXED = 0  # a: alignment, b: bytes
    SEQUENCE = 1  # a: alignment, b: bytes of an element
    STRING = 2
    SEQUENCE_NUMBER = 3
    PADDING = 4
    REPEAT = 5  # a: times, b: operations of the body
    REPEAT_COUNTED = 6  # b: operations of the body, c: least bytes of an element in ROS 1


@dataclass(frozen=True)
class Operation:
    """One operation; ``least`` is the fewest bytes that it takes in ROS 1, body included."""

    code: Code
    a: int = 0
    b: int = 0
    c: int = 0
    least: int = 0


def compile_program(definitions: Typesdict, name: str) -> tuple[int, ...]:
    """Return the program of a message type ``package/msg/Name`` as a flat row of numbers, four an operation.

    Raises:
        TypeUnknownError: ROS 1 has no such type of field (wstring, long double), or a message would be too large.
    """
    return tuple(number for each in _message(definitions, name) for number in (each.code, each.a, each.b, each.c))


def _message(definitions: Typesdict, name: str) -> list[Operation]:
    operations: list[Operation] = []
    if name == HEADER:
        operations.append(Operation(Code.SEQUENCE_NUMBER, least=4))
    for field, kind in definitions[name][1]:
        if field == PADDING:
            operations.append(Operation(Code.PADDING))
        else:
            _join(operations, _field(definitions, kind))
        if len(operations) > MOST_OPERATIONS:
            break
    if len(operations) > MOST_OPERATIONS or any(each.least > MOST_BYTES for each in operations):
        raise TypeUnknownError(
            f"message type {name.replace('/msg/', '/')} is more than the bridge converts ({MOST_OPERATIONS} fields with those of parts, "
            f"{MOST_BYTES} bytes of a field)",
        )
    return operations


def _field(definitions: Typesdict, kind: FieldDesc) -> list[Operation]:
    """Return the operations of a field's type."""
    if kind[0] == Nodetype.NAME:
        return _message(definitions, str(kind[1]))
    if kind[0] == Nodetype.BASE:
        return [_primitive(cast("tuple[str, int]", kind[1])[0])]
    element, number = cast("tuple[FieldDesc, int]", kind[1])
    body = _field(definitions, element)
    return _array(body, number) if kind[0] == Nodetype.ARRAY else [*_sequence(body)]


def _primitive(base: str) -> Operation:
    if base == "string":
        return Operation(Code.STRING, least=4)
    if base not in SIZES:
        raise TypeUnknownError(f"ROS 1 has no fields of type {base}")
    return Operation(Code.FIXED, SIZES[base], SIZES[base], least=SIZES[base])


def _array(body: list[Operation], number: int) -> list[Operation]:
    if number > MOST_REPETITIONS and not _is_block(body):
        raise TypeUnknownError(f"an array of {number} messages is more than the bridge converts ({MOST_REPETITIONS})")
    if not body or number == 0:
        return []
    if _is_block(body):
        return [Operation(Code.FIXED, body[0].a, body[0].b * number, least=body[0].b * number)]
    return [Operation(Code.REPEAT, number, len(body), least=number * _least(body)), *body]


def _sequence(body: list[Operation]) -> Iterable[Operation]:
    if _is_block(body):
        return (Operation(Code.SEQUENCE, body[0].a, body[0].b, least=4),)
    return (Operation(Code.REPEAT_COUNTED, 0, len(body), _least(body), least=4), *body)


def _is_block(body: list[Operation]) -> bool:
    """Return whether elements lie one behind the other without padding between them."""
    return len(body) == 1 and body[0].code is Code.FIXED and body[0].b % body[0].a == 0


def _least(body: list[Operation]) -> int:
    """Return the fewest bytes that the operations take in ROS 1; a repetition's own number has its body's in it."""
    total, position = 0, 0
    while position < len(body):
        operation = body[position]
        total += operation.least
        position += 1 + (operation.b if operation.code in {Code.REPEAT, Code.REPEAT_COUNTED} else 0)
    return total


def _join(operations: list[Operation], more: list[Operation]) -> None:
    """Append operations; two copies of which the second needs no padding behind the first become one."""
    last = operations[-1] if operations else None
    # The last of a repetition's body must not grow: what follows is not repeated.
    if last is not None and more and last.code is more[0].code is Code.FIXED and not _ends_with_repetition(operations):
        first = more[0]
        if first.a <= last.a and last.b % first.a == 0:
            operations[-1] = Operation(Code.FIXED, last.a, last.b + first.b, least=last.least + first.least)
            more = more[1:]
    operations.extend(more)


def _ends_with_repetition(operations: list[Operation]) -> bool:
    position = 0
    while position < len(operations):
        operation = operations[position]
        body = operation.b if operation.code in {Code.REPEAT, Code.REPEAT_COUNTED} else 0
        position += 1 + body
        if position == len(operations):
            return body > 0
    return False
