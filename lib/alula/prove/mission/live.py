"""Which entries of the blackboards still decide something: an entry that is always written before it is read has no value to keep.

Looked at from the end of a node to its begin, as compilers look for live variables: what is read after each of its ends, without what
it has surely written by then, with what it reads itself. Where a node's own code says too little, all that stands below it is read.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from alula.missions.skill_types import OUTCOME_PORT
from alula.missions.skills import SkillNode
from alula.prove.mission.ahead import RUNS, Looking
from alula.prove.mission.reading import ANOTHER, OUTCOME
from alula.trees.access import Key, named_entries, scripts_of, written_entries
from alula.trees.node import Node
from alula.trees.nodes.subtree import SubTree
from alula.trees.status import FAILURE, SKIPPED, SUCCESS, Answer
from alula.trees.ticking import AGAIN, Begin, Order, Ticking
from alula.trees.tree import Tree

Place: TypeAlias = "Key | tuple[int, str]"
"""An entry, or what scripts may ask of the execution of a leaf, by its number."""
Read = tuple[Place, frozenset[str] | None]
"""An entry with texts of which it is only asked whether it is one of them; None: by its value."""
Reads = frozenset[Read]
NOTHING: Reads = frozenset()
Values = Mapping[int, Mapping[str, Hashable]]
"""The status and the attributes of nodes, by their numbers."""


class Ends(NamedTuple):
    """What is read after each of a node's ends."""

    success: Reads
    failure: Reads
    skipped: Reads
    halted: Reads

    @property
    def any(self) -> Reads:
        """After whichever."""
        return self.success | self.failure | self.skipped | self.halted


@dataclass(frozen=True)
class Live:
    """The entries of the blackboards that still decide something.

    ``texts``: what is asked of one is only whether it is among each of these texts; None where its value counts.
    """

    texts: Mapping[Place, frozenset[frozenset[str]] | None]

    @classmethod
    def of(cls, reads: Reads) -> Live:
        """Return what is read, by entry."""
        found: dict[Place, frozenset[frozenset[str]] | None] = {}
        for place, texts in reads:
            known = found.get(place, frozenset())
            found[place] = None if texts is None or known is None else known | {texts}
        return cls(found)

    def text(self, place: Place, value: str) -> str:
        """Return the first of the texts that no condition distinguishes from a value; ANOTHER where no condition tests for it."""
        asked = self.texts[place]
        if asked is None:
            return value
        alike = frozenset.union(*asked)
        for one in asked:
            alike = alike & one if value in one else alike - one
        return min(alike) if value in alike else ANOTHER


