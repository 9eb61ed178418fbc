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
    """What the death of a node leads to, by name; after that of any other node the run goes on."""
    stays_dead: Mapping[str, Consequence] = {}
    """What it leads to, by name, that a dead node does not run again within `DEAD_S`."""
    cameras: Mapping[str, str] = {}
    """Topics of sensor_msgs/Image that the operator's page shows thumbnails of, by the name there."""

    # --- in the front -------------------------------------------------------------------------------------------------

    def add_options(self, parser: ArgumentParser) -> None:
        """Add options to the command line."""

    def read(self, given: Namespace, scenario: Scenario) -> Mapping[str, Any]:  # noqa: ARG002
        """Check the options; return the values that the run needs, which JSON can hold; raises RequestError."""
        return {}

    def check_world(self, path: str) -> None:
        """Refuse a world's file that can't be used; raises RequestError."""

    def claim(self, spec: RunSpec) -> Mapping[str, Any]:
        """Return ``own`` with what depends on the run's domain, such as ports. Raises RequestError, NoFreePortError."""
        return spec.own

    def words(self, spec: RunSpec) -> Sequence[str]:  # noqa: ARG002
        """Return lines to be printed before the run starts."""
        return ()

    # --- in the supervisor --------------------------------------------------------------------------------------------

    def launch_arguments(self, spec: RunSpec) -> Mapping[str, object]:
        """Return what the launch file gets besides, or in place of, ``scenario``, ``out``, ``seed``, ``world`` and ``faults``."""
        return spec.own

    def listen(self, spec: RunSpec, departed: Callable[[float], None]) -> None:
        """Subscribe to the topics that this part needs.

        ``departed`` may be called with the moment when the robot departed, seconds of mission clock; else the record tells it.
        """

    def clock_source(self, spec: RunSpec) -> str:  # noqa: ARG002
        """Return what publishes ``/clock``, in words."""
        return "/clock"

    def waits(self, spec: RunSpec, *, clock: bool) -> list[str]:  # noqa: ARG002
        """Return what the run still waits for before it can begin, in words, its clock aside. ``clock``: the mission clock has begun."""
        return []

    def held(self, clock: Clock) -> str:  # noqa: ARG002
        """Return who else controls the robot while it is not at rest, and what it does, in words; empty: nobody.

        It is printed every 10 s. A run whose mission is over goes on until this is empty, and the robot is brought to rest where it is
        not, or until somebody ends the run.
        """
        return ""

    def bring_to_rest(self, clock: Clock) -> None:
        """Bring the robot to rest when no mission decides any more; return once it is at rest, or after a time limit."""

    def resting(self, clock: Clock) -> str:  # noqa: ARG002
        """Return what is still to happen until the robot is at rest, in words; empty: nothing that is worth telling.

        It is printed every 10 s while ``bring_to_rest`` runs, which does so in another thread.
        """
        return ""


def part_of_robot() -> RunPart:
    """Make the robot's part; raises RobotError where what its file names does not exist."""
    make = find_robot().part("run")
    part: RunPart = RunPart() if make is None else make()
    return part
