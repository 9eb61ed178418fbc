"""A robot's part of a replay from its sensors: its part ``sensors`` in ``robot.yaml``, imported in ROS 1."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from node_core.core import Core, Host, Output


@dataclass(frozen=True)
class Arrival:
    """A measurement that arrives while something fails.

    Attributes:
        topic: where.
        message: what was recorded; may be changed.
        at_ns: when it came then, mission clock.
        last: the last one on this topic from before the failure; None: there was none.
        rng: draws noise.
    """

    topic: str
    message: Any
    at_ns: int
    last: Any | None
    rng: np.random.Generator


Change = Callable[[Arrival], Iterable[tuple[Any, int]]]
"""Returns what arrives instead, each message with when, nanoseconds of mission clock, not before ``at_ns``."""


def dead(_arrival: Arrival) -> Iterable[tuple[Any, int]]:
    """Return no arrival: the sensor is silent."""
    return ()


def frozen(arrival: Arrival) -> Iterable[tuple[Any, int]]:
    """Return the last good measurement again, with the stamp of this one; nothing where there was none."""
    if arrival.last is not None:
        arrival.last.header.stamp = arrival.message.header.stamp
        yield arrival.last, arrival.at_ns


class Replayed(Protocol):
    """The replay, as the part sees it while it makes the cores."""

    folder: Path
    """For files that nobody keeps."""
    world: Path | None
    """The file of the world that the run was in; None: a bag without a run."""

    def host(self, name: str, outputs: Sequence[Output]) -> Host:
        """Return the host of the core of a node."""

    def settings(self, name: str) -> dict[str, object]:
        """Return the parameters of a node that were given with ``--set``."""

    def hear(self, topic: str, take: Callable[[Any], bool]) -> None:
        """Call ``take`` with the recorded messages of a topic; those for which it returns false are not in the new bag."""

    def publish(self, topic: str, message: Any) -> None:
        """Write a message into the new bag."""


@dataclass(frozen=True)
class SensorPart:
    """What can be perceived again.

    Attributes:
        measured: topics of measurements, each with the name of the sensor that fails with it.
        reports: the resources that the cores report, ``skillset.resource``, each with the topics that it is judged by.
        nodes: the nodes whose cores these are; ``--set NODE.NAME=VALUE`` is about one of them.
        make: makes the cores, by their nodes; raises ReplayPartError.
        ways: what can fail of the measurements, and in which ways; the first one counts where none is named.
        left_out: measured topics that are too large to be of use in the new bag.
    """

    measured: Mapping[str, str]
    reports: Mapping[str, Sequence[str]]
    nodes: Sequence[str]
    make: Callable[[Replayed], Mapping[str, Core]]
    ways: Mapping[str, Mapping[str, Change]] = field(default_factory=dict)
    left_out: frozenset[str] = frozenset()


class ReplayPartError(Exception):
    """A bag can't be perceived again; the message says why, in one line."""
