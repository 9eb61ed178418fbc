"""What a robot adds to the report of its runs: its part ``report`` in ``robot.yaml``, a class that is made once a report."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from alula.common.faults import FaultChange
from alula.common.public import public
from alula.common.robots import find_robot
from alula.common.scenarios import Scenario
from alula.records.causes.effects import EffectsByFault
from alula.records.causes.faults import Fault
from alula.report.facts import RunFacts
from alula.report.files import Problems
from alula.report.history import History
from alula.report.observed import Observed, read_faults
from alula.report.phases import Phases
from alula.report.recovery import Recovery
from alula.report.timeline import Timeline

Entry = tuple[str, float | None, object]
"""An entry of the page: topic, seconds of mission clock, value."""


@public("alula.parts")
@dataclass(frozen=True)
class ReportedRun:
    """The run that a report is about."""

    facts: RunFacts
    scenario: Scenario
    history: History
    problems: Problems

    @property
    def folder(self) -> Path:
        """Where it left its files."""
        return self.facts.out_dir

    @property
    def world(self) -> Path:
        """The file of the world that its scenario names."""
        return find_robot().world(self.scenario.world)

    @property
    def title(self) -> str:
        """Return the title of its pictures."""
        facts = self.facts
        failing = f", failing {', '.join(facts.faults)}" if facts.faults else ""
        if facts.replay_of:
            return f"{facts.scenario}{failing}, replay of {facts.replay_of}"
        return f"{facts.scenario}, seed {facts.seed}{failing}{', over mocks' if facts.mock else ''}"


@public("alula.parts")
@dataclass(frozen=True)
class Task:
    """A task of the mission, such as a parcel to deliver; ``why`` says what prevented one that is not done."""

    name: str
    done: bool
    why: str = ""


@public("alula.parts")
@dataclass(frozen=True)
class Findings:
    """The results of a robot's part of the report. ``landed``: whether it came back, by its own recordings; None: not known."""

    values: Mapping[str, Any] = field(default_factory=dict)
    """What goes into ``summary.json`` besides what every run has."""
    landed: bool | None = None
    tasks: Sequence[Task] = ()


@public("alula.parts")
class ReportPart(Protocol):
    """A robot's part of a report; its methods are called once each, in this order. Errors become problems of the report."""

    def observe(self, run: ReportedRun) -> Observed:
        """Read the robot's own recordings; not called of a run over mocks."""
        ...

    def failures(self, phases: Phases, known: Sequence[Fault], effects: EffectsByFault) -> Iterable[tuple[FaultChange, Fault]]:
        """Return further failures that the recordings show."""
        ...

    def measure(self, phases: Phases, recovery: Recovery | None, timeline: Timeline | None) -> Findings:
        """Measure what is left, and draw the robot's pictures into the run's folder."""
        ...

    def entries(self) -> Iterable[Entry]:
        """Return what the page gets besides what lies in the run's folder, of the topics `alula.report.page.entries.OF_RECORDINGS`."""
        ...


@public("alula.parts")
class NoPart:
    """The report of a robot that adds nothing."""

    def observe(self, run: ReportedRun) -> Observed:
        """Return the faults that the supervisor injected."""
        return Observed(processes=read_faults(run.folder))

    def failures(self, phases: Phases, known: Sequence[Fault], effects: EffectsByFault) -> Iterable[tuple[FaultChange, Fault]]:  # noqa: ARG002
        """Return no further faults."""
        return ()

    def measure(self, phases: Phases, recovery: Recovery | None, timeline: Timeline | None) -> Findings:  # noqa: ARG002
        """Return no figures."""
        return Findings()

    def entries(self) -> Iterable[Entry]:
        """Return no further entries for the page."""
        return ()


def part_of_robot(run: ReportedRun) -> ReportPart:
    """Make the robot's part; what its file names has to be importable, else that is a problem of the report."""
    part: ReportPart = NoPart()
    with run.problems.survive("the robot's part of the report"):
        make = find_robot().part("report")
        if make is not None:
            part = make(run)
    return part
