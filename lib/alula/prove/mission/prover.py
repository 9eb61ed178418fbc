"""Looks at all runs of a mission's file, within a time: what is found, and what was not looked at."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from alula.language.errors import Diagnostic, Severity
from alula.missions.mission_file import MissionFile
from alula.missions.plan import InputError
from alula.model.span import Span
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.accepted import acceptances, divided
from alula.prove.mission.asked import with_asked_resources
from alula.prove.mission.conditions import NO_FAULTS, Faults
from alula.prove.mission.findings import WAITS, findings, leaving_and_fighting, taken_as, unless_held_up, waits
from alula.prove.mission.holding import SINGLE, held
from alula.prove.mission.managers import Failures
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import FailureResponses, Row
from alula.prove.mission.system import System, look_at
from alula.prove.mission.waits import Waits
from alula.prove.mission.wanted import wanted

LOOKED_AT = Failures(hooks=False, aborts=False)
"""Failures in the models, and functions that refuse inputs."""
ALSO = Failures(deaths=True, pauses=True)
"""What is looked at afterwards: hooks that raise, managers' processes that die, an abort and a pause from outside besides."""
SHARE = 0.5
"""How long that may take, by the time that the rest has."""


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
    mission: MissionFile,
    *,
    faults: Faults = NO_FAULTS,
    timeout_s: float = 30.0,
    on_progress: Callable[[str], None] | None = None,
) -> Proved:
    """Return what is wrong with the runs of a mission that ``check_mission`` finds no error in.

    Runs in which hooks raise, processes die or people interfere are looked at afterwards, in a time of their own (``SHARE``).
    ``faults`` says in which states faults show, for properties that name them. ``on_progress`` hears now and then how far a long search is.
    Ctrl-C ends the search as the end of the time does: what was found by then is returned.
    """
    search = _Search(mission, faults)
    seen = search.within(Deadline.after(timeout_s, on_progress), f"{timeout_s:.3g} s")
    share_s = timeout_s * SHARE
    return search.also(seen, Deadline.after(share_s, on_progress), f"{share_s:.3g} s").proved()


def prove_within(
    deadline: Deadline,
    mission: MissionFile,
    *,
    faults: Faults = NO_FAULTS,
    given: str,
) -> Iterator[Proved]:
    """Yield what the models alone make go wrong, then that and what ``prove_mission`` looks at afterwards, within a deadline.

    What the first part has found of ticks and managers serves the second; ``given`` is what messages call the time.
    Raises OutOfTimeError where it is over before the second part.
    """
    search = _Search(mission, faults)
    seen = search.within(deadline, given)
    yield seen.proved()
    deadline.check()
    yield search.also(seen, deadline, given).proved()


@dataclass(frozen=True)
class _Seen:
    """What was found up to now; ``system`` is None where no runs could be looked at.

    Which situations were looked at is not kept: what is looked at afterwards has others, and both together take much memory.
    """

    path: Path
    system: System | None
    found: tuple[Diagnostic, ...] = ()
    rows: tuple[Row, ...] = ()
    bounds: tuple[Diagnostic, ...] = ()

    def proved(self) -> Proved:
        """Return the result without the findings that the file accepts."""
        if self.system is None:
            return Proved([*self.found, *self.bounds], [], complete=False)
        known = acceptances(self.system.nodes)
        complete = not self.bounds
        found, accepted = divided(self.found, known, str(self.path), complete=complete)
        return Proved([*found, *self.bounds], list(self.rows), complete, accepted)


