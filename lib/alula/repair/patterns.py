"""Branches that a person might write for a failure: those with which the mission goes on first, then those that end it well, then others.

- What failed once more, where a fault is no more than its bad end, or once what it needs was brought about.
- A subtree of the files that nothing uses.
- What failed, with skills that stand for those that can't run (`standing_in`).
- Nothing, where a later step fills the role of what failed all the same, with other skillsets: another robot of a fleet.
- The place that the mission calls safe; rest, where the author calls the mission degraded then.
- What the mission does to come to rest, and giving up.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from alula.missions.mission_file import READY, STOP_HERE
from alula.missions.skill_types import OUTCOME_PORT
from alula.repair.branches import FALLBACKS, Branch, Rank, node
from alula.repair.composing import Sources
from alula.repair.courses import Courses, States
from alula.repair.failing import Failing
from alula.repair.fates import MOST_FAULTS
from alula.repair.naming import another, chances, often_when, plain
from alula.repair.purposes import Purpose, Purposes, asked_of_others
from alula.repair.remedies import AGAIN_S, Remedies
from alula.repair.standing_in import StandIns
from alula.repair.subject import Subject
from alula.trees.attributes import node_name, type_name
from alula.trees.document import Element
from alula.trees.node import Node, pointer

MOST_NODES = 15
RETRIES = frozenset({"RetryAfter", "RetryUntilSuccessful"})
BEYOND = frozenset({READY, STOP_HERE})
"""Trees that the mission uses though no tree does."""


class Patterns:
    """Makes branches for failures."""

    def __init__(self, subject: Subject, using: Sequence[str] = (), most_faults: int = MOST_FAULTS, most: int = MOST_NODES) -> None:
        self._subject = subject
        self._most_faults = most_faults
        self._most_nodes = most
        self._purposes = Purposes(subject.skillsets, subject.brought, subject.robot.robots)
        self._using = frozenset(using)
        self._trees = subject.files.trees
        sources = Sources(subject.files, subject.mission.registry, subject.vocabulary())
        self._stand_ins = StandIns(subject, self._purposes, sources, self._using)
        self._remedies = Remedies(subject, self._purposes, sources, Courses(self._purposes, self._using), most_faults + 1)

    def branches(self, failing: Failing, within: str = "", states: States | None = None) -> list[Branch]:
        """Return the branches, by rank, then size; of one size, the nearest to the leaf first; all stand ``within`` a node of that name.

        ``states``: those of the resources when it has failed.
        """
        places = list(self.places(failing.leaf))
        if within:
            places = places[: next((number for number, one in enumerate(places) if one.name == within), len(places))]
        then = {**(states or {}), **dict(reversed(failing.states))}
        found = [one for place in places for one in self._at(place, failing, then)]
        fitting = (one.within(self._most_nodes, shortest=self._most_nodes < MOST_NODES) for one in found)
        unique = {one.key: one for one in fitting if one is not None}
        return sorted(unique.values(), key=lambda one: one.order)

    def all_stand_ins(self, failing: Failing) -> list[Purpose]:
        """Return the skills with the same purpose, that skill itself first, whether or not they can run."""
        found = [self._purposes.known[failing.skill], *self._purposes.alike(failing.skill)]
        return [one for one in found if one.name == failing.skill or not self._using or one.name in self._using]

    @property
    def lacking(self) -> list[str]:
        """Return the skills left out of the branches made so far, as some of their inputs have no source."""
        words = "{} would bring about what is needed, but nothing says what its input {} is; use it in a tree of the mission"
        return [words.format(skill, " and ".join(f"`{one}`" for one in names)) for skill, names in self._remedies.lacking.items()]

    def asked_in(self, element: Element) -> Iterator[tuple[str, str]]:
        """Yield the states that the skills in a part require from the functional layer: ``skillset.resource`` and its state."""
        for purpose in (self._purposes.known.get(type_name(one)) for one in element.iterate()):
            for resource, state in asked_of_others(purpose) if purpose is not None else ():
                yield f"{purpose.skillset.name}.{resource.name}", state  # type: ignore[union-attr]  # it has one

    def may_leave_out(self, failing: Failing) -> bool:
        """Return whether the mission may go on without the failed leaf, as something else has the same purpose."""
        return any(True for place in self.places(failing.leaf) for _ in self._remedies.without(place, failing))

    def places(self, leaf: Node) -> Iterator[Node]:
        """Yield the nodes of the mission's own file that a branch may stand beside, from the leaf up."""
        at: Node | None = leaf
        while at is not None:
            if at.config.element.place.path == self._subject.files.path and at.config.element.tag != "BehaviorTree":
                yield at
            at = at.parent

    def _at(self, place: Node, failing: Failing, states: States) -> Iterator[Branch]:
        yield from list(self._remedies.around(place, failing, states)) or self._again(place, failing)
        beside = [*self._unused(place, failing), *self._stand_ins.beside(place, failing)]
        beside += self._remedies.other_ways(place, failing, states)
        beside += self._remedies.without(place, failing)
        if place.parent is None or (place.parent.parent is None and _in_fallback(place)):
            beside += self._remedies.at_the_safe_place(place, failing, states)
            beside += self._coming_to_rest(place, failing)
        for one in beside:
            yield replace(one, wraps=not _in_fallback(place))

    # --- once more -----------------------------------------------------------------------------------------------------

    def _again(self, place: Node, failing: Failing) -> Iterator[Branch]:
        """Yield the node in a RetryAfter, with one chance more than faults may come; there are no more in one that is there."""
        if failing.states or place.config.element.tag in RETRIES:
            return
        element, attempts = place.config.element, self._most_faults + 1
        condition, name = self._worth_it(place, failing, attempts)
        if condition:
            again = node("RetryAfter", name=name, attempts=str(attempts), wait=AGAIN_S, if_=condition)
        else:
            again = node("RetryUntilSuccessful", name=name, num_attempts=str(attempts))
        yield Branch(again, None, element.place, (f"{failing.situation}: it gets another chance.",), around=True)

    def _worth_it(self, place: Node, failing: Failing, attempts: int) -> tuple[str, str]:
        """Return when another chance is worth it, and what these are called.

        It is where it has ended as the fault ends it, or what it needs is there; empty: always.
        """
        entry = pointer(failing.leaf.config.element.get(OUTCOME_PORT), OUTCOME_PORT)
        if entry and place is failing.leaf:
            return " || ".join(f"{entry} == '{one}'" for one in failing.results), often_when(attempts, failing.results)
        purpose = self._purposes.known[failing.skill]
        needed = asked_of_others(purpose)
        condition = " && ".join(f"{purpose.skillset.name}.{resource.name} == {state}" for resource, state in needed)
        return condition, chances(attempts, node_name(place.config.element) if place is failing.leaf else "")

    # --- what is there -----------------------------------------------------------------------------------------------

    def _unused(self, place: Node, failing: Failing) -> Iterator[Branch]:
        used = {one.get("ID") for name in self._trees for one in self._subject.files.uses(name)}
        for name in self._trees:
            if name not in used and name not in BEYOND and name != self._subject.files.main:
                use = node("SubTree", ID=name, name=plain(name), _autoremap="true")
                yield Branch(use, None, place.config.element.place, (f"{failing.situation}.",))

    def _coming_to_rest(self, place: Node, failing: Failing) -> Iterator[Branch]:
        """Yield the end at rest, as a good one where the author calls the mission degraded once this has failed; and giving up."""
        if STOP_HERE not in self._trees:
            return
        stop = node("SubTree", ID=STOP_HERE, name=plain(STOP_HERE), _autoremap="true")
        if failing.degrades:
            failed = node("ScriptCondition", name=f"{failing.leaf.name} failed", code=f"failed_first({failing.skill})")
            stopping = node("Script", name="stopping", code="@stopping := true")
            top = node("Sequence", failed, stopping, stop, name=f"rest without {plain(failing.skill)}")
            why = (f"{failing.situation}: nothing more is done, the mission comes to rest, and is degraded.",)
            yield self._subtree(f"rest_without_{failing.skill.rpartition('.')[2]}", top, place, why, Rank.ENDS_WELL)
        stopping = node("Script", name="stopping", code="@stopping := true")
        give_up = node("Sequence", node("NoteReason", name="note why"), stopping, stop, name="give up")
        top = node("ForceFailure", give_up, name="the mission fails")
        why = (f"What nothing else answers ends here, as when {failing.reason}: come to rest, then give up.",)
        yield self._subtree("give_up", top, place, why, Rank.GIVES_UP, "given up")

    def _subtree(self, tree: str, top: Element, place: Node, why: tuple[str, ...], rank: Rank, name: str = "") -> Branch:
        use = node("SubTree", ID=another(tree, self._trees), name=name or plain(tree), _autoremap="true")
        return Branch(use, top, place.config.element.place, why, rank=rank)


def _in_fallback(place: Node) -> bool:
    return place.parent is not None and place.parent.config.element.tag in FALLBACKS
