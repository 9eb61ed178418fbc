"""What the search makes of an altered mission, held against what it makes of the mission as it is."""

from __future__ import annotations

import shutil
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from alula.check.findings import findings_of
from alula.language.check.findings import check
from alula.language.errors import Diagnostic
from alula.language.messages import NO_MESSAGES, Messages
from alula.missions.mission_file import MissionFile
from alula.missions.part import MissionPart
from alula.missions.plan import InputError
from alula.model.model import Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.accepted import acceptances, divided
from alula.prove.mission.conditions import Faults
from alula.prove.mission.findings import OWN, findings, taken_as, waits
from alula.prove.mission.holding import SINGLE, held
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.play import Played, play
from alula.prove.mission.prover import LOOKED_AT
from alula.prove.mission.regions import Regions
from alula.prove.mission.responses import FailureResponses
from alula.prove.mission.run import MissionFinding, MissionRun
from alula.prove.mission.system import System
from alula.prove.mission.unknown import is_unknown
from alula.prove.mission.waits import Waits
from alula.prove.mission.wanted import wanted
from alula.prove.skillset.prover import prove
from mission_mutations.differing import differing, flown, writing
from mission_mutations.mutants import Mutant
from mission_mutations.sameness import Seen, Shown, same

FOUND, EQUAL, MISSED = "found", "equal", "missed"
ANSWERS, ANOTHER_RUN, ACCOUNT = "answers", "another run", "account"
COMPARED = frozenset({ANSWERS, ANOTHER_RUN, ACCOUNT})
"""What is seen only beside the mission as it is."""
CANDIDATES = 400
"""So many runs that may tell two missions apart are flown at most: of those that leave them soon, many can't be flown."""
ACCOUNTS = 4
"""So many runs are flown to their end at most, to compare what is told there."""
GIVEN_S = 900.0


