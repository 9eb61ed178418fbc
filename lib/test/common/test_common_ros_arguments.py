"""Words of both ROS worlds on one command line."""

from __future__ import annotations

import pytest

from alula.common.ros_arguments import split_arguments, without_roslaunch

NAMESPACE = ["--ros-args", "-r", "__ns:=/rover", "--remap", "__node:=x", "-p", "use_sim_time:=true"]


@pytest.mark.parametrize(
    ("arguments", "ours", "ros2"),
    [
        (["--all"], ["--all"], []),
        (["--all", "__name:=bridge", "__log:=/x"], ["--all", "__name:=bridge", "__log:=/x"], []),
        (["--all", *NAMESPACE], ["--all"], NAMESPACE),
        (["--all", *NAMESPACE, "__name:=bridge", "__log:=/x"], ["--all", "__name:=bridge", "__log:=/x"], NAMESPACE),
    ],
)
def test_each_world_gets_its_words(arguments: list[str], ours: list[str], ros2: list[str]) -> None:
    assert split_arguments(arguments) == (ours, ros2)


def test_what_roslaunch_adds_is_left_out_and_a_namespace_of_ros2_stays() -> None:
    assert without_roslaunch(["--part", "all", *NAMESPACE, "__name:=x", "__log:=/y"]) == ["--part", "all", *NAMESPACE]
