"""Words on the command line of a process that roslaunch starts and that is a node of ROS 2: each world takes its own."""

from __future__ import annotations

from collections.abc import Sequence

ROS_ARGUMENTS = "--ros-args"
REMAP = ("-r", "--remap")


def without_roslaunch(arguments: Sequence[str]) -> list[str]:
    """Return the words without those that roslaunch adds for ROS 1 (``__name:=...``), which rclpy refuses; ``-r __ns:=...`` is ROS 2's."""
    return [word for before, word in zip(["", *arguments], arguments, strict=False) if not _is_of_roslaunch(before, word)]


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Return the words for the program and its ROS 1 side, and those for its ROS 2 side."""
    ros2 = without_roslaunch(arguments)
    ros2 = ros2[ros2.index(ROS_ARGUMENTS) :] if ROS_ARGUMENTS in ros2 else []
    begin = arguments.index(ROS_ARGUMENTS) if ROS_ARGUMENTS in arguments else len(arguments)
    behind = zip(arguments[begin:], arguments[begin + 1 :], strict=False)
    return [*arguments[:begin], *(word for before, word in behind if _is_of_roslaunch(before, word))], ros2


def _is_of_roslaunch(before: str, word: str) -> bool:
    return word.startswith("__") and ":=" in word and before not in REMAP