class _Search:
    """Looks at the runs of one mission."""

    def __init__(self, mission: MissionFile, faults: Faults) -> None:
        self._file = mission.with_models(with_asked_resources(mission, faults))
        self._path = mission.source.path
        self._faults = faults

    def _read(self, why: str) -> System:
        return System.of(self._file, LOOKED_AT, why_any_order=why)

    def within(self, deadline: Deadline, given: str) -> _Seen:
        """Search the failures in the models, and the properties of the file."""
        try:
            regions, several = self._regions(deadline)
        except (UndecidedError, InputError) as error:
            message = f"its runs can't be looked at: {error}"
            return _Seen(self._path, None, (Diagnostic("ALU711", message, _whole(self._path), Severity.WARNING),))
        except OutOfTimeError:
            return _Seen(self._path, None, bounds=(_bound(self._path, 0, given),))
        properties, wrong = wanted(regions.system.nodes, regions.system.skillsets, self._faults)
        responses = FailureResponses(regions)
        looked = Waits(regions)
        found = [*taken_as(regions.system), *findings(regions, responses)]
        seen_waiting, complete = _waits(looked, regions, deadline.half(deadline.doing) if several else deadline)
        found += [*seen_waiting, *wrong]
        undecided = []
        for one in properties if not wrong else ():
            seen = held(regions, one, self._faults, deadline, always_ends=looked.always_ends)
            found += [seen.finding] if seen.finding else []
            undecided += [one.name] if not seen.finding and not seen.complete else []
            helped = one.kind not in SINGLE and not one.within and not seen.finding and seen.complete
            found += list(unless_held_up(regions.system, one)) if helped else []
        bounds = () if complete and not undecided else (_bound(self._path, len(regions.regions), given, undecided),)
        return _Seen(self._path, regions.system, tuple(found), tuple(responses.rows), bounds)

    def _regions(self, deadline: Deadline) -> tuple[Regions, bool]:
        """Return what was looked at within a time, and whether a property needs some of that; raises as ``System.of``."""

        def look(system: System) -> tuple[Regions, bool]:
            properties, _ = wanted(system.nodes, system.skillsets, self._faults)
            # What must come is looked at one situation after another, for which it needs time of its own.
            several = any(one.kind not in SINGLE for one in properties)
            regions = Regions(system, deadline.half(deadline.doing) if several else deadline)
            _explore(regions)
            return regions, several

        return look_at(self._read, look)

    def also(self, before: _Seen, deadline: Deadline, given: str) -> _Seen:
        """Look at runs in which hooks raise, managers die, or somebody aborts or pauses the mission; of those, what is new."""
        if before.system is None or before.bounds:
            return before
        try:
            regions = Regions(before.system.looking_at(ALSO), deadline)
            _explore(regions)
            # What nothing answers is not told: the last of all answers can always fail so. What never happens was told before.
            found = leaving_and_fighting(regions)
            seen_waiting, complete = _waits(Waits(regions), regions, deadline)
        except UndecidedError as error:
            message = f"its runs with hooks that raise, managers that die, an abort or a pause can't be looked at: {error}"
            undecided = Diagnostic("ALU711", message, _whole(self._path), Severity.WARNING)
            return replace(before, found=(*before.found, undecided))
        except OutOfTimeError:
            return replace(before, bounds=(*before.bounds, _bound(self._path, 0, given, also=True)))
        if not any(one.code == WAITS for one in before.found):  # else the same wait, come to otherwise
            found += seen_waiting
        properties, wrong = wanted(regions.system.nodes, regions.system.skillsets, self._faults)
        for one in properties if not wrong else ():
            against = held(regions, one, self._faults, deadline).finding if one.kind in SINGLE else None
            found += [against] if against else []
        known = {_what(one) for one in before.found}
        new = [one for one in found if _what(one) not in known]
        bounds = () if complete else (_bound(self._path, len(regions.regions), given, also=True),)
        return replace(before, found=(*before.found, *new), bounds=bounds)


def _what(finding: Diagnostic) -> tuple[str, Span, str]:
    """Return what a finding is about; what stands in parentheses may be otherwise in another run."""
    return finding.code, finding.span, re.sub(r"\([^)]*\)", "", finding.message)


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


def _bound(path: Path, regions: int, given: str, undecided: Sequence[str] = (), *, also: bool = False) -> Diagnostic:
    what = "not all runs in which hooks raise, managers die, or somebody aborts or pauses it" if also else "not all runs"
    message = f"{what} were looked at: {regions} groups of situations, those that fewest ticks lead to, in {given}"
    if undecided:
        message += f"; no run was found against {', '.join(f'`{one}`' for one in undecided)}, which proves nothing yet"
    return Diagnostic("ALU710", message, _whole(path), Severity.NOTE, "allow more with `--time`")


def _whole(path: Path) -> Span:
    return Span(str(path), 1, 1, 2)
