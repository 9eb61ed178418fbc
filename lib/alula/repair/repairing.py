"""Finds a branch by which a mission answers what it gives up for now, and has `check` prove the mission with it.

1. The mission is looked at as it is: what `check` tells, and what becomes of it with the fault.
2. Branches are made of what its files and the robot's skills have (`Patterns`), the smallest first.
3. Each is judged: what `check` finds in the file, what becomes of the mission with the fault, then all runs, with all failures, at last
   those in which hooks raise, managers die, or somebody aborts or pauses the mission. A branch is a repair when the fault is survived,
   every property of the mission is proved, and nothing new is left open.
4. A counterexample goes back: branches that would run the same skills side by side again are not tried.
5. Of a repair it is told which faults are survived before and after it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property

from alula.language.errors import Diagnostic, Severity
from alula.language.syntax.properties import property_of_mission
from alula.model.expressions import Expression
from alula.model.model import Property
from alula.odds.mission import achieved
from alula.prove.limits import Deadline, OutOfTimeError
from alula.prove.mission.run import MissionRun
from alula.prove.mission.system import System
from alula.repair.branches import Branch
from alula.repair.errors import RepairError
from alula.repair.failing import Failing, failing_by
from alula.repair.fates import MOST_FAULTS, Fate
from alula.repair.game import played
from alula.repair.judging import NOT_JUDGED, Judge, Judgement, Refused, run_of
from alula.repair.patterns import MOST_NODES, Patterns
from alula.repair.subject import Subject, with_property, without_properties_of
from alula.trees.attributes import node_name, type_name
from alula.trees.document import Element
from alula.trees.node import Node

Tell = Callable[[str], None]
TOGETHER = "Parallel"
MOST_SITUATIONS = 2_000
"""Of a mission with another fault than the one that is answered; where there are more, nothing is told of it."""
SHARE = 0.3
"""Which part of the time that is left is spent on the other faults, once there is a repair."""


@dataclass(frozen=True)
class Question:
    """A request for a repair.

    Attributes:
        fault: the fault that is to be answered; empty: a finding is.
        finding: the number of a counterexample of `check`; 0: a fault is.
        within: the node that the branch has to stand in; empty: anywhere.
        using: the skills that a branch may add, ``skillset.skill``; empty: all.
        most_faults: how many faults may come, the first one included.
        goal: a condition, written as in properties, that is as good as an accomplished mission; empty: there is none.
        never: what no run of the repaired mission may come to.
        reached: what has to be true at the end of an accomplished mission; None: nothing is asked.
        most_nodes: of a branch.
        others: whether it is told what becomes of the mission by other faults.
    """

    fault: str = ""
    finding: int = 0
    within: str = ""
    using: tuple[str, ...] = ()
    most_faults: int = MOST_FAULTS
    goal: str = ""
    never: str = ""
    reached: Expression | None = None
    most_nodes: int = MOST_NODES
    others: bool = True

    @property
    def never_asked(self) -> str:
        """The property for ``never``; empty where there is none."""
        return f"asked_never: never {self.never}" if self.never else ""


@dataclass(frozen=True)
class Repair:
    """A proved branch.

    Attributes:
        branch: what is put into the mission.
        text: the mission's file with it.
        tried: how many branches were judged before it.
        not_asked: properties of the mission that ask for nodes which it has not.
        left: what `check` finds in the mission as it is, and in the repaired one, too.
        before, after: what becomes of the mission by faults, without and with it.
        not_looked_at: faults, alone or one after another, of which that was not found out: too many situations, or no time left.
        assuming: the states that must not come later, as a `Fate` has them.
    """

    branch: Branch
    text: str
    tried: int
    not_asked: tuple[str, ...]
    left: tuple[str, ...]
    before: dict[tuple[str, ...], Fate] = field(default_factory=dict)
    after: dict[tuple[str, ...], Fate] = field(default_factory=dict)
    not_looked_at: tuple[tuple[str, ...], ...] = ()
    assuming: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """The result of a search: a repair, or why there is none.

    ``impossible``: it can't be accomplished with the fault, as ``reasons`` show; a repair then brings it to a safe end. Else, without a
    repair, nobody knows; ``stopped``: not all branches were tried, as the time was over, or somebody ended the search. ``strikes``: how
    often the fault comes at most, where it may come again; 0: it comes once, and stays. ``refused``: the branches that
    were tried and are none.
    """

    failing: tuple[Failing, ...]
    fate: Fate | None
    repair: Repair | None = None
    impossible: bool = False
    reasons: tuple[str, ...] = ()
    tried: int = 0
    stopped: bool = False
    strikes: int = 0
    refused: tuple[Refused, ...] = ()

    @property
    def survives_already(self) -> bool:
        """Return whether the mission survives without a repair."""
        return self.fate is not None and self.fate.answered

    @property
    def assuming(self) -> tuple[str, ...]:
        """The states that must not come later: otherwise the fault is not survived, though the mission ends safely."""
        found = self.repair or self.fate
        return () if found is None else found.assuming


class Search:
    """Searches a repair of one mission."""

    def __init__(self, subject: Subject, question: Question, deadline: Deadline, tell: Tell) -> None:
        if bool(question.fault) == bool(question.finding):
            raise RepairError("name what is to be answered: --fault NAME, or --finding N of `alula check`")
        if question.fault and question.fault not in subject.faults:
            raise RepairError(f"--fault {question.fault}: there is no such fault; there are {', '.join(sorted(subject.faults))}")
        known = {f"{of.name}.{one.name}" for of in subject.skillsets for one in of.skills}
        wrong = [one for one in question.using if one not in known]
        if wrong:
            raise RepairError(f"--using {wrong[0]}: there is no such skill; there are {', '.join(sorted(known))}")
        self._subject = subject
        self._question = question
        self._deadline = deadline
        self._deadlines = [deadline]
        self._tell = tell
        self._goal = condition_of("--goal", question.goal) if question.goal else None
        self._judge = Judge(subject, deadline, self._goal, question.most_faults, question.reached)
        self._patterns = Patterns(subject, question.using, question.most_faults, question.most_nodes)
        self._refuted: set[frozenset[str]] = set()
        self._refused: list[Refused] = []
        self._stopped = False
        self._missing = tuple(subject.names_asked())

    @cached_property
    def _text_before(self) -> str:
        """The mission's file as it is, without the properties that ask for nodes which it has not."""
        return self._without_branch(self._missing)[0]

    @cached_property
    def _before(self) -> Judgement:
        """What `check` finds in the mission as it is, of what the models make go wrong."""
        return self._judge.check(self._text_before)

    @cached_property
    def _whole_before(self) -> Judgement:
        """What `check` finds in the mission as it is, in all the runs that it looks at."""
        *_, whole = self._judge.parts(self._text_before)
        return whole

    def _new(self, judgement: Judgement, *, whole: bool = False) -> list[Diagnostic]:
        """Return the findings that the mission as it is has not; of that nothing need be known where nothing was found."""
        return [] if judgement.clean else judgement.new(self._whole_before if whole else self._before)

    def stop(self) -> None:
        """End the search with the best result so far; a signal's handler may call it."""
        for one in self._deadlines:
            one.at_s = 0.0

    def run(self) -> Answer:
        """Search; raises AlulaError where the mission can't be read."""
        text = self._text_before
        read = self._judge.read(text)
        errors = [one for one in read.findings if one.severity is Severity.ERROR and one.code < "ALU7"]
        if errors:
            raise RepairError(f"the mission has errors, which come first: {errors[0].render()}")
        self._can_be_asked()
        system = System.of(self._subject.mission)
        finding = self._finding()
        failing = self._failing(system, finding)
        fault = (self._question.fault,) if self._question.fault else ()
        fate = self._judge.fate(text, fault) if fault else None
        if fate is not None and fate.answered:
            return Answer(tuple(failing), fate, strikes=self._question.most_faults if fate.again else 0)
        self._tell(f"{'; '.join(dict.fromkeys(one.words for one in failing))}: {_told(fate)}")
        reasons = next((lines for one in failing if (lines := self._why_impossible(text, one))), [])
        if reasons and (fate is None or fate.safe):
            return Answer(tuple(failing), fate, None, impossible=True, reasons=tuple(reasons))
        repair, tried = self._first_proved(read, failing, fate, finding)
        if repair is not None and self._question.others:
            repair = self._with_fates(text, repair)
        if repair is None and not reasons:
            reasons = [*self._why_unknown(text), *self._patterns.lacking]
            return Answer(tuple(failing), fate, reasons=tuple(reasons), tried=tried, stopped=self._stopped, refused=tuple(self._refused))
        return Answer(tuple(failing), fate, repair, bool(reasons), tuple(reasons), tried, self._stopped, refused=tuple(self._refused))

    def _can_be_asked(self) -> None:
        """Raise RepairError where a condition that is asked for names what the robot has not."""
        for option, condition in (("--never", self._question.never), ("--goal", self._question.goal)):
            if condition:
                text, _ = self._without_branch(self._missing, f"asked: never {condition}")
                self._judge.refuse_unread(text, option, condition)

    def _without_branch(self, leave_out: Sequence[str], more: str = "") -> tuple[str, list[str]]:
        document = self._subject.document()
        taken = without_properties_of(document.root, leave_out)
        with_property(document.root, self._subject.files.main, more)
        return document.text(), taken

    def _finding(self) -> Diagnostic | None:
        number = self._question.finding
        if not number:
            return None
        playable = [one for one in self._before.findings if run_of(one) is not None]
        if not 1 <= number <= len(playable):
            raise RepairError(f"--finding {number}: the mission has {len(playable)} counterexamples that are not accepted in its file")
        return playable[number - 1]

    def _failing(self, system: System, finding: Diagnostic | None) -> list[Failing]:
        if finding is None:
            found = failing_by(self._question.fault, self._subject, system)
            if not found:
                raise RepairError(f"--fault {self._question.fault}: no skill of the mission ends by it")
        else:
            run = run_of(finding)
            found = [_last_failing(run, system)] if run is not None else []
        within = self._question.within
        if within:
            names = {node.name for node in system.nodes}
            if within not in names:
                raise RepairError(f"--within {within}: there is no such node")
            found = [one for one in found if any(place.name == within for place in _above(one))]
            if not found:
                raise RepairError(f"--within {within}: nothing fails in there by that")
        return found

    def _first_proved(
        self, read: Judgement, failing: Sequence[Failing], fate: Fate | None, finding: Diagnostic | None
    ) -> tuple[Repair | None, int]:
        """Return the first branch that is proved, and how many were tried."""
        tried = 0
        several = [one for leaf in failing for one in self._patterns.branches(leaf, self._question.within, fate.states if fate else None)]
        branches: dict[tuple[str, ...], Branch] = {}
        for one in several:
            branches.setdefault(one.key, one)  # two leaves may have the same answer
        for branch in sorted(branches.values(), key=lambda one: one.order):
            if self._is_refuted(branch):
                continue
            tried += 1
            try:
                found = self._judged(branch, read, fate, finding)
            except OutOfTimeError:
                self._stopped = True
                self._refused.append(Refused(branch.name, NOT_JUDGED, branch.size))
                return None, tried
            if isinstance(found, Repair):
                return replace(found, tried=tried), tried
            self._refused.append(Refused(branch.name, found, branch.size))
            self._tell(f"{branch.size} nodes, '{branch.name}': no: {found}")
        return None, tried

    def _judged(self, branch: Branch, read: Judgement, fate: Fate | None, finding: Diagnostic | None) -> Repair | str:
        """Return the repair, or why it is none."""
        names = {node_name(one) for one in (branch.tree.iterate() if branch.tree is not None else ())}
        leave_out = tuple(one for one in self._missing if one not in names)
        text, not_asked = branch.written(self._subject, leave_out, self._question.never_asked)
        if errors := [one for one in self._judge.read(text).new(read) if one.severity is Severity.ERROR]:
            return errors[0].message
        assuming: tuple[str, ...] = ()
        if fate is not None:
            now = self._judge.fate(text, fate.faults)
            assuming = now.assuming
            if not now.answered and (fate.safe or not now.safe):
                return f"with {' and '.join(fate.faults)} it {_told(now)}{self._what_is_missing(branch, now)}"
        parts = self._judge.parts(text)
        judgement = next(parts)
        if new := self._new(judgement):
            self._learn(branch, text, new[0])
            return new[0].message
        if not judgement.complete:
            return "not all its runs were looked at"
        if finding is not None and _is_left(judgement, self._before, finding):
            return "the counterexample is still there"
        whole = next(parts)
        if new := self._new(whole, whole=True):
            return new[0].message
        if not whole.complete:
            return "not all its runs in which hooks raise, managers die, or somebody aborts or pauses it were looked at"
        written, _ = branch.written(self._subject)
        left = dict.fromkeys(one.message for one in whole.findings if one.severity is not Severity.NOTE)
        return Repair(branch, written, 0, tuple(not_asked), tuple(left), assuming=assuming)

    def _what_is_missing(self, branch: Branch, fate: Fate) -> str:
        """Return why the mission can't be accomplished any more.

        That is what skills of a branch need of the functional layer, and is not so, else what is refused then, or what nobody knows.
        """
        missing = self._missing_in((branch.use, branch.tree), fate)
        refused = [f"{skill} is refused then ({why})" for skill, why in fate.refused]
        return "".join(f"; {one}" for one in missing or refused or _told_chosen(fate))

    def _missing_in(self, parts: Iterable[Element | None], fate: Fate) -> list[str]:
        asked = [one for part in parts if part is not None for one in self._patterns.asked_in(part)]
        missing = [(at, state) for at, state in asked if fate.states.get(at, state) != state]
        return [f"{at} may be {fate.states[at]} then" for at in dict.fromkeys(at for at, _ in missing)]

    def _why_unknown(self, text: str) -> list[str]:
        """Return why the mission can't be accomplished though nothing fails, if that is so: no branch for a fault mends it."""
        try:
            calm = self._judge.fate(text, ())
        except OutOfTimeError:
            return []
        missing = self._missing_in(self._subject.files.trees.values(), calm)
        return (
            []
            if calm.survives
            else ["; ".join(["the mission may not be accomplished though nothing fails", *(missing or _told_chosen(calm))])]
        )

    def _why_impossible(self, text: str, failing: Failing) -> list[str]:
        """Return why no tree can have done what a skill is for that the mission needs; empty where one might."""
        lines: list[str] = []
        try:
            if (
                not failing.states
                or failing.degrades
                or self._patterns.may_leave_out(failing)
                or not self._judge.needs(text, failing.skill)
            ):
                return []
        except OutOfTimeError:
            return []
        if self._can_be_left(failing):
            return []
        for purpose in self._patterns.all_stand_ins(failing):
            own = [(at.partition(".")[2], state) for at, state in failing.states if at.partition(".")[0] == purpose.skillset.name]
            try:
                game = played(purpose.skillset, purpose.skill.name, own, self._deadline) if own else None
            except OutOfTimeError:
                return []
            if game is None or game.won:
                return []
            refused = ", ".join(f"`{one}`" for one in game.refused)
            cure = " or ".join(dict.fromkeys(at for at, _ in own))
            lines.append(
                f"{purpose.name} can't start any more: it is refused by {refused}, in each of {game.situations} situations; "
                f"it could if {purpose.skillset.name}.{cure} left what the fault shows"
            )
        others = f"of {', '.join(self._question.using)} none" if self._question.using else "no other skill"
        needed = f"the mission is accomplished in no run without {failing.skill}, and {others} is for the same and can run"
        return [needed, *lines]

    def _can_be_left(self, failing: Failing) -> bool:
        """Return whether some skill brings about another state than the one that shows the fault: nobody knows what comes of that."""
        skills = [(of.name, one) for of in self._subject.skillsets for one in of.skills]
        brought = {pair for several in self._subject.brought.values() for pair in several}
        brought |= {pair for skillset, skill in skills for pair in achieved(skillset, skill)}
        return any(at == other and state != to for at, state in failing.states for other, to in brought)

    # --- counterexamples ---------------------------------------------------------------------------------------------

    def _learn(self, branch: Branch, text: str, finding: Diagnostic) -> None:
        """Remember which skills of a branch ran side by side where a property was broken."""
        run = run_of(finding)
        if run is None or finding.severity is not Severity.ERROR or branch.tree is None:
            return
        skills = self._judge.skills(text)
        running = frozenset(skills[leaf] for leaf in _asked(run))
        mine = [one for one in _together(branch.tree) if one <= running]
        if mine:
            self._refuted.add(max(mine, key=len))

    def _is_refuted(self, branch: Branch) -> bool:
        return branch.tree is not None and any(one in self._refuted for one in _together(branch.tree))

    # --- afterwards --------------------------------------------------------------------------------------------------

    def _with_fates(self, text: str, repair: Repair) -> Repair:
        """Add what becomes of the mission by each fault, and by each after the one that is answered, as far as time goes."""
        fault, names = self._question.fault, sorted(self._subject.faults)
        singles = [(fault,), *((one,) for one in names if one != fault)] if fault else [(one,) for one in names]
        pairs = [(fault, one) for one in names if one != fault] if fault and self._question.most_faults > 1 else []
        stripped, _ = repair.branch.written(self._subject, self._missing)
        before: dict[tuple[str, ...], Fate] = {}
        after: dict[tuple[str, ...], Fate] = {}
        self._deadlines.append(Deadline.after(self._deadline.left_s() * SHARE, self._deadline.on_progress))
        judge = Judge(self._subject, self._deadlines[-1], self._goal, self._question.most_faults, self._question.reached)
        with suppress(OutOfTimeError):
            was, now = judge.fates(text), judge.fates(stripped)
            for faults in (*singles, *pairs):
                fates = was(faults, MOST_SITUATIONS), now(faults, MOST_SITUATIONS)
                if fates[0] is not None and fates[1] is not None:
                    before[faults], after[faults] = fates[0], fates[1]
        not_looked_at = tuple(one for one in (*singles, *pairs) if one not in after)
        return replace(repair, before=before, after=after, not_looked_at=not_looked_at)


