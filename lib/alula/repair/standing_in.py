"""Branches with other skills, which stand in for those that can't run."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, product

from alula.model.conditions import NO_DATA, judge
from alula.model.model import Resource
from alula.prove.mission.accepted import DESCRIPTION
from alula.repair.branches import Branch, clone, node, parent_of
from alula.repair.composing import Sources, first_skills, opening
from alula.repair.failing import Failing
from alula.repair.naming import Renaming, another, assigned, listed, plain, sentence, told_resource, told_state
from alula.repair.purposes import Purpose, Purposes, asked_of_others, broken_by, shows_done
from alula.repair.subject import Subject, texts_of
from alula.trees.attributes import is_port, node_name, type_name
from alula.trees.document import Element
from alula.trees.node import Node


class StandIns:
    """Makes branches with other skills of the same inputs: their needs are tested before, and the resources of the others are held."""

    def __init__(self, subject: Subject, purposes: Purposes, sources: Sources, using: Collection[str]) -> None:
        self._subject = subject
        self._purposes = purposes
        self._sources = sources
        self._using = using
        self._texts = texts_of(subject.files.documents[0].root)
        self._trees = subject.files.trees

    def beside(self, place: Node, failing: Failing) -> Iterator[Branch]:
        """Yield branches that may stand beside a node that contains the failure."""
        element = place.config.element
        tree = self._trees.get(element.get("ID")) if element.tag == "SubTree" else None
        top = element if tree is None else tree.children[0]
        mine = failing.leaf.config.element.place
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
        """Yield a branch with these skills instead of others; what has to be held is brought about first, where a skill does that.

        A second one leaves out what is done already, where a skill of it can't be started again then.
        """
        held = {name: self._purposes.holders(self._purposes.known[name], one) for name, one in instead.items()}
        if any(one is None for one in held.values()):
            return
        holders = [holder for several in held.values() for holder in several or ()]
        making = _Making(self._subject, self._sources, self._purposes, self._texts)
        for once in (False, True):
            several = (making.made(top, instead, held, bringing=one, once=once) for one in ((True, False) if holders else (False,)))
            fitting = (one for one in several if one is not None and self._has_what_it_needs(one.top, place, failing))
            yield from (self._as_branch(one, place, instead, failing) for one in islice(fitting, 1))

    def _has_what_it_needs(self, top: Element, place: Node, failing: Failing) -> bool:
        """Return whether each role that a skill needs is filled by another one, in the branch or beside it."""
        inside = {type_name(one) for one in top.iterate()} & set(self._purposes.known)
        beside = {name for name in _run_beside(place) if name != failing.skill} & set(self._purposes.known)
        filled = {(one.robot, role) for one in map(self._purposes.known.__getitem__, inside | beside) for role in one.roles}
        needing = [self._purposes.known[name] for name in inside]
        return all((one.robot, role.name) in filled for one in needing for role in one.skill.needs)

    def _as_branch(self, made: _Made, at: Node, instead: Mapping[str, Purpose], failing: Failing) -> Branch:
        place = at.config.element
        renaming = Renaming(failing.skill.rpartition(".")[2], instead[failing.skill].skill.name, self._texts)
        name, old = renaming.name(node_name(place)), node_name(place)
        if name == old:
            name = f"{self._sources.words.leaf(instead[failing.skill].name)} instead"
        elif name == node_name(made.top):
            name = f"{name} instead"
        top = node("Sequence", *opening(*self._guard(made.top, instead), "@degraded := true"), made.top, name=name)
        tree_name = renaming.identifier(place.get("ID"))
        if not tree_name or tree_name in self._trees:
            tree_name = "_".join(name.lower().split())
        tree_name = another("".join(sign for sign in tree_name if sign.isalnum() or sign == "_"), self._trees)
        use = node("SubTree", ID=tree_name, name=name, _autoremap="true")
        why = (f"{failing.situation}: {made.why[0]}", *made.why[1:])
        return Branch(use, top, place.place, why)

    def _guard(self, top: Element, instead: Mapping[str, Purpose]) -> tuple[str, str]:
        """Return when the branch is begun, and what that is called: what ends its skills is not so, and only others could change it.

        A branch of which one skill alone is started first asks nothing for that one, which is refused by itself.
        """
        first = first_skills(top, self._purposes.known)
        asked: dict[str, None] = {}
        skill = ""
        for one in top.iterate():
            purpose = self._purposes.known.get(type_name(one))
            if purpose is None or first == {purpose.name}:
                continue
            terms = [
                f"{purpose.skillset.name}.{resource.name} == {state}"
                for resource, state in asked_of_others(purpose)
                if _ends_it(purpose, resource)
            ]
            asked |= dict.fromkeys(terms)
            if terms and (not skill or purpose in instead.values()):
                skill = node_name(one)
        return " && ".join(asked), f"can {skill}"


def _run_beside(place: Node) -> Iterator[str]:
    """Yield the skills that run beside a node."""
    at = place
    while at.parent is not None:
        if at.parent.config.element.tag == "Parallel":
            yield from (type_name(one.config.element) for child in at.parent.children if child is not at for one in child.iterate())
        at = at.parent


@dataclass(frozen=True)
class _Made:
    top: Element
    why: tuple[str, ...]


class _Making:
    """Makes a copy of a part of a tree with other skills."""

    def __init__(self, subject: Subject, sources: Sources, purposes: Purposes, texts: Sequence[str]) -> None:
        self._subject = subject
        self._sources = sources
        self._purposes = purposes
        self._texts = texts
        self._parallels: list[tuple[Element, Element]] = []

    def made(
        self,
        original: Element,
        instead: Mapping[str, Purpose],
        held: Mapping[str, list[Purpose] | None],
        *,
        bringing: bool,
        once: bool,
    ) -> _Made | None:
        """Return the copy; None: nothing holds a resource that has to be held, or nothing of what is done ``once`` is in the part."""
        top = node("Top", clone(original))
        self._parallels = []
        leaves: list[Element] = []
        for name, purpose in instead.items():
            renaming = Renaming(name.rpartition(".")[2], purpose.skill.name, self._texts)
            for one in [one for one in top.iterate() if type_name(one) == name]:
                one.tag = purpose.name
                if renaming.name(node_name(one)) == node_name(one):
                    one.set("name", self._sources.words.leaf(purpose.name))
                leaves.append(one)
            for one in list(top.iterate()):
                _rename(one, renaming, name, purpose.name)
        for name, purpose in instead.items():
            for holder in held[name] or ():
                for leaf in [one for one in leaves if one.tag == purpose.name]:
                    added = self._hold(top, leaf, holder, bringing=bringing)
                    if added is None:
                        return None
                    leaves += added
        names = assigned([(one.tag, node_name(one)) for one in leaves], self._subject.names_asked())
        for number, name in names.items():
            leaves[number].set("name", name)
        why = [f"{listed(dict.fromkeys(node_name(one) for one in leaves if one.tag in {each.name for each in instead.values()}))}."]
        for parallel, leaf in self._parallels:
            (held_by,) = self._purposes.known[type_name(parallel.children[0])].holds
            parallel.set("name", f"{node_name(leaf)} with the {told_resource(held_by)} held")
            parallel.children[1].set("name", "once it is held")
            skill = sentence(plain(leaf.tag))
            why.append(f"{skill} leaves the {told_resource(held_by)} free: {node_name(parallel.children[0])} meanwhile.")
        if once and not self._unless_done(top):
            return None
        return _Made(top.children[0], (*dict.fromkeys(why), "What is done already is left out.") if once else tuple(dict.fromkeys(why)))

    def _unless_done(self, top: Element) -> bool:
        """Have what can't be started again once it is done left out then; tell whether there is anything of that kind."""
        found = False
        for leaf in [one for one in top.iterate() if type_name(one) in self._purposes.known]:
            purpose = self._purposes.known[type_name(leaf)]
            shown = shows_done(purpose)
            if shown is not None:
                found = True
                above = parent_of(top, leaf)
                done = node("ScriptCondition", name="done already", code=f"{purpose.skillset.name}.{shown[0]} == {shown[1]}")
                above.content[above.content.index(leaf)] = node("Fallback", done, leaf, name=f"{node_name(leaf)}, or go on")
        return found

    def _hold(self, top: Element, leaf: Element, holder: Purpose, *, bringing: bool) -> list[Element] | None:
        """Have a skill hold something while a leaf runs; return the leaves that are new, None where their inputs come from nowhere."""
        child, sequence = leaf, parent_of(top, leaf)
        while sequence.tag not in {"Sequence", "Top"}:
            child, sequence = sequence, parent_of(top, sequence)
        if sequence.tag == "Top":
            child = leaf
            sequence = parent_of(top, leaf)
        held = self._sources.leaf(holder, {}, top)
        if held is None:
            return None
        new = [held]
        first: list[Element] = []
        if bringing:
            bringers = self._purposes.bringers(holder)
            known = {name: held.get(name) for name in holder.inputs}
            first = [one for purpose in bringers[:1] if (one := self._sources.leaf(purpose, known, top)) is not None]
            if not first or sequence.tag != "Sequence":
                return None
            new += first
        place = sequence.content.index(child)
        before = sequence.content[place - 1] if place else ""
        asked = f"running({holder.name})"
        (resource, state), *_ = holder.holds.items()
        name = self._sources.words.wait(asked, told_state(resource, state))
        if isinstance(before, Element) and before.tag == "WaitFor":
            sequence.content.remove(before)
            asked, name, place = f"{asked} && {before.get('if')}", f"{name} and {node_name(before)}", place - 1
        wait = node("WaitFor", name=name, if_=asked)
        within = node("Sequence", wait, child, name="then")
        parallel = node("Parallel", held, within, name="meanwhile", success_count="1", failure_count="1")
        sequence.content[place : place + 1] = [*first, parallel]
        self._parallels.append((parallel, leaf))
        return new


def _ends_it(purpose: Purpose, resource: Resource) -> bool:
    """Return whether a skill has an invariant that a state of a resource breaks."""
    asked = (judge(one.condition, {resource.name: state}, NO_DATA) for one in purpose.skill.invariants for state in resource.states)
    return any(one is False for one in asked)


def _is_broken(purpose: Purpose, at: str, state: str) -> bool:
    skillset, _, resource = at.partition(".")
    return purpose.skillset.name == skillset and broken_by(purpose.skill, resource, state) is not None


def _rename(element: Element, renaming: Renaming, old: str, new: str) -> None:
    """Have an element of a copy name the other skill."""
    for name, attribute in element.attributes.items():
        if name == "name":
            element.set(name, renaming.name(attribute.value))
        elif name == DESCRIPTION:
            element.set(name, "")
        elif old in attribute.value and not (is_port(name) and attribute.value.startswith("{")):
            element.set(name, attribute.value.replace(old, new))
