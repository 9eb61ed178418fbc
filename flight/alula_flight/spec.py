"""What a run is asked to be, checked before anything starts, and handed from the front to the supervisor as one file."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from alula.common.faults import FaultError, parse_fault
from alula.common.files import write_json
from alula.common.scenarios import Scenario, ScenarioError, load_scenario
from alula_flight.process_faults import ProcessFault
from uav_simulator.errors import ConfigError
from uav_simulator.imperfections import parse_imperfections
from uav_simulator.settings import FOLLOWED
from uav_simulator.world.config import find_world, load_world


class RequestError(Exception):
    """The command line asks for something that can't be; the message names it and the remedy in one line."""


def read_scenario(name: str) -> Scenario:
    """Read a scenario by its name."""
    try:
        return load_scenario(name)
    except ScenarioError as error:
        raise RequestError(str(error)) from None


def read_faults(texts: Sequence[str], known: Mapping[str, Sequence[str]], *, others: bool = False) -> tuple[str, ...]:
    """Check what `--fail` asks for, and return it in the form that all parts read. ``others``: mocks may have things to break besides."""
    try:
        return tuple(str(parse_fault(text, None if others and parse_fault(text).what not in known else known)) for text in texts)
    except FaultError as error:
        raise RequestError(f"--fail: {error}") from None


def read_imperfections(text: str) -> str:
    """Check what is imperfect, and return it."""
    try:
        parse_imperfections(text)
    except ConfigError as error:
        raise RequestError(f"--imperfections: {error}") from None
    return text


def read_world(text: str) -> str:
    """Check a world, given by name or file, and return its file."""
    try:
        path = find_world(text)
        load_world(path)
    except ConfigError as error:
        raise RequestError(f"--world: {error}") from None
    return str(path)


@dataclass(frozen=True)
class RunSpec:
    """One run.

    ``world`` is a world file; ``autopilot`` is None for the simulated vehicle; ``rate`` is simulated seconds per second at
    most, 0 unlimited. ``sensors``: with an autopilot, "simulated" where the simulator has the body that it flies and the sensors,
    "followed:URL" where it has the sensors only, which are where the autopilot says over this connection, "" where real drivers run.
    ``body_port``: UDP port where ArduPilot's simulator looks for the body, with sensors "simulated"; ``radio_port``: the first of the
    radio's ten. Both 0 until the run's domain is known.
    ``record``: what ``functional.bag`` holds: "functional", or "sensors" for the raw measurements, too.
    ``console``: whether the operator's page is served beside the flight.
    ``monitor``: every event is held against the models.
    ``mock``: over mocks in one process; then ``behaviour`` are files on top of the drone's own, and ports and domain are 0.
    ``launch``: arguments of the launch files that nothing here reads; in the file they stand beside the others.
    """

    scenario: str
    out_dir: str
    run_id: str
    seed: int
    rate: float
    faults: tuple[str, ...]
    world: str
    autopilot: str | None
    master_port: int
    mavlink_port: int
    domain: int
    sensors: str = ""
    body_port: int = 0
    radio_port: int = 0
    mock: bool = False
    record: str = "functional"
    monitor: bool = False
    behaviour: tuple[str, ...] = ()
    console: bool = False
    launch: Mapping[str, str] = field(default_factory=dict)

    @property
    def simulated(self) -> bool:
        """Tell whether the simulator takes part, with its clock, its truth and its sensors."""
        return self.autopilot is None or bool(self.sensors)

    def save(self, path: Path) -> None:
        """Write the specification beside the results."""
        values = asdict(self)
        launch = values.pop("launch")
        write_json(path, {**values, **launch})

    @classmethod
    def load(cls, path: Path) -> RunSpec:
        """Read what `save` wrote."""
        values = json.loads(path.read_text(encoding="utf-8"))
        launch = {name: values.pop(name) for name in set(values) - {one.name for one in fields(cls)}}
        return cls(**{**values, "faults": tuple(values["faults"]), "behaviour": tuple(values["behaviour"]), "launch": launch})

    @property
    def process_faults(self) -> list[ProcessFault]:
        """Return the faults of processes."""
        nodes = dict(load_scenario(self.scenario).processes)
        requests = map(parse_fault, self.faults)
        return [ProcessFault(request, nodes[request.what]) for request in requests if request.what in nodes]

    def launch_arguments(self) -> list[str]:
        """Return the arguments of the scenario's launch file."""
        scenario = load_scenario(self.scenario)
        others = [fault for fault in self.faults if parse_fault(fault).what in dict(scenario.faults)]
        radio = [fault for fault in others if parse_fault(fault).what not in dict(scenario.processes)]
        arguments = [
            f"out:={self.out_dir}",
            f"seed:={self.seed}",
            # The autopilot that is followed has its own pace: a limit here would fall behind it.
            f"rate:={0.0 if self.sensors.startswith(FOLLOWED) else self.rate:g}",
            f"faults:={','.join(fault for fault in self.faults if fault not in others)}",
            f"world:={self.world}",
            f"mavlink_port:={self.mavlink_port}",
            f"record:={self.record}",
            f"radio_port:={self.radio_port}",
            f"radio_faults:={','.join(radio)}",
            f"ardupilot_port:={self.body_port}",
            *(f"{name}:={value}" for name, value in self.launch.items()),
        ]
        if self.autopilot is not None:
            vehicle = {"": "simulate:=false", "simulated": "vehicle:=ardupilot"}.get(self.sensors, f"vehicle:={self.sensors}")
            arguments += [vehicle, f"autopilot:={self.autopilot}"]
        return arguments
