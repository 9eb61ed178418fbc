"""``./alula fly --mock``: the mission over mocks, in virtual time, as a process of the ROS 2 world that needs no ROS."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from alula.common.signals import Interrupts
from alula.records.conformance import Monitor
from alula.report.ends import ended_by_signal, note_end
from alula.report.live import LiveEvents
from alula_flight.ending import CANNOT_START, GIVEN_UP
from alula_flight.spec import RunSpec

STOPPING = "stopping: the vehicle lands first; Ctrl-C again ends everything at once"


def command(spec: RunSpec, root: Path) -> list[str]:
    """Return the command line of the flight."""
    words = [str(root / "setup" / "in_ros2"), "python", "-m", "alula.campaign.mock_run", spec.scenario]
    words += ["--out", spec.out_dir, "--world", spec.world, "--seed", str(spec.seed)]
    for file in spec.behaviour:
        words += ["--behaviour", file]
    for fault in spec.faults:
        words += ["--fail", fault]
    return words


class MockFront:
    """Watches the flight; the first Ctrl-C lands the vehicle, the second ends everything at once."""

    def __init__(self, spec: RunSpec, say: Callable[[str], None], monitor: Monitor | None = None) -> None:
        self._spec = spec
        self._say = say
        self._monitor = monitor
        self._interrupts = Interrupts(self._land, self._kill)
        self._flight: subprocess.Popen[str] | None = None

    def fly(self) -> tuple[int, str]:
        """Fly; return the exit code and what the flight had to say."""
        live = LiveEvents(Path(self._spec.out_dir), self._say, self._monitor)
        with subprocess.Popen(
            command(self._spec, Path(os.environ["ALULA_ROOT"])),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as flight:
            self._flight = flight
            self._interrupts.install()
            words: str | None = None  # a flight that ends between two looks still has its words to be read
            while words is None:
                live.show_new()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    words, _ = flight.communicate(timeout=0.1)
        live.show_new()
        return flight.returncode if flight.returncode in {0, GIVEN_UP, CANNOT_START} else GIVEN_UP, words

    def _land(self) -> None:
        if self._flight is not None and self._flight.poll() is None:
            self._say(STOPPING)
            note_end(Path(self._spec.out_dir), ended_by_signal(self._interrupts.first))
            self._flight.send_signal(signal.SIGINT)

    def _kill(self) -> None:
        if self._flight is not None and self._flight.poll() is None:
            self._flight.kill()
