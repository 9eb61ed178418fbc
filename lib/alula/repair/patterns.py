"""Branches that a person might write for what failed, the smallest first.

- A subtree of the files that nothing uses.
- What the mission does to come to rest.
- What failed once more, where a fault is no more than its bad end.
- What failed, with skills that stand for those that can't run: their inputs are the same, what they need is asked before, and what the
  others held besides is held beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from itertools import islice, product

from alula.missions.mission_file import READY, STOP_HERE
from alula.missions.palette import palette_of
from alula.missions.skill_types import OUTCOME_PORT, type_of
from alula.model.conditions import NO_DATA, judge
from alula.model.model import Parameter
from alula.model.units import told_unit
from alula.prove.mission.accepted import DESCRIPTION
from alula.prove.mission.system import System
from alula.repair.branches import FALLBACKS, Branch, clone, node, parent_of
from alula.repair.fates import MOST_FAULTS
from alula.repair.naming import Renaming, another, assigned, plain
from alula.repair.purposes import Purpose, Purposes, asked_of_others, broken_by
from alula.repair.subject import Subject, texts_of
from alula.trees.document import Element
from alula.trees.node import Node, pointer
from alula.trees.palette import Direction, Palette
from alula.trees.reading import is_port, node_name, type_name
from alula.trees.values import ANY

MOST_NODES = 15
AGAIN_S = "1"
"""How long after a failure a node gets its other chance, seconds."""
RETRIES = frozenset({"RetryAfter", "RetryUntilSuccessful"})
BEYOND = frozenset({READY, STOP_HERE})
"""Trees that the mission uses though no tree does."""


@dataclass(frozen=True)
class Failing:
    """What is to be answered: a leaf, and the states with which its skill can't run (``skillset.resource``, state).

    ``results`` are those by which the fault ends it.
    """

    leaf: Node
    skill: str
    states: tuple[tuple[str, str], ...] = ()
    fault: str = ""
    results: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """Return it as comments say it."""
        by = f" by the fault {self.fault}" if self.fault else ""
        return f"{self.skill} ('{self.leaf.name}') fails{by}"


def failing_by(fault: str, subject: Subject, system: System) -> list[Failing]:
    """Return the leaves of the mission's main tree that a fault ends, each once for each place in the files."""
    effects = subject.faults[fault]
    states = [tuple(one.rsplit(" ", 1)) for one in sorted(effects.states)]
    found: dict[int, Failing] = {}
    for leaf in system.leaves:
        name = f"{leaf.skillset}.{leaf.model.name}"
        mine = tuple((at.partition(".")[2], state) for at, state in states if at.partition(".")[0] == leaf.skillset)
        broken = tuple((at, state) for at, state in mine if broken_by(leaf.model, at, state))
        results = tuple(one.name for one in leaf.model.results if any(fnmatchcase(f"{name} {one.name}", end) for end in effects.ends))
        if (broken or results) and leaf in system.trees[0].nodes:
            full = tuple((f"{leaf.skillset}.{at}", state) for at, state in broken)
            found.setdefault(id(leaf.wiring.element), Failing(leaf, name, full, fault, results))
    return list(found.values())


