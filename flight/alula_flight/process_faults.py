"""Processes that are made to die or to hang, as ``--fail encoder@40`` asks: by the supervisor, whose roslaunch started them."""

from __future__ import annotations

import math
import signal
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

from alula.common.faults import MENDED, FaultChange, FaultRequest, parse_fault
from alula.common.run_log import FAULT, note
from alula.common.scenarios import load_scenario
from alula.runtime.live.spec import RunSpec

KILLED, HUNG = "killed", "hung"
WAYS = (KILLED, HUNG)


class Started(Protocol):
    """A process that roslaunch started; ``respawn_delay`` in seconds of wall clock, read whenever it may be started again."""

    popen: Any
    respawn_delay: float

    def is_alive(self) -> bool:
        """Return whether it runs."""


@dataclass(frozen=True)
class ProcessFault:
    """A fault of the command line, and the node whose process it is about."""

    request: FaultRequest
    node: str

    @property
    def mode(self) -> str:
        """Return in which way it fails."""
        return self.request.how or WAYS[0]


def process_faults_of(spec: RunSpec) -> list[ProcessFault]:
    """Return those of a run's faults that its scenario says to be a process's."""
    nodes = dict(load_scenario(spec.scenario).processes)
    requests = map(parse_fault, spec.faults)
    return [ProcessFault(request, nodes[request.what]) for request in requests if request.what in nodes]


class ProcessFaults:
    """Applies faults and ends them; ``find`` returns the process of a node, None where there is none.

    A process that was killed is not started again before its fault ends.
    """

    def __init__(self, faults: Sequence[ProcessFault], find: Callable[[str], Started | None], out: Path) -> None:
        self._faults = tuple(faults)
        self._find = find
        self._out = out
        self._active: dict[ProcessFault, float] = {}
        self._departed_s: float | None = None

    @property
    def asked(self) -> bool:
        """Return whether there are any."""
        return bool(self._faults)

    @property
    def counts(self) -> bool:
        """Return whether it is known when the robot departed."""
        return self._departed_s is not None

    def departed(self, at_s: float) -> None:
        """Take note of the moment from which the faults' times count."""
        self._departed_s = at_s

    def look(self, now_s: float) -> None:
        """Begin and end what is due."""
        since_s = None if self._departed_s is None else now_s - self._departed_s
        for fault in self._faults:
            if fault.request.lasts(since_s):
                self._break(fault, now_s)
            elif fault in self._active:
                self._mend(fault, now_s)

    def release(self) -> None:
        """Let hung processes go on, so that they can be told to end."""
        for fault in [fault for fault in self._active if fault.mode == HUNG]:
            self._send(fault, signal.SIGCONT)

    def _break(self, fault: ProcessFault, now_s: float) -> None:
        process = self._find(fault.node)
        if process is None:
            return
        begins = fault not in self._active
        if begins:
            self._active[fault] = process.respawn_delay
            self._note(FaultChange(fault.request.what, fault.mode, now_s))
        if fault.mode == KILLED:
            process.respawn_delay = math.inf  # before it dies: then it is not started again
            self._send(fault, signal.SIGKILL)
        elif begins:
            self._send(fault, signal.SIGSTOP)

    def _mend(self, fault: ProcessFault, now_s: float) -> None:
        respawn_delay_s = self._active.pop(fault)
        self._note(FaultChange(fault.request.what, MENDED, now_s))
        if fault.mode == HUNG:
            self._send(fault, signal.SIGCONT)
        elif (process := self._find(fault.node)) is not None:
            process.respawn_delay = respawn_delay_s

    def _send(self, fault: ProcessFault, number: int) -> None:
        process = self._find(fault.node)
        if process is not None and process.popen is not None and process.is_alive():
            process.popen.send_signal(number)

    def _note(self, change: FaultChange) -> None:
        note(self._out, FAULT, asdict(change))
