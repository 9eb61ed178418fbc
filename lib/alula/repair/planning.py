"""Writes a whole mission for a goal, from nothing: the shortest course of skills, which is then repaired for each fault, and proved.

1. Courses to the goal are looked for (`Courses`), the shortest first.
2. Each becomes a tree: skills with what they need beside them, what the functional layer has to tell between them, and an end at rest.
3. The first one that `check` proves, and that is accomplished whenever nothing fails, is taken.
4. For each fault that it does not survive a branch is looked for, as in any other mission (`Search`).
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from alula.language.errors import Severity
from alula.model.expressions import And, Expression, ResourceIs, atoms
from alula.model.model import Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.repair.branches import node, tree_lines
from alula.repair.composing import Composer, Sources
from alula.repair.courses import Course, Courses, Here, States, Wanted, initial_states
from alula.repair.errors import RepairError
from alula.repair.fates import MOST_FAULTS, Fate
from alula.repair.judging import Judge
from alula.repair.naming import plain, told_state
from alula.repair.purposes import Purpose, Purposes, asked_of_others
from alula.repair.repairing import Question, Search, Tell, condition_of
from alula.repair.subject import Subject, with_property
from alula.trees.document import Element
from alula.trees.node import pointer
from alula.trees.reading import type_name

MOST_COURSES = 12
MOST_NODES = 15
EMPTY = '<root BTCPP_format="4" main_tree_to_execute="plan"><BehaviorTree ID="plan"><AlwaysSuccess/></BehaviorTree></root>\n'


@dataclass(frozen=True)
class Aim:
    """What is asked for.

    Attributes:
        goal: a condition, written as in properties of missions, or a role that a skill has to have filled.
        start: what is so at first, a condition of states; what it leaves open is as after power-up.
        never: what no run may come to.
        using: the skills that may be used, ``skillset.skill``; empty: all.
        most_faults: how many faults may come.
    """

    goal: str
    start: str = ""
    never: str = ""
    using: tuple[str, ...] = ()
    most_faults: int = MOST_FAULTS


@dataclass(frozen=True)
class Plan:
    """A mission that was proved.

    Attributes:
        text: its file.
        steps: the skills of its course.
        nodes: of its trees, but for what it needs to start and how it comes to rest.
        fates: what becomes of it by each fault of the robot that ends one of its skills.
        left_out: faults of which that was not found out in time.
    """

    text: str
    steps: tuple[str, ...]
    nodes: int
    fates: dict[str, Fate] = field(default_factory=dict)
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Answer:
    """What came of it: a plan, or none; ``impossible``: no course of skills leads to the goal, though nothing fails."""

    plan: Plan | None
    tried: int
    impossible: bool = False
    stopped: bool = False
    reasons: tuple[str, ...] = ()


class Planner:
    """Looks for a mission that reaches a goal."""

    def __init__(self, aim: Aim, deadline: Deadline, tell: Tell) -> None:
        self._aim = aim
        self._deadline = deadline
        self._tell = tell
        self._search: Search | None = None
        self._stopped = False
        with _file(EMPTY) as path:
            subject = Subject.read(path, tell)
        self._start = _states_of(aim.start, subject.skillsets)
        self._subject = _begun_in(subject, self._start)
        self._purposes = Purposes(self._subject.skillsets, self._subject.brought, subject.robot.robots)
        wrong = [one for one in aim.using if one not in self._purposes.known]
        if wrong:
            raise RepairError(f"--using {wrong[0]}: there is no such skill; there are {', '.join(sorted(self._purposes.known))}")
        roles = {role for one in self._purposes.known.values() if one.achieves for role in one.roles}
        self._role = aim.goal if aim.goal in roles else ""
        if aim.goal.isidentifier() and not self._role:
            raise RepairError(
                f"--goal '{aim.goal}': no skill fills this role by its success; there are {', '.join(sorted(roles)) or 'none'}"
            )
        self._wanted: Wanted | None = None if self._role else ("", condition_of("--goal", aim.goal))
        if self._wanted is not None:
            _check_names("--goal", aim.goal, self._wanted[1], self._subject.skillsets)
        self._courses = Courses(self._purposes, aim.using)
        sources = Sources(self._subject.files, self._subject.mission.palette, self._subject.vocabulary(), asks=True)
        self._composer = Composer(sources, self._courses)

    def stop(self) -> None:
        """Have the search end with the best that it has found; a signal's handler may call it."""
        self._stopped = True
        self._deadline.at_s = 0.0
        if self._search is not None:
            self._search.stop()

    def run(self) -> Answer:
        """Search; raises AlulaError where the robot can't be looked at."""
        states = initial_states(self._subject.skillsets, self._subject.at_first)
        if self._wanted is not None and Here(states).fulfils(self._wanted):
            raise RepairError(f"--goal '{self._aim.goal}': it is so at first; say what is so by --from")
        tried = 0
        with suppress(OutOfTimeError):  # the search ends at once then
            self._can_be_asked()
        for course in islice(self._courses.to(states, self._reaches), MOST_COURSES):
            tried += 1
            names = ", ".join(one.name for one in course.steps)
            try:
                plan = self._proved(course)
            except OutOfTimeError:
                return Answer(None, tried, stopped=True)
            if isinstance(plan, Plan):
                self._tell(f"{names}: proved, {plan.nodes} nodes")
                return Answer(self._repaired(plan), tried, stopped=self._stopped)
            self._tell(f"{names}: no: {plan}")
        return Answer(None, tried, impossible=not tried, reasons=() if tried else tuple(self._why(states)))

    def _can_be_asked(self) -> None:
        """Raise RepairError where what must never be names what the robot has not."""
        if self._aim.never:
            with _file(EMPTY) as path:
                subject = self._of(path)
                document = subject.document()
                with_property(document.root, subject.files.main, f"asked: never {self._aim.never}")
                self._judge(subject).refuse_unread(document.text(), "--never", self._aim.never)

    def _reaches(self, course: Course) -> bool:
        if self._role:
            return self._role in course.steps[-1].roles
        return self._wanted is not None and course.heres[-1].fulfils(self._wanted)

    def _why(self, states: States) -> Iterator[str]:
        """Yield what keeps each skill from starting at first."""
        yield f"no course of skills leads to {self._aim.goal}, though nothing fails"
        here = Here(states)
        for purpose in self._purposes.known.values():
            unmet = [one for one in purpose.skill.preconditions if not here.fulfils((purpose.skillset.name, one.condition))]
            missing = [one.name for one in purpose.skill.needs if not self._courses.providers(here, one.name, purpose)]
            if purpose.achieves and (unmet or missing):
                yield f"{purpose.name} can't start at first: {', '.join([*(one.name for one in unmet), *missing])}"

    # --- a course -----------------------------------------------------------------------------------------------------

    def _proved(self, course: Course) -> Plan | str:
        """Return the mission of a course, or why it is none."""
        text, nodes = self._text(course)
        if not text:
            return "an input comes from nowhere"
        if nodes > MOST_NODES:
            return f"it has {nodes} nodes"
        with _file(text) as path:
            subject = self._of(path)
            judge = self._judge(subject)
            for also in (False, True):
                found = judge.check(text, also=also)
                bad = next((one for one in found.findings if one.severity is not Severity.NOTE), None)
                if bad is not None:
                    return bad.message
                if not found.complete:
                    return "not all its runs were looked at"
            fate = judge.fate(text, ())
        steps = tuple(one.name for one in course.steps)
        return Plan(text, steps, nodes) if fate.survives else "it may not be accomplished though nothing fails"

    def _text(self, course: Course) -> tuple[str, int]:
        """Return the file of a course, and how many nodes it has."""
        steps = self._composer.after_one_another(course, self._wanted, {}, {})
        if not steps:
            return "", 0
        words = [plain(one.name) for one in course.steps]
        name = "_and_".join("_".join(one.split()) for one in dict.fromkeys(words))
        work = steps[0] if len(steps) == 1 else node("Sequence", *steps, name=" and ".join(words))
        rest = self._rest(course)
        end = node("AlwaysFailure", name="given up")
        if rest:
            stopping = node("Script", name="stopping", code="@stopping := true")
            stop = node("SubTree", ID="stop_here", name="stop here", _autoremap="true")
            give_up = node("Sequence", node("NoteReason", name="note why"), stopping, stop, name="give up")
            end = node("ForceFailure", give_up, name="the mission fails")
        top = node("Fallback", work, end, name=f"{name.replace('_', ' ')}, or give up")
        if self._aim.never:
            top.set("_description", f"property asked_never: never {self._aim.never}")
        nodes = sum(1 for _ in top.iterate())
        trees = {name: top}
        if rest:
            trees["stop_here"] = rest[0] if len(rest) == 1 else node("Sequence", *rest, name="come to rest")
        needs = list(self._needs(course))
        if needs:
            trees["ready"] = node("Sequence", *needs)
        why = [f"{one.name}{_role_words(one)}" for one in course.steps]
        return _file_text(name, trees, f"For {self._aim.goal}: {', then '.join(why)}.", _ports(trees[name])), nodes

    def _rest(self, course: Course) -> list[Element]:
        """Return what brings the robot to rest from anywhere in the course; nothing where it is at rest all the time."""
        robots = self._subject.at_rest

        def is_safe(here: Here) -> bool:
            return all(any(here.states.get(name) == state for name, state in safe) for safe in robots)

        moving = [one for one in course.heres if not is_safe(one)]
        for here in moving[:1]:
            found = self._courses.to(here.states, lambda other: is_safe(other.heres[-1]))
            for way in islice(found, 1):
                return self._composer.after_one_another(way, None, {}, {})
        return []

    def _needs(self, course: Course) -> Iterator[Element]:
        """Yield what the course needs of the functional layer that none of its skills brings about."""
        asked: dict[tuple[str, str], str] = {}
        for number, step in enumerate(course.steps):
            here = course.heres[number]
            beside = [one for role in step.skill.needs for one in self._courses.providers(here, role.name, step)[:1]]
            for one in (step, *beside):
                for resource, state in asked_of_others(one):
                    name = f"{one.skillset.name}.{resource.name}"
                    if course.heres[0].states[name] == state:
                        asked.setdefault((name, state), one.name)
        for (name, state), skill in asked.items():
            otherwise = f"'{plain(skill)} needs {name} to be {state}' .. reason('{name}')"
            yield node("Needs", name=told_state(name, state), if_=f"{name} == {state}", otherwise=otherwise)

    # --- its faults ---------------------------------------------------------------------------------------------------

    def _repaired(self, plan: Plan) -> Plan:
        """Return the plan with a branch for each fault that can be survived, as far as time goes, and what becomes of it by each."""
        fates: dict[str, Fate] = {}
        names = sorted(self._subject.faults)
        different = {(one.states, one.ends, one.later): name for name, one in sorted(self._subject.faults.items(), reverse=True)}
        with suppress(OutOfTimeError):
            for fault in sorted(different.values()):
                plan = self._repaired_for(fault, plan)
            with _file(plan.text) as path:
                judge = self._judge(self._of(path))
                fate_of = judge.fates(plan.text)
                for fault in names:
                    fate = fate_of((fault,), None)
                    if fate is not None:
                        fates[fault] = fate
        return replace(plan, fates=fates, left_out=tuple(one for one in names if one not in fates))

    def _repaired_for(self, fault: str, plan: Plan) -> Plan:
        self._deadline.check()
        with _file(plan.text) as path:
            aim, left = self._aim, MOST_NODES - plan.nodes
            question = Question(fault, using=aim.using, most_faults=aim.most_faults, reached=self._goal, most_nodes=left, others=False)
            self._search = Search(self._of(path), question, self._deadline, self._tell)
            try:
                repair = self._search.run().repair
            except RepairError:
                return plan  # no skill of it ends by this fault
        if repair is None:
            return plan
        return replace(plan, text=repair.text, nodes=plan.nodes + repair.branch.size + repair.branch.wraps)

    @property
    def _goal(self) -> Expression | None:
        return None if self._wanted is None else self._wanted[1]

    def _judge(self, subject: Subject) -> Judge:
        return Judge(subject, self._deadline, strikes=self._aim.most_faults, reached=self._goal)

    def _of(self, path: Path) -> Subject:
        return _begun_in(Subject.read(path, self._tell), self._start)


