"""``./alula fly --mock``: the mission over mocks, in virtual time, as a process of the ROS 2 world that needs no ROS."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path

from alula_flight.live import LiveEvents
from alula_flight.spec import RunSpec

CANNOT_START = 2
KILL_AT = 2  # interrupts, as in a flight: the first lands the vehicle, the second ends everything


def shipped_behaviour(root: Path) -> Path:
    """Return the drone's own behaviour file."""
    return root / "skillsets" / "uav" / "mock.yaml"


def command(spec: RunSpec, root: Path) -> list[str]:
    """Return the command line of the flight."""
    route = root / "ros1_ws" / "src" / "uav_simulator" / "config" / "yard.yaml"
    words = [str(root / "setup" / "in_ros2"), "python", "-m", "uav_missions.mock_flight", "--scenario", spec.scenario]
    words += ["--out", spec.out_dir, "--route", str(route), "--seed", str(spec.seed)]
    for file in (str(shipped_behaviour(root)), *spec.behaviour):
        words += ["--behaviour", file]
    for fault in spec.faults:
        words += ["--fail", fault]
    return words


class MockFront:
    """Watches the flight; the first Ctrl-C lands the vehicle, the second ends everything at once."""

    def __init__(self, spec: RunSpec, say: Callable[[str], None]) -> None:
        self._spec = spec
        self._say = say
        self._interrupts = 0
        self._flight: subprocess.Popen[str] | None = None

    def fly(self) -> tuple[int, str]:
        """Fly; return the exit code and what the flight had to say."""
        live = LiveEvents(Path(self._spec.out_dir), self._say)
        with subprocess.Popen(
            command(self._spec, Path(os.environ["ALULA_ROOT"])),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        ) as flight:
            self._flight = flight
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, lambda *_: self._interrupted())
            words = ""
            while flight.poll() is None:
                live.show_new()
                with contextlib.suppress(subprocess.TimeoutExpired):
                    words, _ = flight.communicate(timeout=0.1)
        live.show_new()
        return flight.returncode if flight.returncode in {0, 1, CANNOT_START} else 1, words

    def _interrupted(self) -> None:
        self._interrupts += 1
        if self._flight is None or self._flight.poll() is not None:
            return
        if self._interrupts < KILL_AT:
            self._say("stopping: the vehicle lands first; Ctrl-C again ends everything at once")
            self._flight.send_signal(signal.SIGINT)
        else:
            self._flight.kill()