@dataclass(frozen=True)
class Robot:
    """The robot whose missions are altered; ``folder`` has all of them."""

    folder: Path
    skillsets: tuple[Skillset, ...]
    part: MissionPart
    faults: Faults
    messages: Messages = NO_MESSAGES


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant.

    Attributes:
        verdict: "found", "equal" or "missed".
        by: what found it: "check" (the file or the model is refused or warned of), a code of a finding about its runs, "property", "model
            proof"; beside the mission as it is "answers" (another answer to a failure, or another end after it), "another run", and
            "account" (the same run, of which the mission tells something else).
        told: the finding's message, or what differs.
        flown: whether a flight over mocks shows it: a counterexample that plays to its end, or a run that one of both missions flies and
            the other leaves; None where there is no run to fly.
        cpu_s: seconds of the processor, flights included.
    """

    mission: str
    kind: str
    what: str
    verdict: str
    by: str
    told: str
    flown: bool | None
    cpu_s: float

    @property
    def said(self) -> str:
        """In words."""
        return f"{self.verdict} ({self.by})"

    @property
    def again(self) -> bool:
        """Return whether it is worth to be judged again."""
        return self.verdict == MISSED

    def as_dict(self) -> dict[str, object]:
        """Return it as JSON has it."""
        return asdict(self)


Said = tuple[str, str, str, bool | None]
"""Verdict, by, told, flown."""


@dataclass
class Looked:
    """All runs of a mission, and what is known of them without looking any further."""

    path: Path
    skillsets: tuple[Skillset, ...]
    part: MissionPart
    regions: Regions
    responses: FailureResponses
    seen: Seen

    @property
    def system(self) -> System:
        """The mission with its managers."""
        return self.regions.system

    @property
    def table(self) -> Mapping[object, object]:
        """What answers each failure, and how the mission can end after it."""
        rows = self.responses.rows
        return {(row.skill, row.end, row.node, row.moment): (tuple(sorted(row.starts)), tuple(sorted(row.outcomes))) for row in rows}


class Judge:
    """Judges mutants of one mission."""

    def __init__(self, robot: Robot, mission: str) -> None:
        self._robot = robot
        self._mission = mission
        self._shown = Shown()
        path = robot.folder / f"{mission}.xml"
        try:
            self.original = self._look(path, robot.skillsets, robot.part)
        except UndecidedError as error:  # as `check` does where a class of the robot's own can't be run
            self.original = self._look(path, robot.skillsets, robot.part, str(error))
        self._stages_of_original = self._stages(self.original)
        self._known: list[set[tuple[str, str]]] = []
        self._known_of_file = {_key(one) for one in self._of_file(self.original.path, robot.skillsets, robot.part)}
        self._proofs: dict[str, set[tuple[str, str]]] = {}

    def judge(self, mutant: Mutant) -> Verdict:
        """Return what becomes of a mutant."""
        begun = time.process_time()
        with tempfile.TemporaryDirectory(prefix="alula-mutant-") as folder:
            missions = Path(folder) / "missions"
            shutil.copytree(self._robot.folder, missions)
            if mutant.file:
                (missions / mutant.file).write_text(mutant.text, encoding="utf-8")
            skillsets = tuple(in_place(one, mutant.skillset) for one in self._robot.skillsets)
            said = self._said(mutant, missions / f"{self._mission}.xml", skillsets)
        return Verdict(self._mission, mutant.kind, mutant.what, *said, round(time.process_time() - begun, 2))

    def _said(self, mutant: Mutant, path: Path, skillsets: tuple[Skillset, ...]) -> Said:
        part = mutant.part_of(self._robot.part)
        refused = self._new(
            self._of_file(path, skillsets, part) if mutant.skillset is None else check(mutant.skillset), self._known_of_file
        )
        if refused:
            return FOUND, "check", _told(refused[0]), None
        try:
            looked = self._look(path, skillsets, part, self.original.system.own.why)
        except (UndecidedError, InputError) as error:
            return FOUND, "ALU711" if mutant.altered is None else OWN, str(error), None
        except OutOfTimeError:
            return MISSED, "time", "the time was over", None
        if mutant.altered is not None and not looked.system.own.any_run:
            return MISSED, "any class", "the search takes any class in its place, so it can't tell two of them apart", None
        return self._compared(mutant, looked)

    def _compared(self, mutant: Mutant, looked: Looked) -> Said:
        """Return what becomes of a mutant all of whose runs were looked at."""
        stages = enumerate(self._stages(looked))
        if new := self._new_of(*next(stages)):
            return self._found(new, looked)
        if same(self.original.seen, looked.seen):
            return EQUAL, "bisimulation", "", None
        if new := self._new_of(*next(stages)):
            return self._found(new, looked)
        if changed := self._changed(looked):
            return FOUND, ANSWERS, changed, self._run_of_one_alone(looked)
        for stage in stages:
            if new := self._new_of(*stage):
                return self._found(new, looked)
        if mutant.skillset is not None and (new := self._proved(mutant.skillset)):
            return FOUND, "model proof", _told(new[0]), None
        if self._run_of_one_alone(looked):
            return FOUND, ANOTHER_RUN, "one of both flies a run that the other leaves", True
        if told := self._account(looked):
            return FOUND, ACCOUNT, told, True
        return MISSED, "nothing", "it is not shown to be equal, and no flight tells it apart", None

    def _new_of(self, stage: int, found: Sequence[Diagnostic]) -> list[Diagnostic]:
        """Return what is not found of the mission as it is by the same stage, or one before."""
        while len(self._known) <= stage:
            self._known.append({_key(one) for one in next(self._stages_of_original)}.union(*self._known[-1:]))
        return self._new(found, self._known[stage])

    def _found(self, new: Sequence[Diagnostic], looked: Looked) -> Said:
        """Return the first finding whose counterexample flies, the first of all where none does."""
        flown: list[tuple[Diagnostic, bool | None]] = []
        for one in new:
            run = one.run if isinstance(one, MissionFinding) else None
            flown.append((one, None if run is None else not play(MissionFile.read(looked.path, run.skillsets, looked.part), run).left))
            if flown[-1][1]:
                break
        shown, how = next((known for known in flown if known[1]), next((known for known in flown if known[1] is not None), flown[0]))
        return FOUND, "property" if shown.code == "ALU714" else shown.code, _told(shown), how

    def _changed(self, looked: Looked) -> str:
        """Return an answer to a failure that is another one, or another way to end after it; empty where all are the same."""
        before, after = self.original.table, looked.table
        changed = next((key for key in (*before, *after) if before.get(key) != after.get(key)), None)
        return "" if changed is None else f"{changed}: {before.get(changed)} becomes {after.get(changed)}"

    def _run_of_one_alone(self, looked: Looked) -> bool:
        """Return whether a run of one of both flies, and the other leaves it."""
        for one, other in ((looked, self.original), (self.original, looked)):
            for run in differing(one.seen, other.seen, CANDIDATES):
                if self._flown(run, one, one) and not self._flown(run, one, other):
                    return True
        return False

    def _account(self, looked: Looked) -> str:
        """Return what both tell otherwise of a run that both fly; empty where there is no such run."""
        for one, other in ((looked, self.original), (self.original, looked)):
            for run in writing(one.seen, other.seen, ACCOUNTS):
                told = [self._flown(run, one, each) for each in (self.original, looked)]
                before, after = map(_told_at_end, told)
                if all(told) and before != after:
                    return f"{before} becomes {after}"
        return ""

    def _flown(self, run: MissionRun, of: Looked, by: Looked) -> Played | None:
        return flown(run, of.system, by.path, by.system, by.skillsets, by.part)

    # --- what `check` says -------------------------------------------------------------------------------------------

    def _look(self, path: Path, skillsets: tuple[Skillset, ...], part: MissionPart, why_any_order: str = "") -> Looked:
        deadline = Deadline.after(GIVEN_S)
        system = System.of(MissionFile.read(path, skillsets, part), LOOKED_AT, why_any_order=why_any_order)
        regions = Regions(system, deadline)
        regions.explore()
        return Looked(path, system.skillsets, part, regions, FailureResponses(regions), self._shown.of(regions, path))

    def _stages(self, looked: Looked) -> Iterator[list[Diagnostic]]:
        """Yield what `check` finds about all runs, the quick parts first."""
        deadline, faults = Deadline.after(GIVEN_S), self._robot.faults
        properties, wrong = wanted(looked.system.nodes, looked.system.skillsets, self._robot.faults)
        known = acceptances(looked.system.nodes)
        found = [*taken_as(looked.system), *findings(looked.regions, looked.responses), *wrong]
        yield divided(found, known, "", complete=True)[0]
        yield [one for each in properties if each.kind in SINGLE and (one := held(looked.regions, each, faults, deadline).finding)]
        waiting = Waits(looked.regions)
        found += waits(waiting, looked.system, deadline)
        yield divided(found, known, str(looked.path), complete=True)[0]
        ends = waiting.always_ends
        several = [each for each in properties if each.kind not in SINGLE]
        yield [one for each in several if (one := held(looked.regions, each, faults, deadline, always_ends=ends).finding)]

    def _of_file(self, path: Path, skillsets: Sequence[Skillset], part: MissionPart) -> list[Diagnostic]:
        return findings_of(str(path), path.read_bytes(), skillsets, (), part, self._robot.messages)

    def _proved(self, skillset: Skillset) -> list[Diagnostic]:
        """Return what the proofs of a model alone find, that they do not find of the model as it is."""
        if skillset.name not in self._proofs:
            model = next(one for one in self._robot.skillsets if one.name == skillset.name)
            self._proofs[skillset.name] = {_key(one) for one in prove(model, timeout_s=GIVEN_S)}
        return self._new(prove(skillset, timeout_s=GIVEN_S), self._proofs[skillset.name])

    @staticmethod
    def _new(found: Sequence[Diagnostic], known: set[tuple[str, str]]) -> list[Diagnostic]:
        return [one for one in found if _key(one) not in known]


def _key(finding: Diagnostic) -> tuple[str, str]:
    return finding.code, finding.message


def _told(finding: Diagnostic) -> str:
    return f"{finding.code}: {finding.message}"


def _told_at_end(played: Played | None) -> dict[str, object]:
    """Return what a mission tells of itself at its end; a flight without a world does not know all of it."""
    known = {} if played is None else {"reason": played.end.reason, **played.facts}
    return {name: value for name, value in known.items() if not is_unknown(value)}


def in_place(model: Skillset, mutant: Skillset | None) -> Skillset:
    """Return the mutant where it is one of this model, else the model."""
    return mutant if mutant is not None and mutant.name == model.name else model
