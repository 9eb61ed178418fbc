"""What the mocks of a robot do; those of a fleet's robots do what they do by themselves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from alula.common.robots import RobotFolder
from alula.mock import Behaviour, load_behaviour
from alula.model.model import Skillset
from alula.records.models import members, robot_model


def behaviour_of(robot: RobotFolder, files: Sequence[Path] = (), skillsets: Sequence[Skillset] | None = None) -> Behaviour:
    """Return what a robot's mocks do, with behaviour files on top; ``skillsets`` in the place of the robot's own.

    Raises:
        AnalysisError, SkillRuntimeError: a model or a file is wrong, with its place.
    """
    models = robot_model(robot).skillsets if skillsets is None else skillsets
    own = load_behaviour([*robot.behaviour_files, *files], models)
    beside = [behaviour_of(one.robot, one.mocks, one.skillsets).named(one.name) for one in members(robot, models)]
    return replace(own, beside=tuple(beside))
