"""Judge a changed mission: the findings of `check`, the new ones among them, and the faults that it survives."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from alula.language.errors import Diagnostic, Severity
from alula.model.expressions import Expression
from alula.odds.mission import MissionSteps
from alula.odds.robot import mission_of
from alula.prove.limits import Deadline
from alula.prove.mission.prover import Proved, prove_within
from alula.prove.mission.run import MissionRun
from alula.prove.mission.system import System
from alula.repair.errors import RepairError
from alula.repair.fates import MOST_FAULTS, Fate, fate_of, needs
from alula.repair.subject import Subject

BOUND, UNREAD = "ALU710", "ALU713"
"""The findings for a search that is not complete, and for a property that can't be read."""


@dataclass(frozen=True)
class Judgement:
    """The findings about a mission.

    Attributes:
        findings: what `check` tells, without what the file accepts.
        complete: all runs were looked at.
    """

    findings: tuple[Diagnostic, ...]
    complete: bool

    @property
    def clean(self) -> bool:
        """Return whether nothing was found."""
        return all(one.code == BOUND for one in self.findings)

    def new(self, before: Judgement) -> list[Diagnostic]:
        """Return the findings that ``before`` does not have; findings of one text at several places count once for each."""
        known = Counter(map(_what, before.findings))
        found = []
        for one in self.findings:
            known[_what(one)] -= 1
            if known[_what(one)] < 0 and one.code != BOUND:
                found.append(one)
        return found


def _what(finding: Diagnostic) -> tuple[str, str]:
    return finding.code, re.sub(r"\([^)]*\)", "", finding.message)


@dataclass(frozen=True)
class Refused:
    """A branch, or a course of skills, that was tried and refused, and the reason; ``nodes``: of a branch."""

    name: str
    why: str
    nodes: int = 0

    def as_dict(self) -> dict[str, object]:
        """Return it as plain values for JSON."""
        return {"name": self.name, "why": self.why, **({"nodes": self.nodes} if self.nodes else {})}


NOT_JUDGED = "the search ended before it was judged"


class Judge:
    """Judges a mission and changed texts of it."""

    def __init__(
        self,
        subject: Subject,
        deadline: Deadline,
        goal: Expression | None = None,
        strikes: int = MOST_FAULTS,
        reached: Expression | None = None,
    ) -> None:
        self._subject = subject
        self._strikes = strikes
        self._deadline = deadline
        self._goal = goal
        self._reached = reached

    def read(self, text: str) -> Judgement:
        """Return the findings of `check` for a text of the mission's file, without its runs."""
        return Judgement(tuple(self._subject.findings(text)), complete=False)

    def check(self, text: str) -> Judgement:
        """Return the findings of `check` for a text, with all that the models make go wrong; raises OutOfTimeError."""
        return next(self.parts(text))

    def parts(self, text: str) -> Iterator[Judgement]:
        """Yield the judgement of `check`, then one with failing hooks, dying processes and interfering people; raises OutOfTimeError.

        The second part goes on with what the first one knows. Of a text with errors, both are these.
        """
        found = self.read(text)
        if any(one.severity is Severity.ERROR for one in found.findings):
            yield from (found, found)
            return
        with self._subject.copy(text) as path:
            for proved in self._prove(path):
                yield Judgement((*found.findings, *proved.findings), proved.complete)

    def refuse_unread(self, text: str, option: str, condition: str) -> None:
        """Raise RepairError where the property that asks for an option's condition can't be read in a text of the mission's file."""
        wrong = next((one for one in self.check(text).findings if one.code == UNREAD), None)
        if wrong is not None:
            raise RepairError(f"{option} '{condition}': {wrong.message}{f'; {wrong.hint}' if wrong.hint else ''}")

    def _prove(self, path: Path) -> Iterator[Proved]:
        self._deadline.check()
        subject = self._subject
        given = f"{self._deadline.left_s():.3g} s"
        return prove_within(self._deadline, subject.changed(path), faults=subject.shown, given=given)

    def skills(self, text: str) -> list[str]:
        """Return the skills of the leaves of a text of the mission's file, by the leaves' numbers."""
        with self._subject.copy(text) as path:
            leaves = System.of(self._subject.changed(path)).leaves
        return [f"{one.skillset}.{one.model.name}" for one in leaves]

    def fate(self, text: str, faults: Sequence[str]) -> Fate:
        """Return the fate of a text of the mission's file with these faults; raises OutOfTimeError."""
        found = self.fates(text)(faults, None)
        assert found is not None  # noqa: S101 - it has no bound
        return found

    def needs(self, text: str, skill: str) -> bool:
        """Return whether a skill has to start for a text of the mission to be accomplished; raises OutOfTimeError."""
        return needs(self._steps(text), self._subject.skillsets, skill, self._deadline)

    def fates(self, text: str) -> Callable[[Sequence[str], int | None], Fate | None]:
        """Return a function from faults and a limit of situations to the fate of a text; for several faults it is faster than ``fate``."""
        steps = self._steps(text)

        def fate(faults: Sequence[str], most: int | None) -> Fate | None:
            self._deadline.doing = f"looking at the runs with {' and then '.join(faults) or 'no fault'}"
            subject = self._subject
            rest, skillsets = subject.at_rest, subject.skillsets
            return fate_of(steps, skillsets, faults, self._deadline, rest, most, self._goal, self._strikes, self._reached)

        return fate

    def _steps(self, text: str) -> MissionSteps:
        with self._subject.copy(text) as path:
            read, steps_of, _ = mission_of(self._subject.flown_as, changed=path, models=self._subject.skillsets)
            return steps_of(read(""))


def run_of(finding: Diagnostic) -> MissionRun | None:
    """Return the run that shows a finding; None: it has none."""
    run = getattr(finding, "run", None)
    return run if isinstance(run, MissionRun) else None