class Patterns:
    """Makes branches for what failed."""

    def __init__(self, subject: Subject, using: Sequence[str] = (), most_faults: int = MOST_FAULTS) -> None:
        self._subject = subject
        self._most_faults = most_faults
        self._purposes = Purposes(subject.skillsets)
        self._using = set(using)
        self._palette: Palette = palette_of(subject.files, subject.skillsets, subject.part)
        self._texts = texts_of(subject.files.documents[0].root)
        self._trees = subject.files.trees

    def branches(self, failing: Failing, within: str = "") -> list[Branch]:
        """Return them, the smallest first; of those of one size, what is nearest to the leaf; all stand ``within`` a node of that name."""
        places = list(self.places(failing.leaf))
        if within:
            places = places[: next((number for number, one in enumerate(places) if one.name == within), len(places))]
        found = [one for place in places for one in self._at(place, failing)]
        unique = {(one.as_xml(), one.use.get("ID"), str(one.at)): one for one in found if one.size <= MOST_NODES}
        return sorted(unique.values(), key=lambda one: one.size + one.wraps)

    def all_stand_ins(self, failing: Failing) -> list[Purpose]:
        """Return the skills for the same purpose, that skill itself first, whether or not they can run."""
        found = [self._purposes.known[failing.skill], *self._purposes.alike(failing.skill)]
        return [one for one in found if one.name == failing.skill or not self._using or one.name in self._using]

    def places(self, leaf: Node) -> Iterator[Node]:
        """Yield the nodes of the mission's own file that a branch may stand beside, from the leaf up."""
        at: Node | None = leaf
        while at is not None:
            if at.wiring.element.place.path == self._subject.files.path and at.wiring.element.tag != "BehaviorTree":
                yield at
            at = at.parent

    def _at(self, place: Node, failing: Failing) -> Iterator[Branch]:
        yield from self._again(place, failing)
        for one in (*self._unused(place, failing), *self._coming_to_rest(place, failing), *self._standing_in(place, failing)):
            yield replace(one, wraps=not _in_fallback(place))

    # --- once more -----------------------------------------------------------------------------------------------------

    def _again(self, place: Node, failing: Failing) -> Iterator[Branch]:
        """Yield the node in a RetryAfter, with one chance more than faults may come; there are no more in one that is there."""
        if failing.states or place.wiring.element.tag in RETRIES:
            return
        element, attempts = place.wiring.element, str(self._most_faults + 1)
        name = f"{node_name(element)} again"
        condition = self._worth_it(place, failing)
        if condition:
            again = node("RetryAfter", name=name, attempts=attempts, wait=AGAIN_S, if_=condition)
        else:
            again = node("RetryUntilSuccessful", name=name, num_attempts=attempts)
        yield Branch(again, None, element.place, (f"When {failing.words}: it gets another chance.",), around=True)

    def _worth_it(self, place: Node, failing: Failing) -> str:
        """Return when another chance is worth it: it has ended as the fault ends it, or what it needs is there; empty: always."""
        entry = pointer(failing.leaf.wiring.element.get(OUTCOME_PORT), OUTCOME_PORT)
        if entry and place is failing.leaf:
            return " || ".join(f"{entry} == '{one}'" for one in failing.results)
        purpose = self._purposes.known[failing.skill]
        needed = asked_of_others(purpose)
        return " && ".join(f"{purpose.skillset.name}.{resource.name} == {state}" for resource, state in needed)

    # --- what is there -----------------------------------------------------------------------------------------------

    def _unused(self, place: Node, failing: Failing) -> Iterator[Branch]:
        used = {one.get("ID") for name in self._trees for one in self._subject.files.uses(name)}
        for name in self._trees:
            if name not in used and name not in BEYOND and name != self._subject.files.main:
                use = node("SubTree", ID=name, name=plain(name), _autoremap="true")
                yield Branch(use, None, place.wiring.element.place, (f"When {failing.words}.",))

    def _coming_to_rest(self, place: Node, failing: Failing) -> Iterator[Branch]:
        if STOP_HERE not in self._trees or not (place.parent is None or (place.parent.parent is None and _in_fallback(place))):
            return
        name = another("give_up", self._trees)
        stop = node("SubTree", ID=STOP_HERE, name=plain(STOP_HERE), _autoremap="true")
        stopping = node("Script", name="stopping", code="@stopping := true")
        give_up = node("Sequence", node("NoteReason", name="note why"), stopping, stop, name="give up")
        top = node("ForceFailure", give_up, name="the mission fails")
        why = (f"When {failing.words}, and nothing else is left to be done: the mission comes to rest and is given up.",)
        yield Branch(node("SubTree", ID=name, name="given up", _autoremap="true"), top, place.wiring.element.place, why)

    # --- stand-ins ---------------------------------------------------------------------------------------------------

    def _standing_in(self, place: Node, failing: Failing) -> Iterator[Branch]:
        element = place.wiring.element
        tree = self._trees.get(element.get("ID")) if element.tag == "SubTree" else None
        top = element if tree is None else tree.children[0]
        mine = failing.leaf.wiring.element.place
        if not any(one.place == mine for one in top.iterate()):
            return
        others = dict.fromkeys(type_name(one) for one in top.iterate() if type_name(one) in self._purposes.known)
        choices = [(one, [None, *self._stand_ins(one, ())]) for one in others if one != failing.skill]
        for stand_in in self._stand_ins(failing.skill, failing.states):
            several = product(*(options for _, options in choices))
            for chosen in sorted(several, key=lambda one: sum(option is not None for option in one)):
                instead = {failing.skill: stand_in}
                instead |= {name: other for (name, _), other in zip(choices, chosen, strict=True) if other is not None}
                yield from self._with(top, place, instead, failing)

    def _stand_ins(self, skill: str, states: Sequence[tuple[str, str]]) -> list[Purpose]:
        found = self._purposes.stand_ins(skill)
        broken = [one for one in found for at, state in states if _is_broken(one, at, state)]
        return [one for one in found if one not in broken and (not self._using or one.name in self._using)]

    def _with(self, top: Element, place: Node, instead: Mapping[str, Purpose], failing: Failing) -> Iterator[Branch]:
        """Yield a branch with these skills instead of others; what has to be held is brought about first, where a skill does that."""
        held = {name: self._purposes.holders(self._purposes.known[name], one) for name, one in instead.items()}
        if any(one is None for one in held.values()):
            return
        holders = [holder for several in held.values() for holder in several or ()]
        making = _Making(self._subject, self._palette, self._purposes, self._texts)
        several = (making.made(top, instead, held, bringing=one) for one in ((True, False) if holders else (False,)))
        yield from (self._as_branch(one, place, instead, failing) for one in islice((one for one in several if one is not None), 1))

    def _as_branch(self, made: _Made, at: Node, instead: Mapping[str, Purpose], failing: Failing) -> Branch:
        place = at.wiring.element
        renaming = Renaming(failing.skill.rpartition(".")[2], instead[failing.skill].skill.name, self._texts)
        guard = self._guard(made.top, failing)
        degraded = node("Script", name="degraded", code="@degraded := true")
        name = renaming.name(node_name(place))
        top = node("Sequence", degraded, made.top, name=name if name != node_name(made.top) else f"{name}, degraded")
        if guard:
            top.set("_failureIf", guard)
        tree_name = renaming.identifier(place.get("ID")) if place.tag == "SubTree" else "_".join(name.lower().split())
        tree_name = another("".join(sign for sign in tree_name if sign.isalnum() or sign == "_"), self._trees)
        use = node("SubTree", ID=tree_name, name=name, _autoremap="true")
        why = (f"When {failing.words}, {made.why[0]}", *made.why[1:])
        return Branch(use, top, place.place, why)

    def _guard(self, top: Element, failing: Failing) -> str:
        """Return when the branch is not for it: what its skills need and only the functional layer gives is not there, or was lost."""
        terms: dict[str, None] = {}
        for one in top.iterate():
            purpose = self._purposes.known.get(type_name(one))
            for resource, state in asked_of_others(purpose) if purpose else ():
                watching = self._watching(purpose, resource.name) if purpose else []
                if watching:
                    terms[f"{purpose.skillset.name}.{resource.name} != {state}"] = None  # type: ignore[union-attr]  # it has one
                    terms |= {f"failed('{name}')": None for name in watching if self._was_there(name, failing)}
        return " || ".join(terms)

    @staticmethod
    def _watching(purpose: Purpose, resource: str) -> list[str]:
        """Return the invariants of a skill that a state of a resource breaks."""
        states = purpose.skillset.resource(resource).states
        return [
            one.name
            for one in purpose.skill.invariants
            if any(judge(one.condition, {resource: state}, NO_DATA) is False for state in states)
        ]

    def _was_there(self, invariant: str, failing: Failing) -> bool:
        """Tell whether a leaf beside the failing one can end by an invariant: then something else failed, which is not answered here."""
        place = failing.leaf.parent
        leaves = [one for one in (place.iterate() if place is not None else ()) if type_name(one.wiring.element) in self._purposes.known]
        names = {type_name(one.wiring.element) for one in leaves} - {failing.skill}
        return any(invariant == one.name for name in names for one in self._purposes.known[name].skill.invariants)


