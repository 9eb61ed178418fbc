"""What a robot adds to its live runs: its part ``run`` in ``robot.yaml`` makes a `RunPart`, once in each process that asks it."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Mapping, Sequence
from enum import Enum
from typing import Any, Protocol

from alula.common.public import public
from alula.common.robots import find_robot
from alula.common.scenarios import Scenario
from alula.runtime.live.spec import RunSpec


@public("alula.parts")
class Consequence(Enum):
    """What the supervisor does when a process has died by itself."""

    GO_ON = "go on"  # roslaunch starts it again, or the run can do without
    ABORT = "abort the mission"  # the mission can still bring the robot to rest
    REST = "bring the robot to rest"  # no mission decides any more
    END = "end the run"  # there is nothing left to run


DEAD_S = 10.0
"""Mission clock: a node that was not started again for so long stays dead."""


@public("alula.parts")
class Clock(Protocol):
    """The mission clock as the supervisor sees it."""

    @property
    def now_s(self) -> float | None:
        """Mission clock in seconds, or None before it is known."""
        ...

    @property
    def simulated(self) -> bool:
        """Return whether it is ``/clock``."""
        ...

    @property
    def stands_still(self) -> bool:
        """Return whether it has not moved for so long that nothing will move it any more."""
        ...


@public("alula.parts")
class RunPart:
    """What a robot adds to its live runs; this base adds nothing, and a robot's class overrides what it needs.

    The front, which needs no ROS, calls ``add_options`` to ``words``. The supervisor calls ``launch_arguments``, and the rest when its
    rospy node is there; ROS is imported there only.
    """

    faults: Mapping[str, Sequence[str]] = {}
    """What can fail in every scenario, each with the ways in which it can; scenarios add their own."""
    consequences: Mapping[str, Consequence] = {}
    """Of the death of a node; of one that is not here the run goes on."""
    stays_dead: Mapping[str, Consequence] = {}
    """Of the death of a node that does not run again within `DEAD_S`."""
    cameras: Mapping[str, str] = {}
    """Topics of sensor_msgs/Image that the operator's page shows thumbnails of, by the name there."""

    # --- in the front -------------------------------------------------------------------------------------------------

    def add_options(self, parser: ArgumentParser) -> None:
        """Add options to the command line."""

    def read(self, given: Namespace, scenario: Scenario) -> Mapping[str, Any]:  # noqa: ARG002
        """Check the options; return what the run is to know of them, as JSON has it; raises RequestError."""
        return {}

    def check_world(self, path: str) -> None:
        """Refuse a world's file that can't be used; raises RequestError."""

    def claim(self, spec: RunSpec) -> Mapping[str, Any]:
        """Return ports and the like, which depend on the run's domain; they go on top of ``own``. Raises RequestError, NoFreePortError."""
        return spec.own

    def words(self, spec: RunSpec) -> Sequence[str]:  # noqa: ARG002
        """Return what is to be said before the run starts, a line each."""
        return ()

    # --- in the supervisor --------------------------------------------------------------------------------------------

    def launch_arguments(self, spec: RunSpec) -> Mapping[str, object]:
        """Return what the launch file gets besides, or in place of, ``scenario``, ``out``, ``seed``, ``world`` and ``faults``."""
        return spec.own

    def listen(self, spec: RunSpec, departed: Callable[[float], None]) -> None:
        """Subscribe to what this part needs.

        ``departed`` may be called with the moment when the robot departed, seconds of mission clock; else the record tells it.
        """

    def clock_source(self, spec: RunSpec) -> str:  # noqa: ARG002
        """Say where ``/clock`` comes from."""
        return "/clock"

    def waits(self, spec: RunSpec, *, clock: bool) -> list[str]:  # noqa: ARG002
        """Return what the run waits for before it can begin, besides its clock, in words. ``clock``: the mission clock has begun."""
        return []

    def held(self, clock: Clock) -> str:  # noqa: ARG002
        """Return who else has the robot while it is not at rest, and how it is, in words; empty: nobody has.

        It is told every 10 s. A run whose mission is over goes on as long as there is something: until it is at rest, is ours again and is
        brought to rest, or somebody ends the run.
        """
        return ""

    def bring_to_rest(self, clock: Clock) -> None:
        """Bring the robot to rest because no mission decides any more; return when it is, or when that takes too long."""


def part_of_robot() -> RunPart:
    """Make the robot's part; raises RobotError where what its file names does not exist."""
    make = find_robot().part("run")
    part: RunPart = RunPart() if make is None else make()
    return part
