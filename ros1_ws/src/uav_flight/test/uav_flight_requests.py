"""Requests of the drone's runs, read as the front reads them."""

from __future__ import annotations

from collections.abc import Sequence

from alula.common.network import DomainClaim
from alula.runtime.live.spec import RunSpec
from alula_flight import command_line, launch
from uav_flight.part import DronePart, Flight


def parse(words: Sequence[str]) -> RunSpec:
    """Read a command line."""
    return command_line.parse(words, DronePart())


def with_domain(request: RunSpec, domain: int) -> RunSpec:
    """Return a run with its ports."""
    return command_line.with_claim(request, DomainClaim(domain, domain, ()), DronePart())


def flight_of(request: RunSpec, domain: int) -> Flight:
    """Return the drone's part of a run with its ports."""
    return Flight.of(with_domain(request, domain))


def launch_arguments(spec: RunSpec) -> list[str]:
    """Return what roslaunch gets."""
    return launch.launch_arguments(spec, DronePart())