class Liveness:
    """Computes the live entries of a mission from the state of its trees."""

    def __init__(self, trees: Sequence[Tree], looking: Looking) -> None:
        self._looking = looking
        self._roots = [tree.root for tree in trees]
        self._nodes = [node for tree in trees for node in tree.nodes]
        self._number = {id(node): number for number, node in enumerate(self._nodes)}
        self._unread = looking.read.unread
        self._accesses = looking.read.accesses
        self._leaves: dict[str, list[int]] = {}
        self._leaf_of: dict[int, int] = {}
        for leaf, one in enumerate(one for one in self._nodes if isinstance(one, SkillNode)):
            self._leaves.setdefault(one.config.type.name, []).append(leaf)
            self._leaf_of[id(one)] = leaf
        self._below = [self._all_read(node) for node in self._nodes]
        self._begun: dict[tuple[int, Ends], Reads] = {}
        outcome: Reads = frozenset((_place(tree.root, name), None) for tree in trees for name in OUTCOME)
        self._always = outcome.union(*(self._kept_always(node) for node in self._nodes))
        self._stop = NOTHING.union(*(self._begin(root, self._at_end) for root in self._roots[1:]))
        self._whole = any(node.takes_away for node in self._nodes)  # an entry may be another one's from then on

    @property
    def _at_end(self) -> Ends:
        return Ends(self._always, self._always, self._always, self._always)

    def live(self, phase: str, *, stops: bool, values: Values) -> Live | None:
        """Return what is live in a director's phase, None where anything may be; arguments as of ``Looking.ahead``."""
        if phase == "_wait" or self._whole:
            return None
        if phase == "_settle":
            return Live.of(self._always)
        if stops:
            return Live.of(self._always.union(*(self._at(root, self._at_end, values) for root in self._roots[1:])))
        after = self._always | self._stop  # the tree may break off at any node
        return Live.of(after | self._at(self._roots[0], Ends(after, after, after, after), values))

    # --- a node that begins ----------------------------------------------------------------------------------------------

    def _begin(self, node: Node, ends: Ends) -> Reads:
        """Return what is live before a node that begins."""
        key = (self._number[id(node)], ends)
        if key not in self._begun:
            after = self._after(node, ends)
            found = self._below[key[0]] | ends.any if self._hidden(node) else self._body(node, after)
            before = node.before
            for script, end in ((before.failure_if, after.failure), (before.success_if, after.success)) if before is not None else ():
                found |= end if script is not None else NOTHING
            self._begun[key] = found | self._asked(node, "_failureIf", "_successIf")
        return self._begun[key]

    def _body(self, node: Node, ends: Ends) -> Reads:
        ticking = self._ticking(node)
        if not node.children:
            return self._leaf(node, ends)
        found = self._ports(node)
        if ticking.order is Order.IN_TURN:
            begins = [reads for _, reads in self._in_turn(node, ends, 0, lambda _, child, after: self._begin(child, after))]
            return found.union(*begins) if ticking.keeps_place else found | begins[0]
        if ticking.order is Order.AT_ONCE:
            written: frozenset[Place] = frozenset()
            for child in node.children:
                found |= _without(self._begin(child, _whichever(ends.any)), written)
                written |= self._at_once(child)
            return found
        return found | self._before_child(node, ends, self._again(node, ends))

    def _in_turn(self, node: Node, ends: Ends, first: int, look: Callable[[int, Node, Ends], Reads]) -> list[tuple[int, Reads]]:
        """Return what is live before each child from one on."""
        ticking = self._ticking(node)
        until_failure = ticking.goes_on is SUCCESS
        following, stop = (ends.success, ends.failure) if until_failure else (ends.failure, ends.success)
        skipped = following | ends.skipped
        found: list[tuple[int, Reads]] = []
        for index in range(len(node.children) - 1, first - 1, -1):
            both = (following, stop) if until_failure else (stop, following)
            following = look(index, node.children[index], Ends(*both, skipped, ends.halted))
            if ticking.gives_way:
                following |= ends.halted
            skipped = following
            found.insert(0, (index, following))
        return found

    def _before_child(self, node: Node, ends: Ends, again: Reads) -> Reads:
        """Return what is live where the turn of an only child comes, with what is live before the child."""
        ticking = self._ticking(node)
        if ticking.begins is Begin.PERHAPS:
            return again | ends.any | self._asked(node, *node.config.type.scripts)
        if ticking.rounds and not _at_least_once(node.config.ports.get(ticking.rounds, "")):
            return again | ends.any  # perhaps the child is not ticked at all
        return again | ends.halted if ticking.begins is Begin.LATER else again

    def _again(self, node: Node, ends: Ends) -> Reads:
        """Return what is live before an only child, which may begin again and again."""
        found = NOTHING
        while True:
            more = self._begin(node.children[0], self._of_child(node, ends, found)) | found
            if more == found:
                return found
            found = more

    def _of_child(self, node: Node, ends: Ends, again: Reads) -> Ends:
        """Return what is live after an only child."""
        ticking = self._ticking(node)
        own = {SUCCESS: ends.success, FAILURE: ends.failure, SKIPPED: ends.skipped}
        again |= ends.halted | self._ports(node) | self._asked(node, *node.config.type.scripts)

        def after(end: Answer) -> Reads:
            return NOTHING.union(*(again if step is AGAIN else own[step] for step in ticking.follows(end)))

        return Ends(after(SUCCESS), after(FAILURE), after(SKIPPED), ends.halted.union(*(own[end] for end in ticking.cuts_off)))

    def _leaf(self, node: Node, ends: Ends, *, begins: bool = True) -> Reads:
        if node.runs_script:
            return self._script(node, node.runs_script, ends.success)
        own = node.config.type.name in self._unread
        reads = NOTHING if own else self._ports(node) | self._asked(node, *node.config.type.scripts)
        written = self._written(node) if own else frozenset()
        halted = frozenset({self._outcome(node)}) if isinstance(node, SkillNode) else frozenset()
        found = reads | _without(ends.success | ends.failure, written)
        found |= _without(ends.halted, halted) if own or node.may_run is not False else NOTHING
        return _without(found, self._at_once(node)) if isinstance(node, SkillNode) and begins else found

    def _at_once(self, node: Node) -> frozenset[Place]:
        """Return what a node writes as soon as it begins, before anything else is ticked."""
        before = node.before
        if self._hidden(node) or (before is not None and (before.failure_if is not None or before.success_if is not None)):
            return frozenset()
        if isinstance(node, SkillNode):
            return frozenset({leaf_place(self._leaf_of[id(node)])})
        ticking = self._ticking(node)
        begins = bool(node.children) and ticking.begins_with_first() and not ticking.rounds
        return self._at_once(node.children[0]) if begins else frozenset()

    # --- a node that runs ------------------------------------------------------------------------------------------------

    def _at(self, node: Node, ends: Ends, values: Values) -> Reads:
        """Return what is live at a node between two ticks."""
        number = self._number[id(node)]
        mine, ticking = values[number], self._ticking(node)
        if mine["status"] != RUNS:
            return self._begin(node, ends)
        ends = self._after(node, ends)
        if self._hidden(node):
            return self._below[number] | ends.any
        if not node.children:
            return self._leaf(node, ends, begins=False)
        found = self._ports(node)
        if ticking.order is Order.IN_TURN:
            place = mine[ticking.place]
            index = place if isinstance(place, int) else 0

            def look(at: int, child: Node, after: Ends) -> Reads:
                return self._at(child, after, values) if at == index else self._begin(child, after)

            ways = self._in_turn(node, ends, 0 if ticking.keeps_place else index, look)
            return found.union(*(reads for _, reads in ways)) if ticking.keeps_place else found | ways[0][1]
        if ticking.order is Order.AT_ONCE:
            left = list(self._left(node, values))
            after = _whichever(_without(ends.any, frozenset().union(*(self._surely(child, values) for child in left))))
            return found.union(*(self._at(child, after, values) for child in left))
        again = self._again(node, ends)
        child = node.children[0]
        if values[self._number[id(child)]]["status"] != RUNS:
            return found | self._before_child(node, ends, again) | ends.halted
        return found | self._at(child, self._of_child(node, ends, again), values)

    def _left(self, node: Node, values: Values) -> Iterator[Node]:
        """Yield the children of a Parallel that have not ended."""
        done = values[self._number[id(node)]][self._ticking(node).place]
        ended = done[1] if isinstance(done, tuple) else ()
        yield from (child for index, child in enumerate(node.children) if index not in ended)

    def _surely(self, node: Node, values: Values) -> frozenset[Place]:
        """Return what a node that runs writes before it ends, whether by itself or halted."""
        mine, ticking = values[self._number[id(node)]], self._ticking(node)
        if mine["status"] != RUNS or self._hidden(node):
            return frozenset()
        if isinstance(node, SkillNode):
            return frozenset({self._outcome(node)})
        if not node.children:
            return frozenset()
        if ticking.order is Order.AT_ONCE:
            return frozenset().union(*(self._surely(child, values) for child in self._left(node, values)))
        index = mine[ticking.place] if ticking.order is Order.IN_TURN else 0
        return self._surely(node.children[index], values) if isinstance(index, int) and index < len(node.children) else frozenset()

    # --- what a node reads and writes ------------------------------------------------------------------------------------

    def _hidden(self, node: Node) -> bool:
        """Return whether what is below a node may go on otherwise than is known here."""
        ticking = self._ticking(node)
        known = not node.children or ticking.tells_passed or ticking.order is Order.SINGLE
        return not known or self._looking.may_be_skipped(self._number[id(node)])

    def _ticking(self, node: Node) -> Ticking:
        return self._looking.ticking[self._number[id(node)]]

    def _after(self, node: Node, ends: Ends) -> Ends:
        """Return what is live after a node, before its postconditions."""
        always = [self._script(node, "_post", end) for end in (ends.success, ends.failure)]
        success = self._script(node, "_onSuccess", always[0])
        failure = self._script(node, "_onFailure", always[1])
        return Ends(success, failure, ends.skipped, ends.halted)

    def _kept_always(self, node: Node) -> Reads:
        """Return what may be read at any time: in a halt, or by nodes that ask how often an entry was written."""
        counted = self._ports(node) if node.watches else NOTHING
        return counted | self._asked(node, "_onHalted")

    def _all_read(self, node: Node) -> Reads:
        found = NOTHING
        for one in (node, *_below(node)):
            if one.config.type.name not in self._unread:
                found |= self._ports(one)
            for attribute in scripts_of(one.config.element, one.config.type):
                found |= self._script(one, attribute.name, NOTHING)
        return found

    def _ports(self, node: Node) -> Reads:
        names = () if isinstance(node, SubTree) else named_entries(node).values()
        return frozenset((_place(node, name), None) for name in names)

    def _asked(self, node: Node, *attributes: str) -> Reads:
        return NOTHING.union(*(self._script(node, one, NOTHING) for one in attributes))

    def _written(self, node: Node) -> frozenset[Place]:
        """Return what a leaf writes whenever it returns."""
        return frozenset(_place(node, name) for name in written_entries(node).values())

    @staticmethod
    def _outcome(node: Node) -> Place:
        name = named_entries(node).get(OUTCOME_PORT)
        return (-1, "") if name is None else _place(node, name)

    def _script(self, node: Node, attribute: str, after: Reads) -> Reads:
        """Return what is live before a script; what is no script reads nothing here (``Looking`` says that it may ask for anything)."""
        for one in reversed(self._accesses.in_script(node.config, attribute)):
            if not one.write:
                after |= {(one.key, one.among)}
            elif one.sure:
                after = _without(after, frozenset({one.key}))
        return after | self._executions(node, attribute)

    def _executions(self, node: Node, attribute: str) -> Reads:
        """Return the leaves whose executions a script asks for."""
        names = (name for call in self._accesses.calls(node.config, attribute) for name in call.named)
        return frozenset((leaf_place(leaf), None) for name in names for leaf in self._leaves.get(name, ()))


def _at_least_once(count: str) -> bool:
    """Return whether a port's text is a count with which the child is ticked; an entry may be any."""
    text = count.strip()
    return text == "-1" or (text.isdecimal() and int(text) > 0)


def leaf_place(leaf: int) -> Place:
    """Return the place that stands for the state of a leaf's execution in scripts."""
    return leaf, ""


def _place(node: Node, name: str) -> Place:
    return node.blackboard.where(name)


def _without(reads: Reads, places: frozenset[Place]) -> Reads:
    return frozenset(one for one in reads if one[0] not in places) if places else reads


def _whichever(reads: Reads) -> Ends:
    return Ends(reads, reads, reads, reads)


def _below(node: Node) -> Iterator[Node]:
    for child in node.children:
        yield child
        yield from _below(child)
