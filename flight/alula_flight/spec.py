"""What a run is asked to be, checked before anything starts, and handed from the front to the supervisor as one file."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path

from alula_common.files import write_json

SCENARIOS = {"mapping": "map the yard; watch ahead with the ZED, or with the LiDAR when the ZED has failed (paper, section 2.2)"}
SENSORS = ("zed", "lidar", "imu")
_FAULT = re.compile(r"^(?P<sensor>[a-z0-9_]+)(@(?P<seconds>\d+(\.\d+)?))?$")


class RequestError(Exception):
    """The command line asks for something that can't be; the message names it and the remedy in one line."""


@dataclass(frozen=True)
class Fault:
    """A sensor that breaks ``after_lift_off_s`` seconds of mission clock after lift-off (None: from the beginning)."""

    sensor: str
    after_lift_off_s: float | None

    def __str__(self) -> str:
        return self.sensor if self.after_lift_off_s is None else f"{self.sensor}@{self.after_lift_off_s:g}"


def parse_fault(text: str, known: Collection[str] | None = SENSORS) -> Fault:
    """Read ``zed@30`` or ``zed``; raise RequestError for anything else. ``known`` None: somebody else knows what there is to break."""
    match = _FAULT.match(text)
    if match is None:
        raise RequestError(f"--fail {text}: write WHAT@SECONDS, as in zed@30, or WHAT alone for a failure from the start")
    sensor, seconds = match["sensor"], match["seconds"]
    if known is not None and sensor not in known:
        raise RequestError(f"--fail {text}: there is no '{sensor}' to break; choose one of {', '.join(known)}")
    return Fault(sensor, None if seconds is None else float(seconds))


@dataclass(frozen=True)
class RunSpec:
    """One run. ``autopilot`` is None for the simulated vehicle; ``rate`` is simulated seconds per second at most, 0 unlimited.

    ``mock``: over mocks in one process; then ``behaviour`` are files on top of the drone's own, and ports and domain are 0.
    """

    scenario: str
    out_dir: str
    run_id: str
    seed: int
    rate: float
    faults: tuple[str, ...]
    autopilot: str | None
    master_port: int
    mavlink_port: int
    domain: int
    mock: bool = False
    behaviour: tuple[str, ...] = ()

    def save(self, path: Path) -> None:
        """Write the specification beside the results."""
        write_json(path, asdict(self))

    @classmethod
    def load(cls, path: Path) -> RunSpec:
        """Read what `save` wrote."""
        values = json.loads(path.read_text(encoding="utf-8"))
        return cls(**{**values, "faults": tuple(values["faults"]), "behaviour": tuple(values.get("behaviour", ()))})

    def launch_arguments(self) -> list[str]:
        """Return the arguments of ``fly.launch``."""
        arguments = [
            f"scenario:={self.scenario}",
            f"out:={self.out_dir}",
            f"seed:={self.seed}",
            f"rate:={self.rate:g}",
            f"faults:={','.join(self.faults)}",
            f"mavlink_port:={self.mavlink_port}",
        ]
        if self.autopilot is not None:
            arguments += ["simulate:=false", f"autopilot:={self.autopilot}"]
        return arguments
