"""What the mocks of a robot do; those of a fleet's robots do what they do by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from alula.common.robots import RobotFolder, fleet_name
from alula.mock import Behaviour, load_behaviour
from alula.records.models import robot_model


def behaviour_of(robot: RobotFolder, files: Sequence[Path] = ()) -> Behaviour:
    """Return what a robot's mocks do, with behaviour files on top.

    Raises:
        AnalysisError, SkillRuntimeError: a model or a file is wrong, with its place.
    """
    own = load_behaviour([*robot.behaviour_files, *files], robot_model(robot).skillsets)
    beside = [behaviour_of(one, robot.mocks_on_top(name)).named(partial(fleet_name, name)) for name, one in robot.robots.items()]
    return replace(own, beside=tuple(beside))
