"""What a run waits for before it can begin: found by the supervisor, said by the front and by the verdict.

``waits.jsonl`` in the run's folder has a line for each thing when it is waited for, and one with ``over`` when it is there.
"""

from __future__ import annotations

import contextlib
import json
import time
from pathlib import Path
from typing import Any

from alula.report.waits import FILE
from alula_flight.autopilot import LISTENS, read_connection
from alula_flight.spec import RunSpec
from uav_simulator.settings import FOLLOWED

TELL_S, LOOK_S = 5.0, 1.0  # wall clock until it is told, and how often it is looked


def clock_words(spec: RunSpec) -> str:
    """Return where the mission clock comes from."""
    if spec.autopilot is None:
        return "the simulator"
    if spec.sensors.startswith(FOLLOWED):
        return f"the autopilot that is followed, at {spec.sensors.removeprefix(FOLLOWED)}"
    return f"ArduPilot on UDP {spec.body_port}"


def waits_of(spec: RunSpec, *, clock: bool, link: bool) -> list[str]:
    """Return what the run waits for, in words. ``clock``: the mission clock has begun; ``link``: heartbeats of the autopilot arrive."""
    connection = None if spec.autopilot is None else read_connection(spec.autopilot)
    words = []
    if spec.simulated and not clock:
        words.append(f"{clock_words(spec)}, whose first step begins the mission clock")
    if connection is None or link:
        return words
    if connection.refused:
        words.append(f"the autopilot at {connection.text}: connection refused, nothing listens there")
    elif clock or not spec.simulated:
        words.append(f"the autopilot at {connection.text}: no heartbeat has come{' there' if connection.kind in LISTENS else ''}")
    return words


class Beginning:
    """Follows a run until it has begun, and writes down what it waits for, each thing once."""

    def __init__(self, spec: RunSpec) -> None:
        self._spec = spec
        self._path = Path(spec.out_dir) / FILE
        self._open: list[str] = []
        # The simulator takes a while in each flight; an autopilot that is not there is told at once.
        self._due = time.monotonic() + (TELL_S if spec.autopilot is None else 0.0)
        self._begun = self._linked = False
        self._link: Any = None

    def listen(self) -> None:
        """Hear from the guidance whether the autopilot's heartbeats arrive; rospy's node must be there."""
        import rospy
        from uav_msgs.msg import GuidanceState

        def look(state: Any) -> None:
            self._linked = self._linked or state.link

        if self._spec.autopilot is not None:
            self._link = rospy.Subscriber("/uav_guidance/state", GuidanceState, look, queue_size=1)

    def look(self, *, clock: bool) -> None:
        """Write down what is newly waited for, and what is no more. ``clock``: the mission clock has begun."""
        if self._begun or time.monotonic() < self._due:
            return
        self._due = time.monotonic() + LOOK_S
        words = waits_of(self._spec, clock=clock, link=self._linked)
        self._begun = not words
        if self._begun and self._link is not None:
            self._link.unregister()
        changed = [(one, False) for one in words if one not in self._open] + [(one, True) for one in self._open if one not in words]
        self._open = words
        for one, over in changed:
            with contextlib.suppress(OSError), self._path.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"for": one, "over": over}) + "\n")
