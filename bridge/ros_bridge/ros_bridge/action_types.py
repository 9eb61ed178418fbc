"""Action types of both worlds: one ``.action`` file, from which ROS 1's genaction makes seven messages and ROS 2 its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ros_bridge import ros1_definition

if TYPE_CHECKING:
    from ros_bridge.conversion import TypePair, Types

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

    @property
    def parts(self) -> tuple[Part, ...]:
        """All of them."""
        return self.goal, self.result, self.feedback


def action_type(types: Types, ros1_name: str, ros2_name: str) -> ActionType:
    """Return an action type by its names ``package/Name``.

    Raises:
        TypeUnknownError: There is no ``.action`` file of it in ROS 2.
        TypeDiffersError: The worlds lay a part of it out differently.
    """
    types.require_action(ros2_name)
    parts = (_part(types, ros1_name, ros2_name, kind) for kind in ENVELOPES)
    return ActionType(ros1_name, *parts)


def _part(types: Types, ros1_name: str, ros2_name: str, kind: str) -> Part:
    pair = types.message(ros1_name + kind, ros2_name + kind)
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
