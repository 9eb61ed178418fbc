"""The command line of ``./alula fly``: read, checked, and made into a specification."""

from __future__ import annotations

import argparse
import os
import uuid
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from alula.common.network import free_port
from alula.common.scenarios import Scenario, scenario_names
from alula_flight.autopilot import check_body_port, check_connection, read_sensors
from alula_flight.spec import RequestError, RunSpec, read_faults, read_imperfections, read_scenario, read_world
from uav_simulator.sensors.faults import FAULTS
from uav_simulator.world.config import world_names

FAULT = "WHAT[:HOW][@SECONDS[-SECONDS]]"


class Arguments(argparse.Namespace):
    """The command line of ``fly``."""

    scenario: str
    fail: list[str]
    out: Path | None
    seed: int
    rate: float | None
    world: str | None
    autopilot: str | None
    sensors: str | None
    imperfections: str
    mock: bool
    console: bool
    record: str
    monitor: bool
    physics_port: int | None
    behaviour: list[Path]


def _parser() -> argparse.ArgumentParser:
    """Return the options of ``alula fly``."""
    parser = argparse.ArgumentParser(prog="alula fly", description="Fly a scenario through the whole stack.", add_help=True)
    parser.add_argument("scenario", help=f"what to fly: {', '.join(scenario_names())}")
    parser.add_argument("--fail", action="append", default=[], metavar=FAULT, help="break a sensor, seconds after lift-off")
    parser.add_argument(
        "--world", metavar="FILE|NAME", help=f"where to fly: a file, or {', '.join(world_names())} (default: the scenario's)"
    )
    parser.add_argument("--out", type=Path, help="folder for the results (default: runs/<time>-<scenario>)")
    parser.add_argument("--seed", type=int, default=0, help="seed of world details, wind and noise (default 0)")
    parser.add_argument("--rate", type=float, help="simulated seconds per second at most, 0: no limit (default 1)")
    parser.add_argument("--autopilot", metavar="URL", help="fly a real autopilot (pymavlink connection) instead of the simulator")
    parser.add_argument(
        "--sensors",
        metavar="simulated|followed:URL",
        help="with --autopilot, simulated ones. simulated: ArduPilot flies the simulator's body (its JSON interface); "
        "followed:URL: they are where the autopilot says over a second MAVLink connection",
    )
    parser.add_argument(
        "--physics-port",
        type=int,
        metavar="PORT",
        help="with --sensors simulated: the UDP port where ArduPilot looks for the body (default: 9002 + 10 x its instance)",
    )
    parser.add_argument(
        "--imperfections",
        default="off",
        metavar="off|realistic|NAME=VALUE,...",
        help="of the simulated autopilot and sensors (default off)",
    )
    parser.add_argument("--console", action="store_true", help="serve the operator's page beside the flight")
    parser.add_argument("--mock", action="store_true", help="fly over mocks in virtual time: no simulator, no ROS graph, seconds")
    parser.add_argument(
        "--behaviour", action="append", default=[], type=Path, metavar="FILE", help="what the mocks do, on top of the drone's own"
    )
    parser.add_argument(
        "--record", choices=["functional", "sensors"], default="functional", help="sensors: functional.bag also holds raw measurements"
    )
    parser.add_argument("--monitor", action="store_true", help="hold every event of the skillsets against the models, while it flies")
    return parser


def parse(arguments: list[str]) -> RunSpec:
    """Turn the command line into a specification; raise RequestError, or exit 2 as argparse does."""
    given = _parser().parse_args(arguments, namespace=Arguments())
    scenario = read_scenario(given.scenario)
    if not 0 <= given.seed < 2**31:
        raise RequestError(f"--seed {given.seed}: must lie between 0 and {2**31 - 1}")
    if given.rate is not None and not 0 <= given.rate <= 1000:  # also refuses nan
        raise RequestError(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor up to 1000")
    check_autopilot(given, scenario)
    check_mock(given)
    return RunSpec(
        scenario=given.scenario,
        out_dir=str(run_folder(given.out, given.scenario)),
        run_id=uuid.uuid4().hex,
        seed=given.seed,
        rate=1.0 if given.rate is None else given.rate,
        faults=read_faults(given.fail, {**FAULTS, **dict(scenario.faults)}, others=given.mock),
        world=read_world(given.world or scenario.world),
        autopilot=given.autopilot,
        sensors=read_sensors(given.sensors or ""),
        body_port=0 if given.physics_port is None else check_body_port(given.physics_port, f"--physics-port {given.physics_port}"),
        master_port=0 if given.mock else free_port(),
        mavlink_port=0 if given.mock else free_port(),
        domain=0,
        mock=given.mock,
        console=given.console,
        record=given.record,
        monitor=given.monitor,
        behaviour=tuple(str(path.expanduser().absolute()) for path in given.behaviour),
        launch={"imperfections": read_imperfections(given.imperfections)},
    )


def check_autopilot(given: Arguments, scenario: Scenario) -> None:
    """Refuse what does not go together with another autopilot, or without one."""
    if given.sensors is not None and given.autopilot is None:
        raise RequestError("--sensors says what a real autopilot has for sensors; add --autopilot URL")
    if given.physics_port is not None and given.sensors != "simulated":
        raise RequestError("--physics-port is where ArduPilot looks for the simulated body; add --autopilot URL --sensors simulated")
    if given.autopilot is None:
        return
    check_connection(given.autopilot)
    if given.sensors is not None:
        check_ground_link(given.fail, scenario)
        return
    if given.fail:
        raise RequestError("--fail breaks simulated sensors; with --autopilot there are none, unless --sensors simulated is added")
    if given.imperfections != "off":
        raise RequestError("--imperfections are those of simulated sensors; with --autopilot there are none")


def check_ground_link(faults: Sequence[str], scenario: Scenario) -> None:
    """Refuse to break what only the simulated autopilot is connected to."""
    broken = [what for what in scenario.ground_link if any(text.partition("@")[0].partition(":")[0] == what for text in faults)]
    if broken:
        raise RequestError(
            f"--fail {broken[0]}: is of the ground's link to the autopilot, which only the simulated one is connected to; "
            "leave it out, or --autopilot"
        )


def check_mock(given: Arguments) -> None:
    """Refuse what does not go together with mocks, or without them."""
    if given.behaviour and not given.mock:
        raise RequestError("--behaviour says what mocks do; add --mock")
    if given.mock and given.autopilot is not None:
        raise RequestError("--mock flies without a vehicle; leave out --autopilot")
    if given.mock and given.record == "sensors":
        raise RequestError("--record sensors: mocks measure nothing; leave it out with --mock")
    if given.mock and given.console:
        raise RequestError("--console: a flight over mocks is over in a moment; look at its report.html")
    if given.mock and given.rate is not None:
        raise RequestError("--mock flies in virtual time, which no --rate limits; leave it out")


def run_folder(wanted: Path | None, scenario: str) -> Path:
    """Return an absolute path that holds no run yet; raise RequestError if the wanted one does."""
    if wanted is not None:
        folder = wanted.expanduser().absolute()
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise RequestError(f"--out {wanted}: exists and is not an empty folder; choose another, a run never overwrites")
        return folder
    base = Path(os.environ["ALULA_ROOT"]) / "runs" / f"{datetime.now(tz=UTC).astimezone():%Y%m%d-%H%M%S}-{scenario}"
    candidates = (base, *(base.with_name(f"{base.name}-{n}") for n in range(2, 1000)))
    return next(folder for folder in candidates if not folder.exists())