# --- parts --------------------------------------------------------------------------------------------------------------


@contextmanager
def _file(text: str) -> Iterator[Path]:
    """Give the path of a file with a text, as long as the context lasts."""
    with tempfile.TemporaryDirectory(prefix="alula-plan-") as folder:
        path = Path(folder) / "plan.xml"
        path.write_text(text, encoding="utf-8")
        yield path


def _states_of(condition: str, skillsets: Sequence[Skillset]) -> dict[str, str]:
    """Return the states that a condition asks for; raises RepairError where it asks for anything else."""
    if not condition:
        return {}
    read = condition_of("--from", condition)
    _check_names("--from", condition, read, skillsets)
    several = read.operands if isinstance(read, And) else (read,)
    states: dict[str, str] = {}
    for one in several:
        if not isinstance(one, ResourceIs) or one.negated:
            raise RepairError(f"--from '{condition}': write states, as skillset.resource == STATE, with `and` between them")
        if states.setdefault(one.resource, one.state) != one.state:
            raise RepairError(f"--from '{condition}': {one.resource} can't be {states[one.resource]} and {one.state}; name one state")
    return states


def _check_names(option: str, text: str, condition: Expression, skillsets: Sequence[Skillset]) -> None:
    known = {f"{of.name}.{one.name}": one.states for of in skillsets for one in of.resources}
    for atom in atoms(condition):
        if not isinstance(atom, ResourceIs):
            raise RepairError(f"{option} '{text}': only states can be asked here, as skillset.resource == STATE")
        if atom.resource not in known:
            raise RepairError(f"{option} '{text}': there is no resource {atom.resource}; there are {', '.join(sorted(known))}")
        if atom.state not in known[atom.resource]:
            raise RepairError(f"{option} '{text}': {atom.resource} has no state {atom.state}; it has {', '.join(known[atom.resource])}")


