"""The rover's part of a replay from sensors: localisation and health are computed again; the navigation moved the rover as it did."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import yaml
from actionlib_msgs.msg import GoalStatus
from move_base_msgs.msg import MoveBaseActionGoal, MoveBaseActionResult
from node_core import Core
from node_core.replay import Arrival, Replayed, SensorPart, dead, frozen
from node_core.replay.part import ReplayPartError

from rover_navigation import health_core, localization
from rover_navigation.grid_map import MapError, load_map

COVERED_M = 0.12  # range at which what covers half of the laser is seen
RESULT = "/localize/result"


def make(replay: Replayed) -> Mapping[str, Core]:
    """Make the cores; the world says which map there was, and where the rover started."""
    if replay.world is None:
        raise ReplayPartError("a bag of the rover can't be perceived without the run's record: it tells the world, and so the map")
    try:
        world = yaml.safe_load(replay.world.read_text(encoding="utf-8"))
        grid, dock = load_map(replay.world.with_name(world["map"])), tuple(world["dock"])
    except (OSError, KeyError, TypeError, yaml.YAMLError, MapError) as error:
        raise ReplayPartError(f"{replay.world}: is no world with a map and a dock: {error}") from error
    core = localization.Localization(grid, dock, replay.host(localization.NAME, localization.OUTPUTS))
    _serve_searches(replay, core)
    return {localization.NAME: core, health_core.NAME: health_core.Health(replay.host(health_core.NAME, health_core.OUTPUTS))}


def _serve_searches(replay: Replayed, core: localization.Localization) -> None:
    """Search when `/localize` was asked to, and tell what comes of it now; a search that was preempted then is now, too."""
    ended: set[str] = set()

    def on_goal(message: MoveBaseActionGoal) -> bool:
        def ends(found: bool, text: str) -> None:
            result = MoveBaseActionResult(header=message.header)
            result.status = GoalStatus(message.goal_id, GoalStatus.SUCCEEDED if found else GoalStatus.ABORTED, text)
            ended.add(message.goal_id.id)
            replay.publish(RESULT, result)

        core.begin_search(ends)
        return True

    def on_result(message: MoveBaseActionResult) -> bool:
        if message.status.goal_id.id in ended:
            return False
        if message.status.status == GoalStatus.PREEMPTED:
            core.stop_search()
            return True
        return False

    replay.hear("/localize/goal", on_goal)
    replay.hear(RESULT, on_result)


def _covered(arrival: Arrival) -> Iterable[tuple[Any, int]]:
    """Cover the left half of the laser."""
    ranges = list(arrival.message.ranges)
    arrival.message.ranges = [COVERED_M if number >= len(ranges) // 2 else range_m for number, range_m in enumerate(ranges)]
    yield arrival.message, arrival.at_ns


def _stuck(arrival: Arrival) -> Iterable[tuple[Any, int]]:
    """Press the bumper for good."""
    arrival.message.data = True
    yield arrival.message, arrival.at_ns


SENSORS = SensorPart(
    measured={"/scan": "laser", "/odom": "odometry", "/bumper": "bumper", "/battery_state": "battery"},
    reports={
        "perception.laser": ("/scan",),
        "perception.bumper_status": ("/bumper",),
        "base.pose_status": ("/scan", "/odom"),
        "base.base_status": ("/battery_state",),
        "base.authority": ("/odom",),
        "power.charger": ("/battery_state",),
    },
    nodes=(),
    make=make,
    ways={"laser": {"dead": dead, "frozen": frozen, "covered": _covered}, "bumper": {"stuck": _stuck}},
)
