"""What a run waits for before it can begin, and until its robot is at rest: found by the supervisor, said by the front."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

from alula.common.run_log import note_held, note_wait
from alula.runtime.live.part import RunPart
from alula.runtime.live.spec import RunSpec
from alula_flight.mission_clock import MissionClock

TELL_CLOCK_S, LOOK_S = 5.0, 1.0  # wall clock until it is told that time has not begun, and how often it is looked
TELL_HELD_S = 10.0  # mission clock; how often it is told what keeps the robot from rest


class Beginning:
    """Follows a run until it has begun, and writes down what it waits for, each thing once."""

    def __init__(self, spec: RunSpec, part: RunPart, clock: MissionClock) -> None:
        self._spec = spec
        self._part = part
        self._clock = clock
        self._open: list[str] = []
        self._began_s = self._due_s = time.monotonic()
        self._begun = False

    def look(self) -> None:
        """Write down what is newly waited for, and what is no more."""
        if self._begun or time.monotonic() < self._due_s:
            return
        self._due_s = time.monotonic() + LOOK_S
        words = self._words()
        self._begun = self._clock.began and not words
        changed = [(one, False) for one in words if one not in self._open] + [(one, True) for one in self._open if one not in words]
        self._open = words
        for one, over in changed:
            note_wait(Path(self._spec.out_dir), one, over=over)

    def _words(self) -> list[str]:
        words = self._part.waits(self._spec, clock=self._clock.began)
        # A simulator takes a while in each run.
        if self._clock.simulated and not self._clock.began and time.monotonic() >= self._began_s + TELL_CLOCK_S:
            words = [f"{self._part.clock_source(self._spec)}, whose first step begins the mission clock", *words]
        return words


class Held:
    """Follows what keeps a robot from rest, and writes down how it is: every 10 s, the first time after as many.

    ``words`` tells it: who else has the robot (`RunPart.held`), or what is still to happen (`RunPart.resting`); empty: nothing.
    """

    def __init__(self, spec: RunSpec, words: Callable[[MissionClock], str], clock: MissionClock) -> None:
        self._out = Path(spec.out_dir)
        self._words = words
        self._clock = clock
        self._since_s = 0.0
        self._told_s: float | None = None
        """When it was told last, or when it began; None: nothing keeps it."""

    def restart(self) -> None:
        """Begin to count anew."""
        self._told_s = None

    def look(self) -> bool:
        """Write down what is due; return whether there is anything."""
        words, now_s = self._words(self._clock), self._clock.now_s
        if not words or now_s is None:
            self._told_s = None
        elif self._told_s is None:
            self._since_s = self._told_s = now_s
        elif now_s - self._told_s >= TELL_HELD_S:
            self._told_s = now_s
            note_held(self._out, now_s, f"{words}, for {now_s - self._since_s:.0f} s")
        return bool(words)