@dataclass(frozen=True)
class _Made:
    top: Element
    why: tuple[str, ...]


class _Making:
    """Makes a copy of a part of a tree with other skills."""

    def __init__(self, subject: Subject, palette: Palette, purposes: Purposes, texts: Sequence[str]) -> None:
        self._subject = subject
        self._palette = palette
        self._purposes = purposes
        self._texts = texts

    def made(
        self, original: Element, instead: Mapping[str, Purpose], held: Mapping[str, list[Purpose] | None], *, bringing: bool
    ) -> _Made | None:
        top = node("Top", clone(original))
        leaves: list[Element] = []
        why: list[str] = []
        for name, purpose in instead.items():
            renaming = Renaming(name.rpartition(".")[2], purpose.skill.name, self._texts)
            for one in [one for one in top.iterate() if type_name(one) == name]:
                one.tag = purpose.name
                leaves.append(one)
            why.append(f"{purpose.name} stands for {name}{_as_it_needs(purpose)}.")
            for one in list(top.iterate()):
                _rename(one, renaming, name, purpose.name)
        for name, purpose in instead.items():
            for holder in held[name] or ():
                for leaf in [one for one in leaves if one.tag == purpose.name]:
                    added = self._hold(top, leaf, holder, bringing=bringing)
                    if added is None:
                        return None
                    leaves += added
                (resource,) = holder.holds
                why.append(f"{holder.name} holds {resource} meanwhile, as {name} did.")
                brought = self._purposes.bringers(holder)[:1] if bringing else []
                why += [f"{one.name} comes before it: what is held is brought about first." for one in brought]
        names = assigned([(one.tag, node_name(one)) for one in leaves], self._subject.names_asked())
        for number, name in names.items():
            leaves[number].set("name", name)
        return _Made(top.children[0], tuple(why))

    def _hold(self, top: Element, leaf: Element, holder: Purpose, *, bringing: bool) -> list[Element] | None:
        """Have a skill hold something while a leaf runs; return the leaves that are new, None where their inputs come from nowhere."""
        child, sequence = leaf, parent_of(top, leaf)
        while sequence.tag not in {"Sequence", "Top"}:
            child, sequence = sequence, parent_of(top, sequence)
        if sequence.tag == "Top":
            child = leaf
            sequence = parent_of(top, leaf)
        held = self._leaf(top, holder, {})
        if held is None:
            return None
        new = [held]
        first: list[Element] = []
        if bringing:
            bringers = self._purposes.bringers(holder)
            known = {name: held.get(name) for name in holder.inputs}
            first = [one for purpose in bringers[:1] if (one := self._leaf(top, purpose, known)) is not None]
            if not first or sequence.tag != "Sequence":
                return None
            new += first
        place = sequence.content.index(child)
        before = sequence.content[place - 1] if place else ""
        asked = f"running({holder.name})"
        if isinstance(before, Element) and before.tag == "WaitFor":
            sequence.content.remove(before)
            asked, place = f"{asked} && {before.get('if')}", place - 1
        wait = node("WaitFor", name=f"{plain(holder.name)} runs", if_=asked)
        within = node("Sequence", wait, child, name=f"{node_name(child)}, held")
        parallel = node("Parallel", held, within, name=f"{node_name(leaf)} with {plain(holder.name)}", success_count="1", failure_count="1")
        sequence.content[place : place + 1] = [*first, parallel]
        return new

    def _leaf(self, top: Element, purpose: Purpose, known: Mapping[str, str]) -> Element | None:
        values = {one.name: known.get(one.name) or self._binding(top, purpose, one) for one in purpose.skill.inputs}
        if any(value is None and not one.default for one, value in zip(purpose.skill.inputs, values.values(), strict=True)):
            return None
        made = node(purpose.name, name=plain(purpose.name))
        for name, value in values.items():
            if value is not None:
                made.set(name, value)
        return made

    def _binding(self, top: Element, purpose: Purpose, parameter: Parameter) -> str | None:
        """Return where an input comes from: as another leaf of the skill has it, a parameter of that name, what the part writes itself."""
        trees = self._subject.files.trees.values()
        same = [one.get(parameter.name) for tree in trees for one in tree.iterate() if type_name(one) == purpose.name]
        if any(same):
            return next(one for one in same if one)
        model = self._subject.files.models.get(self._subject.files.main)
        ports = [] if model is None else [one.name for one in model.ports.values() if one.direction is Direction.INPUT]
        named = [one for one in ports if parameter.name in one.split("_")]
        return f"{{{named[0]}}}" if named else self._written(top, parameter)

    def _written(self, top: Element, parameter: Parameter) -> str | None:
        kind, unit = type_of(parameter.type), told_unit(parameter.comment)
        found: list[str] = []
        for one in top.iterate():
            known = self._palette.get(type_name(one))
            for port in known.ports.values() if known else ():
                alike = port.type.name == kind.name and port.type is not ANY and port.unit == unit
                entry = pointer(one.get(port.name), port.name)
                if port.direction is Direction.OUTPUT and alike and entry:
                    found.append(f"{{{entry}}}")
        return found[0] if found else None


def _in_fallback(place: Node) -> bool:
    return place.parent is not None and place.parent.wiring.element.tag in FALLBACKS


def _is_broken(purpose: Purpose, at: str, state: str) -> bool:
    skillset, _, resource = at.partition(".")
    return purpose.skillset.name == skillset and broken_by(purpose.skill, resource, state) is not None


def _as_it_needs(purpose: Purpose) -> str:
    needs = [f"{purpose.skillset.name}.{resource.name} == {state}" for resource, state in asked_of_others(purpose)]
    return f": it needs {', '.join(needs)}" if needs else ""


def _rename(element: Element, renaming: Renaming, old: str, new: str) -> None:
    """Have an element of a copy name the other skill."""
    for name, attribute in element.attributes.items():
        if name == "name":
            element.set(name, renaming.name(attribute.value))
        elif name == DESCRIPTION:
            element.set(name, "")
        elif old in attribute.value and not (is_port(name) and attribute.value.startswith("{")):
            element.set(name, attribute.value.replace(old, new))
