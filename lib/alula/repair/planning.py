"""Writes a whole mission for a goal, from nothing: the shortest course of skills, which is then repaired for each fault, and proved.

1. Courses to the goal are looked for (`Courses`), the shortest first.
2. Each becomes a tree: skills with what they need beside them, what the functional layer has to tell between them, and an end at rest.
3. The first one that `check` proves, and that is accomplished whenever nothing fails, is taken.
4. For each fault that it does not survive a branch is looked for, as in any other mission (`Search`).
"""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

from alula.language.errors import Severity
from alula.missions.mission_file import READY, STOP_HERE
from alula.model.expressions import TRUE, And, Expression, ResourceIs, atoms
from alula.model.model import Skillset
from alula.prove.limits import Deadline, OutOfTimeError
from alula.repair.branches import WIDTH, comment_lines, node, parent_of, tree_lines
from alula.repair.composing import Composer, Sources
from alula.repair.courses import Course, Courses, Here, States, Wanted, initial_states
from alula.repair.errors import RepairError
from alula.repair.fates import MOST_FAULTS, Fate
from alula.repair.judging import NOT_JUDGED, Judge, Refused
from alula.repair.naming import another, in_short, plain, told_state
from alula.repair.purposes import Purpose, Purposes, asked_of_others, broken_by
from alula.repair.repairing import Question, Search, Tell, condition_of
from alula.repair.subject import Subject, with_property
from alula.trees.attributes import type_name
from alula.trees.document import Element
from alula.trees.node import pointer

MOST_COURSES = 12
MOST_NODES = 15
LEFT = "ALU701"
"""The finding that a skill can't start any more once the mission has ended."""
NEVER = "ALU703"
"""The finding that a node is never ticked: what gives up where nothing fails."""
EMPTY = '<root BTCPP_format="4" main_tree_to_execute="plan"><BehaviorTree ID="plan"><AlwaysSuccess/></BehaviorTree></root>\n'