def condition_of(option: str, text: str) -> Expression:
    """Read a condition, as in properties of missions; ``option`` is the option that has it. Raises RepairError."""
    one = property_of_mission(f"goal: eventually {text}", "the end of the condition")
    if isinstance(one, Property):
        return one.condition
    why = one.message + (f"; {one.hint}" if one.hint else "")
    raise RepairError(f"{option} '{text}': can't be read as a condition, such as outcome given_up or skillset.skill running: {why}")


def _told(fate: Fate | None) -> str:
    if fate is None:
        return "nothing answers"
    return "may not be accomplished" + ("" if fate.safe else ", and may end in no safe state")


def _told_chosen(fate: Fate) -> list[str]:
    return [f"it may be that {' and '.join(fate.chosen)}"] if fate.chosen else []


def _above(failing: Failing) -> Iterator[Node]:
    at: Node | None = failing.leaf
    while at is not None:
        yield at
        at = at.parent


def _last_failing(run: MissionRun, system: System) -> Failing:
    leaves = [one.leaf for event in run.events for one in event.ended if event.failure or one.state != "TERMINATED"]
    if not leaves:
        raise RepairError("no skill fails in this counterexample: there is nothing that a branch could answer")
    node = system.leaves[leaves[-1]]
    return Failing(node, f"{node.skillset}.{node.model.name}")


def _is_left(after: Judgement, before: Judgement, finding: Diagnostic) -> bool:
    same = [one for one in after.findings if (one.code, one.message) == (finding.code, finding.message)]
    return len(same) >= len([one for one in before.findings if (one.code, one.message) == (finding.code, finding.message)])


def _asked(run: MissionRun) -> set[int]:
    """Return the leaves whose skills run, or were asked for, at the end of a run."""
    asked: set[int] = set()
    for event in run.events:
        asked -= {one.leaf for one in event.ended}
        asked |= set(event.started)
    return asked


def _together(element: Element) -> list[frozenset[str]]:
    """Return the sets of skills that may run side by side below a node."""
    if not element.children:
        name = type_name(element)
        return [frozenset({name})] if "." in name else [frozenset()]
    several = [_together(one) for one in element.children]
    if element.tag != TOGETHER:
        return [one for found in several for one in found]
    sets: list[frozenset[str]] = [frozenset()]
    for found in several:
        sets = [one | other for one in sets for other in found]
    return sets
