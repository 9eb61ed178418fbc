"""What follows on the end of a mission: the robot is brought to rest, and watched as long as somebody else has it."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait

from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RunSpec
from alula_flight.mission_clock import MissionClock
from alula_flight.waits import Held

LOOK_S = 0.2  # wall clock; how often it is looked what is new while the robot is brought to rest


class Rest:
    """Brings a robot to rest for its supervisor.

    Args:
        spec: what the run was asked to be.
        part: the robot's part of the run.
        clock: the mission clock.
        look: waits a moment, and looks what is new.
        told_to_end: tells whether somebody, or the run's limit, wants the run to end.
        note_abort: notes who it was, and why.
        lost: tells whether there is nothing left to bring to rest.
    """

    def __init__(
        self,
        spec: RunSpec,
        part: RunPart,
        clock: MissionClock,
        *,
        look: Callable[[], None],
        told_to_end: Callable[[], bool],
        note_abort: Callable[[], None],
        lost: Callable[[], bool] = lambda: False,
    ) -> None:
        self.held = Held(spec, part.held, clock)
        """Tells of who else has the robot."""
        self._resting = Held(spec, part.resting, clock)
        self._part, self._clock = part, clock
        self._look, self._told_to_end, self._note_abort, self._lost = look, told_to_end, note_abort, lost

    def bring(self) -> None:
        """Have the part bring the robot to rest; where somebody else has it, go on until it is at rest, or it can be brought there.

        No run that was told to end before does so, and being told ends it: then somebody knows how it is.
        """
        told_before = self._told_to_end()
        while True:
            held = self.held.look()
            self._bring_once()
            # Looked at before and after: it may have been given back just after the part had found that it was not ours.
            if not (held or self.held.look()) or told_before or self._clock.stands_still or self._lost():
                return
            if self._told_to_end():
                self._note_abort()
                return
            self._look()

    def _bring_once(self) -> None:
        """Have the part bring the robot to rest; look meanwhile what is new, for that takes up to minutes."""
        self._resting.restart()
        with ThreadPoolExecutor(1) as thread:
            brought = thread.submit(self._part.bring_to_rest, self._clock)
            while wait([brought], LOOK_S).not_done:
                self._look()
                self._resting.look()
            brought.result()
