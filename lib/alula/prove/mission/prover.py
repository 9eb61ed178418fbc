"""Looks at all runs of a mission's file, within a time: what is found, and what was not looked at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from alula.language.errors import Diagnostic, Severity
from alula.missions.filed.part import MissionPart
from alula.missions.plan import InputError
from alula.model.model import Skillset
from alula.model.span import Span
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.accepted import acceptances, divided
from alula.prove.mission.answers import Answers, Row
from alula.prove.mission.conditions import NO_FAULTS, Faults
from alula.prove.mission.findings import findings, waits
from alula.prove.mission.holding import SINGLE, held
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.regions import Regions
from alula.prove.mission.system import System
from alula.prove.mission.waits import Waits
from alula.prove.mission.wanted import wanted

LOOKED_AT = Failures(hooks=False, aborts=False)
"""What the models say can fail, and functions that refuse inputs; hooks that raise, processes that die and aborts are left out."""


@dataclass(frozen=True)
class Proved:
    """The findings about a mission, and what answers each of its failures; ``complete``: all runs were looked at.

    ``accepted`` are findings that the file accepts with a reason.
    """

    findings: list[Diagnostic]
    rows: list[Row]
    complete: bool
    accepted: list[Diagnostic] = field(default_factory=list)


def prove_mission(
    path: Path,
    models: Sequence[Skillset],
    part: MissionPart,
    *,
    failures: Failures = LOOKED_AT,
    faults: Faults = NO_FAULTS,
    timeout_s: float = 30.0,
    tell: Callable[[str], None] | None = None,
) -> Proved:
    """Return what is wrong with the runs of a mission that ``check_mission`` finds no error in.

    ``faults`` says in which states faults show, for properties that name them. ``tell`` hears now and then how far a long search is.
    Ctrl-C ends the search as the end of the time does: what was found by then is returned.
    """
    deadline = Deadline.after(timeout_s, tell)
    return prove_within(deadline, path, models, part, failures=failures, faults=faults, given=f"{timeout_s:.3g} s")


def prove_within(
    deadline: Deadline,
    path: Path,
    models: Sequence[Skillset],
    part: MissionPart,
    *,
    failures: Failures = LOOKED_AT,
    faults: Faults = NO_FAULTS,
    given: str,
) -> Proved:
    """Return the same within a deadline; ``given`` is what messages call it."""
    try:
        system = System.read(path, models, part, failures, deadline)
        properties, wrong = wanted(system.nodes, system.skillsets, faults)
        # What must come is looked at one situation after another, for which it needs time of its own.
        several = any(one.kind not in SINGLE for one in properties)
        regions = Regions(system, deadline.half(deadline.doing) if several else deadline)
        _explore(regions)
    except (UndecidedError, InputError) as error:
        message = f"its runs can't be looked at: {error}"
        return Proved([Diagnostic("ALU711", message, _whole(path), Severity.WARNING)], [], complete=False)
    except OutOfTimeError:
        return Proved([_bound(path, 0, given)], [], complete=False)
    answers = Answers(regions)
    known = acceptances(regions.system.nodes)
    looked = Waits(regions)
    seen_waiting, complete = _waits(looked, regions, deadline.half(deadline.doing) if several else deadline)
    found, accepted = divided([*findings(regions, answers), *seen_waiting], known, str(path), complete=complete)
    found += wrong
    undecided = []
    for one in properties if not wrong else ():
        seen = held(regions, one, faults, deadline, always_ends=looked.always_ends)
        found += [seen.finding] if seen.finding else []
        undecided += [one.name] if not seen.finding and not seen.complete else []
    complete = complete and not undecided
    if not complete:
        found.append(_bound(path, len(regions.regions), given, undecided))
    return Proved(found, answers.rows, complete, accepted)


def _waits(looked: Waits, regions: Regions, deadline: Deadline) -> tuple[list[Diagnostic], bool]:
    """Return the findings about waits, and whether all situations were looked at for them."""
    found: list[Diagnostic] = []
    try:
        found.extend(waits(looked, regions.system, deadline))
    except (OutOfTimeError, KeyboardInterrupt):
        return found, False
    return found, regions.complete


def _explore(regions: Regions) -> None:
    try:
        regions.explore()
    except (OutOfTimeError, KeyboardInterrupt):
        return


def _bound(path: Path, regions: int, given: str, undecided: Sequence[str] = ()) -> Diagnostic:
    message = f"not all runs were looked at: {regions} groups of situations, those that fewest ticks lead to, in {given}"
    if undecided:
        message += f"; no run was found against {', '.join(f'`{one}`' for one in undecided)}, which proves nothing yet"
    return Diagnostic("ALU710", message, _whole(path), Severity.NOTE, "allow more with `--time`")


def _whole(path: Path) -> Span:
    return Span(str(path), 1, 1, 2)
