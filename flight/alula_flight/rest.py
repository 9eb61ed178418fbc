"""What follows on the end of a mission: the robot is brought to rest, and watched as long as somebody else has it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass

from alula.runtime.live.part import RunPart
from alula_flight.mission_clock import MissionClock
from alula_flight.waits import Held

LOOK_S = 0.2  # wall clock; how often it is looked what is new while the robot is brought to rest


@dataclass(frozen=True)
class Rest:
    """Brings a robot to rest for its supervisor.

    Attributes:
        part: the robot's part of the run.
        clock: the mission clock.
        held: tells of who else has the robot.
        resting: tells what is still to happen while it is brought to rest.
        look: waits a moment, and looks what is new.
        told_to_end: tells whether somebody, or the run's limit, wants the run to end.
        note_abort: notes who it was, and why.
        lost: tells whether there is nothing left to bring to rest.
    """

    part: RunPart
    clock: MissionClock
    held: Held
    resting: Held
    look: Callable[[], None]
    told_to_end: Callable[[], bool]
    note_abort: Callable[[], None]
    lost: Callable[[], bool] = lambda: False

    def bring(self) -> None:
        """Have the part bring the robot to rest; where somebody else has it, go on until it is at rest, or it can be brought there.

        No run that was told to end before does so, and being told ends it: then somebody knows how it is.
        """
        told_before = self.told_to_end()
        while True:
            held = self.held.look()
            self._bring_once()
            # Looked at before and after: it may have been given back just after the part had found that it was not ours.
            if not (held or self.held.look()) or told_before or self.clock.stands_still or self.lost():
                return
            if self.told_to_end():
                self.note_abort()
                return
            self.look()

    def _bring_once(self) -> None:
        """Have the part bring the robot to rest; look meanwhile what is new, for that takes up to minutes."""
        self.resting.restart()
        with ThreadPoolExecutor(1) as thread:
            brought = thread.submit(self.part.bring_to_rest, self.clock)
            while wait([brought], LOOK_S).not_done:
                self.look()
                self.resting.look()
            brought.result()