@dataclass(frozen=True)
class Aim:
    """A request for a plan.

    Attributes:
        goal: a condition, written as in properties of missions, or a role that a skill has to have filled; or several, with `then`
            between them, which are reached one after another.
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
class Stage:
    """A part of a goal: a role, or a condition (``role`` is empty)."""

    role: str = ""
    wanted: Wanted = ("", TRUE)

    def reached_by(self, course: Course) -> bool:
        """Return whether a course reaches it."""
        return self.role in course.steps[-1].roles if self.role else course.heres[-1].fulfils(self.wanted)


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
    """The result of a search: a plan, or none; ``impossible``: no course of skills leads to the goal, though nothing fails.

    ``refused``: the courses that were tried and are none.
    """

    plan: Plan | None
    tried: int
    impossible: bool = False
    stopped: bool = False
    reasons: tuple[str, ...] = ()
    refused: tuple[Refused, ...] = ()


class Planner:
    """Searches a mission that reaches a goal."""

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
        self._stages = [self._stage(one.strip()) for one in re.split(r"\bthen\b", aim.goal)]
        self._courses = Courses(self._purposes, aim.using)
        sources = Sources(self._subject.files, self._subject.mission.registry, self._subject.vocabulary(), asks=True)
        self._composer = Composer(sources, self._courses)

    def _stage(self, text: str) -> Stage:
        roles = {role for one in self._purposes.known.values() if one.achieves for role in one.roles}
        if text in roles:
            return Stage(text)
        if text.isidentifier():
            raise RepairError(f"--goal '{text}': no skill fills this role by its success; there are {', '.join(sorted(roles)) or 'none'}")
        wanted = condition_of("--goal", text)
        _check_names("--goal", text, wanted, self._subject.skillsets)
        return Stage(wanted=("", wanted))

    def stop(self) -> None:
        """End the search with the best result so far; a signal's handler may call it."""
        self._stopped = True
        self._deadline.at_s = 0.0
        if self._search is not None:
            self._search.stop()

    def run(self) -> Answer:
        """Search; raises AlulaError where the robot can't be read."""
        states = initial_states(self._subject.skillsets, self._subject.at_first)
        first = self._stages[0]
        if not first.role and Here(states).fulfils(first.wanted):
            raise RepairError(f"--goal '{self._aim.goal}': it is so at first; say what is so by --from")
        tried = 0
        refused: list[Refused] = []
        with suppress(OutOfTimeError):  # the search ends at once then
            self._can_be_asked()
        for course, ends in islice(self._through(Here(states), self._stages), MOST_COURSES):
            tried += 1
            names = ", ".join(one.name for one in course.steps)
            try:
                plan = self._proved(course, ends)
            except OutOfTimeError:
                return Answer(None, tried, stopped=True, refused=(*refused, Refused(names, NOT_JUDGED)))
            if isinstance(plan, Plan):
                self._tell(f"{names}: proved, {plan.nodes} nodes")
                return Answer(self._repaired(plan), tried, stopped=self._stopped, refused=tuple(refused))
            refused.append(Refused(names, plan))
            self._tell(f"{names}: no: {plan}")
        return Answer(None, tried, impossible=not tried, reasons=() if tried else tuple(self._why(states)), refused=tuple(refused))

    def _can_be_asked(self) -> None:
        """Raise RepairError where what must never be names what the robot has not."""
        if self._aim.never:
            with _file(EMPTY) as path:
                subject = self._of(path)
                document = subject.document()
                with_property(document.root, subject.files.main, f"asked: never {self._aim.never}")
                self._judge(subject).refuse_unread(document.text(), "--never", self._aim.never)

    def _through(self, here: Here, stages: Sequence[Stage]) -> Iterator[tuple[Course, tuple[int, ...]]]:
        """Yield courses to one part of the goal after another, and how many steps have come before each of these ends."""
        if not stages:
            yield Course((), (here,)), ()
            return
        so_already = not stages[0].role and here.fulfils(stages[0].wanted)
        for first in [Course((), (here,))] if so_already else self._courses.to(here, stages[0].reached_by):
            for rest, ends in self._through(first.heres[-1], stages[1:]):
                steps = len(first.steps)
                course = Course((*first.steps, *rest.steps), (*first.heres, *rest.heres[1:]))
                yield course, (steps, *(steps + one for one in ends))

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

    def _proved(self, course: Course, ends: Sequence[int]) -> Plan | str:
        """Return the mission of a course, or why it is none; ``ends``: after how many steps each part of the goal is reached."""
        text, nodes = self._text(course, ends)
        if not text:
            return "an input comes from nowhere"
        if nodes > MOST_NODES:
            return f"it has {nodes} nodes"
        with _file(text) as path:
            judge = self._judge(self._of(path))
            findings = judge.check(text).findings
            asked = [one for one in self._kept(course) if any(it.code == LEFT and _words(*one) in it.message for it in findings)]
            fails = not any(it.code == NEVER for it in findings)
            text, nodes = self._text(course, ends, asked, fails=fails)
            for found in judge.parts(text):
                bad = next((one for one in found.findings if one.severity is not Severity.NOTE), None)
                if bad is not None:
                    return bad.message
                if not found.complete:
                    return "not all its runs were looked at"
            fate = judge.fate(text, ())
        steps = tuple(one.name for one in course.steps)
        return Plan(text, steps, nodes) if fate.survives else "it may not be accomplished though nothing fails"

    def _text(
        self, course: Course, ends: Sequence[int], accepted: Sequence[tuple[str, str]] = (), *, fails: bool = True
    ) -> tuple[str, int]:
        """Return the file of a course, and how many nodes it has.

        Args:
            course: the skills.
            ends: after how many steps each part of the goal is reached.
            accepted: states that the goal asks for, which may be left.
            fails: whether its work may fail: then it needs an end.
        """
        wanted = {end: one.wanted for end, one in zip(ends, self._stages, strict=True) if not one.role}
        steps = self._composer.after_one_another(course, wanted, _inputs(course))
        if not steps:
            return "", 0
        words = in_short([plain(one.name) for one in course.steps])
        name = "_".join(re.findall(r"\w+", words))
        work = steps[0] if len(steps) == 1 else node("Sequence", *steps, name=words)
        rest = self._rest(course)
        end = node("AlwaysFailure", name="given up")
        if rest:
            stopping = node("Script", name="stopping", code="@stopping := true")
            stop = node("SubTree", ID=STOP_HERE, name="stop here", _autoremap="true")
            give_up = node("Sequence", node("NoteReason", name="note why"), stopping, stop, name="give up")
            end = node("ForceFailure", give_up, name="the mission fails")
        top = node("Fallback", work, end, name=f"{words}, or give up") if fails else work
        said = [f"accepted {LEFT} ({_words(*one)}): the goal asks for it" for one in accepted]
        said += [f"property asked_never: never {self._aim.never}"] if self._aim.never else []
        if said:
            top.set("_description", "; ".join(said))
        trees = {name: top} | _shared(top, course, name)
        nodes = sum(1 for tree in trees.values() for _ in tree.iterate())
        if rest:
            trees[STOP_HERE] = rest[0] if len(rest) == 1 else node("Sequence", *rest, name="come to rest")
        needs = list(self._needs(course))
        if needs:
            trees[READY] = node("Sequence", *needs)
        why = [f"{one.name}{_role_words(one)}" for one in course.steps]
        return _file_text(name, trees, f"For {self._aim.goal}: {', then '.join(why)}."), nodes

    def _kept(self, course: Course) -> list[tuple[str, str]]:
        """Return the states of the goal that a step of the course can't start in: the mission may end in what is asked for."""
        asked = [one for stage in self._stages for one in atoms(stage.wanted[1]) if isinstance(one, ResourceIs) and not one.negated]
        there = dict.fromkeys((one.resource, one.state) for one in asked)
        return [(at, state) for at, state in there if any(_is_kept_from(one, at, state) for one in course.steps)]

    def _rest(self, course: Course) -> list[Element]:
        """Return what brings the robot to rest from anywhere in the course; nothing where it is at rest all the time."""
        robots = self._subject.at_rest

        def is_safe(here: Here) -> bool:
            return all(any(here.states.get(name) == state for name, state in safe) for safe in robots)

        moving = [one for one in course.heres if not is_safe(one)]
        for here in moving[:1]:
            found = self._courses.to(here, lambda other: is_safe(other.heres[-1]))
            for way in islice(found, 1):
                return self._composer.after_one_another(way, {})
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
            for left, fault in zip(range(len(different), 0, -1), sorted(different.values()), strict=True):
                plan = self._repaired_for(fault, plan, self._deadline.left_s() / (left + 1))
            with _file(plan.text) as path:
                judge = self._judge(self._of(path))
                fate_of = judge.fates(plan.text)
                for fault in names:
                    fate = fate_of((fault,), None)
                    if fate is not None:
                        fates[fault] = fate
        return replace(plan, fates=fates, left_out=tuple(one for one in names if one not in fates))

    def _repaired_for(self, fault: str, plan: Plan, time_s: float) -> Plan:
        """Return the plan with a branch for a fault, if there is one in its share of the time."""
        self._deadline.check()
        with _file(plan.text) as path:
            aim, left = self._aim, MOST_NODES - plan.nodes
            question = Question(fault, using=aim.using, most_faults=aim.most_faults, reached=self._goal, most_nodes=left, others=False)
            self._search = Search(self._of(path), question, Deadline.after(time_s, self._tell), self._tell)
            try:
                repair = self._search.run().repair
            except (RepairError, OutOfTimeError):
                return plan  # no skill of it ends by this fault, or its time is over
        if repair is None:
            return plan
        return replace(plan, text=repair.text, nodes=plan.nodes + repair.branch.size + repair.branch.wraps)

    @property
    def _goal(self) -> Expression | None:
        last = self._stages[-1]
        return None if last.role else last.wanted[1]

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


