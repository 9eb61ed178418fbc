"""The rover's part of a live run: how fast it goes, and what ends it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from alula import parts

if TYPE_CHECKING:
    from argparse import ArgumentParser, Namespace

MAX_RATE = 1000.0


class RoverRun(parts.RunPart):
    """Adds ``--rate``, which the launch file takes by that name."""

    # Time ends with the simulator. All else is started again. Without a bridge no mission decides; of a navigation that stays dead the
    # mission hears by its hooks: README, Drives.
    consequences: Mapping[str, parts.Consequence] = {"simulator": parts.Consequence.END}
    stays_dead: Mapping[str, parts.Consequence] = {"ros_bridge": parts.Consequence.REST}

    def add_options(self, parser: ArgumentParser) -> None:
        """Add it."""
        parser.add_argument("--rate", type=float, default=1.0, help="simulated seconds per second at most, 0: no limit (default 1)")

    def read(self, given: Namespace, scenario: parts.Scenario) -> Mapping[str, Any]:
        """Return it; raises RequestError."""
        if not 0.0 <= given.rate <= MAX_RATE:  # also refuses nan
            raise parts.RequestError(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor up to {MAX_RATE:g}")
        return {"rate": given.rate}

    def clock_source(self, spec: parts.RunSpec) -> str:
        """Return what publishes ``/clock``, in words."""
        return "the simulator"

    def bring_to_rest(self, clock: parts.Clock) -> None:
        """Have it stand where it is."""
        from rover_robot.resting import stand  # late: it needs ROS 1

        stand(clock)
