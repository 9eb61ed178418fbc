"""What is compared of each run, and the first decision that is not alike."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from pathlib import Path
from typing import Any

from alula.common.robot_page import USUAL_PAGE
from alula.common.robots import RobotFolder
from alula.common.runs import robot_of
from alula.model.execution_state import ExecutionState as S
from alula.records.errors import AnalysisError
from alula.records.run import RecordedRun, load_recorded_run
from alula.runtime.core.events import EngineEvent, ExecutionEvent

TOGETHER_S = 0.05
"""Seconds within which decisions about several skillsets have no order: each skillset publishes by itself."""
FIGURES: Mapping[str, tuple[tuple[str, ...], str]] = {
    "duration": (("duration_s",), "s"),
    "detected after": (("recovery", "detected_s"), "s"),
    "fallback after": (("recovery", "fallback_running_s"), "s"),
    "moving after": (("recovery", "moving_again_s"), "s"),
    "clearance": (("min_clearance_m",), "m"),
    "collisions": (("collisions",), ""),
    "distance": (("distance_m",), "m"),
}
"""What ``summary.json`` has of each figure, and its unit, of every robot. Recovery times count from the failure."""


def known_figures(robot: RobotFolder | None) -> Mapping[str, tuple[tuple[str, ...], str]]:
    """Return FIGURES and those of the robot's ``page``, without the factors by which reports scale them."""
    of_robot = (USUAL_PAGE if robot is None else robot.page)["figures"]
    own = {path.replace(".", " "): (tuple(path.split(".")), told["unit"] if told["factor"] == 1 else "") for path, told in of_robot.items()}
    return {**FIGURES, **own}


@dataclass(frozen=True)
class ComparedDecision:
    """The mission starts or interrupts a skill, ``at_s`` seconds after the departure."""

    what: str
    at_s: float


@dataclass(frozen=True)
class Side:
    """One run: its decisions in order, the times in which skills ran, and its figures, None where they are not known, with their units."""

    name: str
    outcome: str
    decisions: Sequence[ComparedDecision]
    spans: Sequence[tuple[str, float, float]]
    figures: Mapping[str, float | None]
    units: Mapping[str, str]


@dataclass(frozen=True)
class Difference:
    """Where a run decides otherwise than the first one.

    Attributes:
        at: the number of the decision, in the run that has it: the first one, where both do.
        first: that of the first run; None: it has none more.
        other: that of the other one; None: it has none more.
    """

    at: int
    first: ComparedDecision | None
    other: ComparedDecision | None


@dataclass(frozen=True)
class Compared:
    """The runs, and for each but the first where it decides otherwise than the first, None: nowhere; ``within_s``: as `compare`."""

    sides: Sequence[Side]
    differences: Sequence[Difference | None]
    within_s: float | None = None

    @property
    def alike(self) -> bool:
        """Return whether all have decided the same."""
        return not any(self.differences)

    @property
    def units(self) -> Mapping[str, str]:
        """The figures of any of them, in order, with their units."""
        return {name: unit for side in reversed(self.sides) for name, unit in side.units.items()} | dict(self.sides[0].units)

    def values(self, figure: str) -> list[float]:
        """Return the values of a figure, of the runs that have it."""
        return [value for side in self.sides if (value := side.figures.get(figure)) is not None]


def load_side(path: Path, name: str) -> Side:
    """Read a run; raises AnalysisError."""
    run = load_recorded_run(path)
    summary = _summary(path)
    known = known_figures(robot_of(path))
    figures = {figure: _figure(summary, where) for figure, (where, _) in known.items()}
    if figures["duration"] is None:
        figures["duration"] = run.events[-1].stamp_s - run.events[0].stamp_s
    return Side(name, run.outcome, decisions_of(run), list(_spans(run)), figures, {name: unit for name, (_, unit) in known.items()})


def compare(sides: Sequence[Side], within_s: float | None = None) -> Compared:
    """Hold the decisions of each run against those of the first.

    They have to come in the same order, whenever they do. With ``within_s`` they have to come when those of the first do, sooner or later
    by so many seconds at most: each time a skill is started or interrupted against the same time in the first run. Decisions about
    several skills may then change places as far as these times let them, which they do in runs of different trees.
    """
    first = sides[0].decisions
    differ = _in_order if within_s is None else partial(_at_about_the_same_time, within_s=within_s)
    return Compared(sides, [differ(first, side.decisions) for side in sides[1:]], within_s)