def _inputs(course: Course) -> list[dict[str, str]]:
    """Return the mission's own inputs for those of each step: a skill that comes again has others, skills share those of a name."""
    found: list[dict[str, str]] = []
    for number, step in enumerate(course.steps):
        earlier = sum(one.name == step.name for one in course.steps[:number])
        end = f"_{earlier + 1}" if earlier else ""
        found.append({name: f"{{{name}{end}}}" for name in step.inputs})
    return found


def _shared(top: Element, course: Course, main: str) -> dict[str, Element]:
    """Put skills that come more than once into trees of their own, so that one branch answers for each use; return these trees."""
    names = Counter(one.name for one in course.steps)
    trees: dict[str, Element] = {}
    for step in {one.name: one for one in course.steps if names[one.name] > 1}.values():
        tree = another(step.skill.name, [main, STOP_HERE, READY, *trees])
        trees[tree] = node(step.name, name=plain(step.name), **{given: f"{{{given}}}" for given in step.inputs})
        for leaf in [one for one in top.iterate() if type_name(one) == step.name]:
            above = parent_of(top, leaf)
            use = node("SubTree", ID=tree, **{one.name: one.value for one in leaf.attributes.values()})
            above.content[above.content.index(leaf)] = use
    return trees


def _words(at: str, state: str) -> str:
    return f"{at} == {state}"


def _is_kept_from(purpose: Purpose, at: str, state: str) -> bool:
    skillset, _, resource = at.partition(".")
    return purpose.skillset.name == skillset and broken_by(purpose.skill, resource, state) is not None


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
        if "." in type_name(one) or one.tag == "SubTree":
            entries = (pointer(attribute.value, name) for name, attribute in one.attributes.items() if name not in {"name", "ID"})
            found |= {entry: None for entry in entries if entry}
    return list(found)


def _file_text(name: str, trees: dict[str, Element], why: str) -> str:
    lines = ['<root BTCPP_format="4" main_tree_to_execute="' + name + '">', *(f"  {one}" for one in comment_lines(why, WIDTH - 2))]
    for tree, top in trees.items():
        lines += [f"  {one}" for one in tree_lines(tree, top)] + [""]
    models = [(tree, ports) for tree, top in trees.items() if tree not in {STOP_HERE, READY} and (ports := _ports(top))]
    if models:
        lines.append("  <TreeNodesModel>")
        for tree, ports in models:
            lines += [f'    <SubTree ID="{tree}">', *(f'      <input_port name="{one}"/>' for one in ports), "    </SubTree>"]
        lines.append("  </TreeNodesModel>")
    elif not lines[-1]:
        lines.pop()
    return "\n".join([*lines, "</root>"]) + "\n"


def _role_words(purpose: Purpose) -> str:
    needs = [one.name for one in purpose.skill.needs]
    return f" with {' and '.join(needs)}" if needs else ""