def _begun_in(subject: Subject, states: States) -> Subject:
    """Return a robot that is in these states at first."""

    def begun(of: Skillset) -> Skillset:
        several = tuple(replace(one, initial=states.get(f"{of.name}.{one.name}", one.initial)) for one in of.resources)
        return replace(of, resources=several)

    skillsets = tuple(map(begun, subject.skillsets))
    at_first = frozenset(one for one in subject.at_first if one[0] not in states)
    return replace(subject, mission=subject.mission.with_models(skillsets), at_first=at_first)


def _ports(top: Element) -> list[str]:
    """Return the entries that leaves of a tree read and none of its own writes."""
    found: dict[str, None] = {}
    for one in top.iterate():
        if "." in type_name(one):
            entries = (pointer(attribute.value, name) for name, attribute in one.attributes.items() if name != "name")
            found |= {entry: None for entry in entries if entry}
    return list(found)


def _file_text(name: str, trees: dict[str, Element], why: str, ports: Sequence[str]) -> str:
    lines = ['<root BTCPP_format="4" main_tree_to_execute="' + name + '">', f"  <!-- {why} -->"]
    for tree, top in trees.items():
        lines += [f"  {one}" for one in tree_lines(tree, top)] + [""]
    if ports:
        model = [f'      <input_port name="{one}"/>' for one in ports]
        lines += ["  <TreeNodesModel>", f'    <SubTree ID="{name}">', *model, "    </SubTree>", "  </TreeNodesModel>"]
    elif not lines[-1]:
        lines.pop()
    return "\n".join([*lines, "</root>"]) + "\n"


def _role_words(purpose: Purpose) -> str:
    needs = [one.name for one in purpose.skill.needs]
    return f" with {' and '.join(needs)}" if needs else ""
