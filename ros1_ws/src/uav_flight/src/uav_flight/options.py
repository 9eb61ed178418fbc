"""The drone's options of ``alula run``: their definitions, and which go together."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from typing import Any

from alula.common.network import free_port
from alula.runtime.live.spec import RequestError
from uav_flight.autopilot import check_body_port, check_connection, read_sensors
from uav_simulator.errors import ConfigError
from uav_simulator.imperfections import parse_imperfections

MAX_RATE = 1000
GROUND_LINK = {"control", "ground_station"}
"""Faults of the ground's link to the simulated autopilot; a real one is not connected to it."""


class Options(Namespace):
    """The command line, as far as it is about the drone."""

    fail: list[str]
    rate: float
    record: str
    autopilot: str | None
    sensors: str | None
    physics_port: int | None
    imperfections: str


def add_options(parser: ArgumentParser) -> None:
    """Add the drone's options to those of any robot's run."""
    parser.add_argument("--rate", type=float, default=1.0, help="simulated seconds per second at most, 0: no limit (default 1)")
    parser.add_argument(
        "--record", choices=["functional", "sensors"], default="functional", help="sensors: functional.bag also holds raw measurements"
    )
    parser.add_argument("--autopilot", metavar="URL", help="fly a real autopilot (pymavlink connection) instead of the simulator")
    parser.add_argument(
        "--sensors",
        metavar="simulated|followed:URL",
        help="with --autopilot: use simulated sensors. simulated: ArduPilot flies the simulator's body (its JSON interface); "
        "followed:URL: they follow the position that the autopilot reports over a second MAVLink connection",
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
        help="imperfections of the simulated autopilot and sensors (default off)",
    )


def read_options(given: Options) -> Mapping[str, Any]:
    """Check the options; return what a run keeps of them, by name as in ``Flight``. Raises RequestError."""
    if not 0 <= given.rate <= MAX_RATE:  # also refuses nan
        raise RequestError(f"--rate {given.rate:g}: must be 0 (no limit) or a positive factor up to {MAX_RATE}")
    _check_autopilot(given)
    try:
        parse_imperfections(given.imperfections)
    except ConfigError as error:
        raise RequestError(f"--imperfections: {error}") from None
    port = given.physics_port
    return {
        "rate": given.rate,
        "record": given.record,
        "autopilot": given.autopilot,
        "sensors": read_sensors(given.sensors or ""),
        "body_port": 0 if port is None else check_body_port(port, f"--physics-port {port}"),
        "mavlink_port": free_port(),
        "imperfections": given.imperfections,
    }


def _check_autopilot(given: Options) -> None:
    """Refuse what does not go together with another autopilot, or without one."""
    if given.sensors is not None and given.autopilot is None:
        raise RequestError("--sensors is for a real autopilot; add --autopilot URL")
    if given.physics_port is not None and given.sensors != "simulated":
        raise RequestError("--physics-port is where ArduPilot looks for the simulated body; add --autopilot URL --sensors simulated")
    if given.autopilot is None:
        return
    check_connection(given.autopilot)
    if given.sensors is not None:
        _check_ground_link(given.fail)
        return
    if given.fail:
        raise RequestError("--fail breaks simulated sensors; with --autopilot there are none, unless --sensors simulated is added")
    if given.imperfections != "off":
        raise RequestError("--imperfections are those of simulated sensors; with --autopilot there are none")


def _check_ground_link(faults: Sequence[str]) -> None:
    """Refuse to break what only the simulated autopilot is connected to."""
    broken = [what for text in faults if (what := text.partition("@")[0].partition(":")[0]) in GROUND_LINK]
    if broken:
        raise RequestError(
            f"--fail {broken[0]}: is of the ground's link to the autopilot, which only the simulated one is connected to; "
            "leave it out, or --autopilot"
        )
