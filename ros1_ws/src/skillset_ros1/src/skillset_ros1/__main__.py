"""``python -m skillset_ros1 SKILLSET --hooks MODULE:FACTORY``: serves a generated skillset as a node of ROS 1.

Ends with 0 after a signal to end, 2 when there is no such skillset or no such hooks.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from collections.abc import Sequence
from typing import Any

import rospy

from alula.runtime.core.errors import SkillRuntimeError
from skillset_ros1.main import run_skillset
from skillset_ros1.names import interfaces_of


class _UsageError(Exception):
    """The command line names something that is not there."""


def main(arguments: Sequence[str]) -> int:
    """Serve the skillset that the command line names; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m skillset_ros1", description="Serve a skillset as a node of ROS 1.")
    parser.add_argument("skillset", help="name of the skillset, as in its model")
    parser.add_argument("--hooks", required=True, metavar="MODULE:FACTORY", help="factory(managers) returns the hooks by skill")
    options = parser.parse_args(arguments)
    try:
        model = _module(f"{options.skillset}_managers.model", f"there is no skillset {options.skillset}: generate and build it first")
        factory = _factory(options.hooks)
        run_skillset(model.SKILLSET, interfaces_of(options.skillset), factory, data_bindings=model.DATA_TOPICS)
    except (_UsageError, SkillRuntimeError, ModuleNotFoundError) as error:
        sys.stderr.write(f"skillset_ros1: {error}\n")
        return 2
    return 0


def _module(name: str, otherwise: str) -> Any:
    """Import a module; raise _UsageError when it is not there, and whatever is raised inside it."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is None or not name.startswith(error.name):
            raise
        raise _UsageError(otherwise) from error


def _factory(words: str) -> Any:
    name, _, function = words.partition(":")
    if not function:
        raise _UsageError(f"--hooks {words}: a module and a function are wanted, as my_robot.navigation:make_hooks")
    module = _module(name, f"--hooks {words}: there is no module {name} on the PYTHONPATH")
    if not callable(getattr(module, function, None)):
        raise _UsageError(f"--hooks {words}: {name} has no function {function}")
    return getattr(module, function)


if __name__ == "__main__":
    # Without rospy's own words: __ns:=/robot1, topic:=other.
    sys.exit(main(rospy.myargv()[1:]))
