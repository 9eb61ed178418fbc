"""What a live run is asked to be, checked before anything starts, and handed from process to process as one file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from alula.common.errors import AlulaError
from alula.common.files import write_json
from alula.common.public import public

FILE = "run.json"


@public("alula.parts")
class RequestError(AlulaError):
    """The command line asks for something that can't be; the message names it and the remedy in one line."""


@public("alula.parts")
@dataclass(frozen=True)
class RunSpec:
    """What a live run is asked to be.

    Attributes:
        scenario: its name.
        out_dir: its folder, absolute.
        run_id: what all of its processes carry in their environment.
        seed: of whatever is drawn at random in it.
        faults: what is to fail, as on the command line.
        world: file of the world; empty: the scenario has none.
        master_port: TCP port of its ROS 1 master, on loopback.
        domain: DDS domain; 0 until it is claimed, or named on the command line.
        seat: a number that no other run under way has, for ports that follow from it; 0 until it is claimed.
        namespace: what its names in ROS 2 begin with, as ``/rover``; empty: nothing.
        console: the operator's page is served beside it.
        monitor: every event is checked against the models.
        limit_s: mission clock after which the run is ended; 0: no limit.
        commanded: simulated time waits for the heartbeats of who calls the robot's skills from outside, as a fleet does.
        members: of a fleet, the words of ``alula run`` for the run of each robot, by its name; empty: its robots are served elsewhere.
        groot: ``HOST:PORT`` where viewers find the mission's tree; empty: nowhere.
        deployment: whose graph it runs in, beside what runs there already; empty: it has a graph of its own, and starts all of it.
        robot: the robot's folder, absolute; empty: not known.
        own: what the robot's part has made of its own options, by name; in the file these values stand beside the others.
    """

    scenario: str
    out_dir: str
    run_id: str
    seed: int = 0
    faults: tuple[str, ...] = ()
    world: str = ""
    master_port: int = 0
    domain: int = 0
    seat: int = 0
    namespace: str = ""
    console: bool = False
    monitor: bool = False
    limit_s: float = 0.0
    commanded: bool = False
    members: Mapping[str, Sequence[str]] = field(default_factory=dict)
    groot: str = ""
    deployment: str = ""
    robot: str = ""
    own: Mapping[str, Any] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        """Write the specification beside the results."""
        values = asdict(self)
        write_json(path, {**values.pop("own"), **values})

    @classmethod
    def load(cls, path: Path) -> RunSpec:
        """Read what `save` wrote."""
        values = json.loads(path.read_text(encoding="utf-8"))
        own = {name: values.pop(name) for name in set(values) - {one.name for one in fields(cls)}}
        return cls(**{**values, "faults": tuple(values["faults"]), "own": own})
