"""The rover's part of a report: the floor and the way it went, for the page's map, and how long that was."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from alula.report.part import Findings, NoPart

if TYPE_CHECKING:
    from collections.abc import Iterator

    from alula.report.part import Entry, ReportedRun
    from alula.report.phases import Phases

BAG, TRUTH = "functional.bag", "/truth/odom"
PERIOD_S = 0.2
"""Between two places of the way on the page."""
Place = tuple[float, float, float]
"""Seconds of mission clock, x and y in metres, frame map."""


class RoverReport(NoPart):
    """Of a run over mocks there is nothing to show: there is no floor."""

    def __init__(self, run: ReportedRun) -> None:
        self._run = run
        self._way: list[Place] = []

    def measure(self, phases: Phases, *_: object) -> Findings:
        """Read where the rover truly was; ``distance_m``: how far it went since it left its dock."""
        if self._run.facts.mock:
            return Findings({"distance_m": None})
        with self._run.problems.survive(BAG):
            self._way = list(_places(str(self._run.folder / BAG)))
        since = phases.zero_s
        away = [place[1:] for place in self._way if place[0] >= since]
        return Findings({"distance_m": round(sum(map(math.dist, away, away[1:])), 2) if away else None})

    def entries(self) -> Iterator[Entry]:
        """Return the outlines of what stands on the floor, and the way."""
        if self._run.facts.mock:
            return
        with self._run.problems.survive("the world"):
            yield "/world", None, _edges(self._run)
        last_s = -math.inf
        for t_s, x, y in self._way:
            if t_s - last_s >= PERIOD_S:
                last_s = t_s
                yield "/path", round(t_s, 3), [round(x, 3), round(y, 3), 0.0]


def _places(bag: str) -> Iterator[Place]:
    import rosbag  # late: runs over mocks have no ROS 1

    with rosbag.Bag(bag) as file:
        for _, message, _ in file.read_messages(TRUTH):
            at = message.pose.pose.position
            yield message.header.stamp.to_sec(), at.x, at.y


def _edges(run: ReportedRun) -> list[list[float]]:
    import shapely
    from alula.common.robots import find_robot

    from rover_simulator.drawing import outlines
    from rover_simulator.world import load_world

    standing: Any = outlines(load_world(find_robot().world(run.scenario.world)))
    rings = [ring for part in shapely.get_parts(standing) for ring in (part.exterior, *part.interiors)]
    lines = [(one, other) for ring in rings for one, other in zip(list(ring.coords), list(ring.coords)[1:], strict=False)]
    return [[round(value, 2) for x, y in line for value in (x, y, 0.0)] for line in lines]
