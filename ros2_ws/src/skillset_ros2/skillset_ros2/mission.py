"""A robot's mission as a process: its arguments, and the node `/mission` (``skillset_ros2.mission_node``).

usage: python -m skillset_ros2.mission --scenario NAME --out DIR [--world NAME|FILE] [--ros-args ...]

Ends with 0 (accomplished, also when degraded), 1 (given up or aborted), 2 (could not start).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import rclpy.utilities

from alula.common.robots import RobotError, find_robot
from alula.common.scenarios import ScenarioError, load_scenario
from alula.language.errors import LanguageError
from alula.language.fleet import load_models, places_of
from alula.missions.director import EXIT_CODES, Outcome
from alula.missions.plan import InputError
from alula.missions.scenario import check_names, inputs_of, plan_of
from skillset_ros2.mission_node import run_mission


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the command line's values; wrong ones print the usage on stderr and exit with code 2."""
    parser = argparse.ArgumentParser(prog="mission", description="Run a mission of the robot.")
    parser.add_argument("--scenario", required=True, help="name of a scenario of the robot")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder")
    parser.add_argument("--world", default="", help="world that the mission's inputs are taken from, by name or file")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the mission; return the exit code."""
    words = list(sys.argv if arguments is None else arguments)
    options = parse(rclpy.utilities.remove_ros_args(words)[1:])
    try:
        scenario = load_scenario(options.scenario)
        inputs, robot = inputs_of(scenario, options.world), find_robot()
        models = load_models(robot).skillsets
        check_names(scenario, models)
        plan = replace(plan_of(scenario, inputs, models), places=places_of(robot))
        options.out.mkdir(parents=True, exist_ok=True)
    except (ScenarioError, RobotError, LanguageError, InputError, OSError) as error:
        sys.stderr.write(f"mission: {error}\n")
        return EXIT_CODES[Outcome.NOT_STARTED]
    return run_mission(plan, options.out, words)


if __name__ == "__main__":
    sys.exit(main())
