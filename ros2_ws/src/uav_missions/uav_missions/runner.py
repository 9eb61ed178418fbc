"""The mission's process: its arguments, and the node `/mission` (``skillset_ros2.mission_node``).

usage: mission --scenario mapping --out DIR --route FILE [--ros-args ...]

Ends with 0 (accomplished, also when degraded), 1 (given up or aborted), 2 (could not start).
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

import rclpy.utilities

from alula.common.scenarios import ScenarioError, load_scenario
from alula.missions.director import EXIT_CODES, Outcome
from skillset_ros2.mission_node import run_mission
from uav_missions.plan import plan_of, write_route
from uav_missions.route import RouteError, load_route


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Read the arguments."""
    parser = argparse.ArgumentParser(prog="mission", description="Fly a mission.")
    parser.add_argument("--scenario", default="mapping", help="which one of the folder scenarios")
    parser.add_argument("--out", type=Path, required=True, help="the run's folder")
    parser.add_argument("--route", type=Path, required=True, help="YAML or JSON file with the key 'route': a list of [x, y, z]")
    return parser.parse_args(arguments)


def main(arguments: Sequence[str] | None = None) -> int:
    """Fly the mission; return the exit code."""
    words = list(sys.argv if arguments is None else arguments)
    options = parse(rclpy.utilities.remove_ros_args(words)[1:])
    try:
        route = load_route(options.route)
        plan = plan_of(load_scenario(options.scenario), route)
        options.out.mkdir(parents=True, exist_ok=True)
        write_route(options.out, route)
    except (RouteError, ScenarioError, OSError) as error:
        sys.stderr.write(f"mission: {error}\n")
        return EXIT_CODES[Outcome.NOT_STARTED]
    return run_mission(plan, options.out, words)
