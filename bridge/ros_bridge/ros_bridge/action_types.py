"""Action types of both worlds: one ``.action`` file, from which ROS 1's genaction makes seven messages and ROS 2 its own."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ros_bridge import ros1_definition
from ros_bridge.errors import TypeUnknownError

if TYPE_CHECKING:
    from ros_bridge.conversion import TypePair, Types

DIVIDER = "---"
# What genaction puts before each part.
ENVELOPES = {
    "Goal": (("std_msgs/Header", "header"), ("actionlib_msgs/GoalID", "goal_id")),
    "Result": (("std_msgs/Header", "header"), ("actionlib_msgs/GoalStatus", "status")),
    "Feedback": (("std_msgs/Header", "header"), ("actionlib_msgs/GoalStatus", "status")),
}


@dataclass(frozen=True)
class Envelope:
    """A message type of ROS 1 around a part of an action: what rospy compares and passes on of it."""

    ros1_name: str
    md5sum: str
    full_text: str


@dataclass(frozen=True)
class Part:
    """The goal, result or feedback of an action: what crosses, and the message that carries it in ROS 1."""

    pair: TypePair
    envelope: Envelope


@dataclass(frozen=True)
class ActionType:
    """One action type in both worlds."""

    ros1_name: str
    goal: Part
    result: Part
    feedback: Part


def action_type(types: Types, ros1_name: str, ros2_name: str, prefixes: Iterable[Path]) -> ActionType:
    """Return an action type by its names ``package/Name``.

    Raises:
        TypeUnknownError: There is no ``.action`` file of it below the prefixes.
        TypeDiffersError: The worlds lay a part of it out differently.
    """
    texts = split(_action_text(ros2_name, [prefix / "share" for prefix in prefixes]))
    parts = (_part(types, ros1_name, ros2_name, kind, text) for kind, text in zip(ENVELOPES, texts, strict=True))
    return ActionType(ros1_name, *parts)


def _action_text(ros2_name: str, shares: list[Path]) -> str:
    package, name = ros2_name.split("/")
    for share in shares:
        if (path := share / package / "action" / f"{name}.action").is_file():
            return path.read_text(encoding="utf-8")
    places = ", ".join(map(str, shares)) or "an empty ament prefix path"
    raise TypeUnknownError(
        f"action type {ros2_name}: no {package}/action/{name}.action in {places}; build the package in the ROS 2 world",
    )


def _part(types: Types, ros1_name: str, ros2_name: str, kind: str, text: str) -> Part:
    pair = types.defined(ros1_name + kind, ros2_name + kind, text)
    outer = [(types.message(part), field) for part, field in ENVELOPES[kind]]
    fields = [*outer, (pair, kind.lower())]
    package, name = ros1_name.split("/")
    own_text = "".join(f"{part.ros1_name} {field}\n" for part, field in fields)
    parts = {part.ros1_name: part.full_text.split(ros1_definition.SEPARATOR)[0] for part, _ in fields}
    for part, _ in fields:
        for piece in part.full_text.split(ros1_definition.SEPARATOR)[1:]:
            title, _, body = piece.strip("\n").partition("\n")
            parts.setdefault(title.removeprefix("MSG:").strip(), body)
    full_text = own_text + "".join(f"{ros1_definition.SEPARATOR}\nMSG: {part}\n{body}\n" for part, body in parts.items())
    md5sum = ros1_definition.md5("\n".join(f"{part.md5sum} {field}" for part, field in fields))
    return Part(pair, Envelope(f"{package}/{name}Action{kind}", md5sum, full_text))


def split(text: str) -> tuple[str, str, str]:
    """Return the goal's, result's and feedback's definitions of an ``.action`` text; a part that is missing is empty."""
    parts: list[list[str]] = [[]]
    for line in text.splitlines():
        if line.strip() == DIVIDER:
            parts.append([])
        else:
            parts[-1].append(line)
    goal, result, feedback = ["\n".join(part) for part in [*parts, [], []][:3]]
    return goal, result, feedback