def _in_order(ours: Sequence[ComparedDecision], theirs: Sequence[ComparedDecision]) -> Difference | None:
    pairs = enumerate(zip_longest(ours, theirs))
    differences = (Difference(at, one, other) for at, (one, other) in pairs if one is None or other is None or one.what != other.what)
    return next(differences, None)


def _at_about_the_same_time(ours: Sequence[ComparedDecision], theirs: Sequence[ComparedDecision], within_s: float) -> Difference | None:
    mine, others = _numbered(ours), _numbered(theirs)
    found: list[tuple[float, Difference]] = []
    for key, (at, one) in mine.items():
        _, other = others.get(key, (0, None))
        if other is None or abs(other.at_s - one.at_s) > within_s:
            found.append((one.at_s, Difference(at, one, other)))
    found += [(other.at_s, Difference(at, None, other)) for key, (at, other) in others.items() if key not in mine]
    return min(found, key=lambda one: one[0], default=(0.0, None))[1]


def _numbered(decisions: Sequence[ComparedDecision]) -> dict[tuple[str, int], tuple[int, ComparedDecision]]:
    """Return each decision with its number, by what it is, and how often that has been decided before."""
    seen = Counter[str]()
    found: dict[tuple[str, int], tuple[int, ComparedDecision]] = {}
    for at, one in enumerate(decisions):
        found[one.what, seen[one.what]] = at, one
        seen[one.what] += 1
    return found


def decisions_of(run: RecordedRun) -> list[ComparedDecision]:
    """Return what the mission has asked of the skills: starts and interruptions, without their inputs."""
    asked: list[ExecutionEvent] = []
    seen: set[str] = set()
    for event in run.events:
        if isinstance(event, ExecutionEvent) and (kind := _kind(event)) and f"{kind} {event.id}" not in seen:
            seen.add(f"{kind} {event.id}")
            asked.append(event)
    return [ComparedDecision(f"{_kind(event)} {event.skillset}.{event.skill}", run.time_s(event)) for event in _ordered(asked)]


def _kind(event: ExecutionEvent) -> str:
    if event.state is S.REQUESTED:
        return "start"
    return "interrupt" if event.state in {S.INTERRUPTING, S.INTERRUPTED} else ""


def _ordered(events: Sequence[ExecutionEvent]) -> list[ExecutionEvent]:
    groups: list[list[ExecutionEvent]] = []
    for event in events:
        if groups and event.stamp_s - groups[-1][0].stamp_s <= TOGETHER_S:
            groups[-1].append(event)
        else:
            groups.append([event])
    return [event for group in groups for event in sorted(group, key=lambda one: one.skillset)]


def _spans(run: RecordedRun) -> Iterator[tuple[str, float, float]]:
    """Yield each execution that ran: skill, and from when to when, seconds since the departure."""
    since: dict[str, float] = {}
    for event in run.events:
        if isinstance(event, ExecutionEvent):
            if event.state is S.RUNNING:
                since.setdefault(event.id, run.time_s(event))
            elif event.state.terminal and event.id in since:
                yield f"{event.skillset}.{event.skill}", since.pop(event.id), run.time_s(event)
    last: EngineEvent = run.events[-1]
    skills = {event.id: f"{event.skillset}.{event.skill}" for event in run.events if isinstance(event, ExecutionEvent)}
    yield from ((skills[name], begun_s, run.time_s(last)) for name, begun_s in since.items())


def _summary(path: Path) -> Mapping[str, Any]:
    file = (path if path.is_dir() else path.parent) / "summary.json"
    if not file.is_file():
        return {}
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise AnalysisError(f"{file}: can't be read: {error}") from None
    return content if isinstance(content, dict) else {}


def _figure(summary: Mapping[str, Any], where: tuple[str, ...]) -> float | None:
    value = _number(summary, where)
    if value is not None and where[0] == "recovery":
        failure_s = _number(summary, ("recovery", "failure_s"))
        return None if failure_s is None else value - failure_s
    return value


def _number(summary: Mapping[str, Any], where: tuple[str, ...]) -> float | None:
    value: Any = summary
    for name in where:
        value = value.get(name) if isinstance(value, dict) else None
    return None if isinstance(value, bool) or not isinstance(value, int | float) else float(value)
