"""How a type of node ticks its children: its class says it, and check, search and drawings read it there.

What a class does not say may be anything: of `Ticking()` each child may be ticked at any time, any number of times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import TypeAlias

from alula.common.public import public
from alula.trees.ends import NO_END, Ends, Given, stops_at
from alula.trees.status import FAILURE, SUCCESS, Answer, Status


@public("alula.trees")
class Order(Enum):
    """In which order, and how often, a node ticks its children."""

    ANY = "any"
    """Nobody knows."""
    SINGLE = "single"
    """Its only child, until it ends; perhaps again then."""
    IN_TURN = "in turn"
    """One after the other; the next tick goes on with the one that runs, and none that is passed is ticked again before the node ends."""
    FROM_ANY = "from any"
    """One after the other, the first one being any of them."""
    REACTIVE = "reactive"
    """One after the other, from the first in each tick; a child that runs has the others halted."""
    EACH_TICK = "each tick"
    """One after the other, from the first in each tick; several may run."""
    AT_ONCE = "at once"
    """All in each tick, but none that has ended before the node ends."""
    CHOSEN = "chosen"
    """The first until it ends; after its success the second, after its failure the third."""
    CHOSEN_EACH_TICK = "chosen each tick"
    """As chosen, but the first is ticked in each tick."""
    PICKED = "picked"
    """One of them, another one perhaps in the next tick."""
    TRIED = "tried"
    """All but the last in turn; the last when one has failed."""


_LISTED = frozenset({Order.IN_TURN, Order.FROM_ANY, Order.REACTIVE, Order.EACH_TICK})
_ONE_WAY = frozenset({Order.SINGLE, Order.IN_TURN, Order.CHOSEN, Order.TRIED})


@public("alula.trees")
class Begin(Enum):
    """When a node ticks its first child."""

    AT_ONCE = "at once"
    """In its own first tick."""
    LATER = "later"
    """It may run before."""
    PERHAPS = "perhaps"
    """It may run before, or end without."""


class Again(Enum):
    """A child is ticked once more after it has ended."""

    AGAIN = "again"


AGAIN = Again.AGAIN
Steps: TypeAlias = "frozenset[Answer | Again]"
"""What may follow the end of an only child: an end of the node, or the child once more."""


@public("alula.trees")
@dataclass(frozen=True)
class Ticking:
    """How a type of node ticks its children.

    Attributes:
        order: in which order, and how often.
        goes_on: the end of a child after which the next one's turn comes, of an order that ticks one after the other.
        place: the attribute that says which children are passed: IN_TURN the index of the one whose turn it is, AT_ONCE a set of the
            indices of those that have ended. Empty: the search of all runs takes each for one that may be ticked again.
        after: SINGLE: what may follow an end of the child, where it is more than the same end of the node.
        begins: when the first child is ticked.
        cuts_off: SINGLE: ends of the node by which it halts its child.
        rounds: SINGLE: the port that says how often the child is ticked at most; with 0 it may be not at all.
        gives_way: whether it may answer RUNNING between two children.
        keeps_place: IN_TURN: whether it begins with the child at which it was left.
        takes_failure: SINGLE: whether the child's failure is meant to come, though the node fails with it.
        succeeds_after, fails_after: AT_ONCE: the ports that say how many children have to succeed, or to fail; -1: all. Where no port says
            it, all have to succeed, and how many failures are too many is not known.
    """

    order: Order = Order.ANY
    goes_on: Status = SUCCESS
    place: str = ""
    after: Mapping[Answer, Steps] = field(default_factory=dict)
    begins: Begin = Begin.AT_ONCE
    cuts_off: Ends = NO_END
    rounds: str = ""
    gives_way: bool = False
    keeps_place: bool = False
    takes_failure: bool = False
    succeeds_after: str = ""
    fails_after: str = ""

    def follows(self, end: Answer) -> Steps:
        """Return what may follow an end of an only child."""
        return self.after.get(end, frozenset({end}))

    def ends(self, child: Ends) -> Ends:
        """Return how a node may end with its only child."""
        return frozenset(one for end in child for one in self.follows(end) if not isinstance(one, Again)) | self.cuts_off

    @property
    def repeats(self) -> bool:
        """Return whether an only child may be ticked again after it has ended."""
        return any(AGAIN in steps for steps in self.after.values())

    @property
    def tells_passed(self) -> bool:
        """Return whether `place` shows which children are not ticked again before the node ends."""
        if self.order is Order.SINGLE:
            return not self.repeats
        return self.order in {Order.IN_TURN, Order.AT_ONCE} and bool(self.place)

    @property
    def lists(self) -> bool:
        """Return whether it ticks its children from the first to the last, until one does not end with `goes_on`."""
        return self.order in _LISTED - {Order.FROM_ANY}

    def goes_back(self, count: int) -> bool:
        """Return whether, of ``count`` children, one may be ticked after a later one."""
        return count > 1 and self.order not in _ONE_WAY

    def begins_with_first(self) -> bool:
        """Return whether its first tick surely ticks the first child."""
        ordered = self.order in _LISTED | {Order.SINGLE, Order.AT_ONCE, Order.CHOSEN, Order.CHOSEN_EACH_TICK, Order.TRIED}
        return ordered and self.order is not Order.FROM_ANY and self.begins is Begin.AT_ONCE and not self.keeps_place

    def heeds_failure(self, place: int, count: int, given: Given) -> bool:
        """Return whether it may do anything but fail when the child at index ``place`` fails; True where that is not known."""
        match self.order:
            case Order.SINGLE:
                return self.takes_failure or self.follows(FAILURE) != {FAILURE}
            case Order.IN_TURN | Order.REACTIVE | Order.EACH_TICK:
                return self.goes_on is FAILURE and place + 1 < count
            case Order.FROM_ANY:
                return self.goes_on is FAILURE
            case Order.AT_ONCE:
                return not self.fails_after or (given(self.fails_after) or "1").strip() != "1"
            case Order.CHOSEN | Order.CHOSEN_EACH_TICK:
                return place == 0
            case Order.TRIED:
                return place + 1 < count
            case Order.PICKED:
                return False
            case Order.ANY:
                return True

    @property
    def figure(self) -> str:
        """The name of the node's symbol in the paper's figures; empty where it has none."""
        if self.order is Order.AT_ONCE:
            return "parallel"
        if self.order in _LISTED:
            return "sequence" if self.goes_on is SUCCESS else "selector"
        return ""


ANY_TICKING = Ticking()
"""That of a type of node of which nothing is known."""


def never_ticked(ticking: Ticking, children: Sequence[Ends]) -> Iterator[tuple[int, int]]:
    """Yield children that are never ticked, each with the child that does not end as it would have to; of several in a row the first."""
    if ticking.order in {Order.CHOSEN, Order.CHOSEN_EACH_TICK}:
        branches = ((1, SUCCESS), (2, FAILURE))
        yield from ((number, 0) for number, end in branches if number < len(children) and end not in children[0])
    elif ticking.lists:
        last = stops_at(children, ticking.goes_on)
        if last is not None and last + 1 < len(children):
            yield last + 1, last
