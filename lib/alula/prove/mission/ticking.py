"""Ticks of a mission's tree by the engine's own nodes: each tick that differs is done once, and known from then on.

What a tick does hangs on the tree's memory, on what it observes, and on what nobody knows. Its questions and answers make a tree of
decisions; a situation that gives answers which are known already needs no tick.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from py_trees.behaviour import Behaviour

from alula.missions.director import Director
from alula.missions.mission_file import MissionTrees
from alula.prove.limits import Deadline
from alula.prove.mission.measured import of_data
from alula.prove.mission.memory import Body, Keeper, TreeMemory
from alula.prove.mission.oracle import Answer, Asked, Oracle, Question, UndecidedError, View
from alula.prove.mission.own import ANSWER, DOES
from alula.prove.mission.repeated import Effect, Repeated
from alula.prove.mission.unknown import COMPARE, MisfitError
from alula.trees.node import Node
from alula.trees.status import Status
from alula.trees.tree import Tree

TICK, ABORT = "tick", "abort"
CHOSEN_ANEW = frozenset({DOES, ANSWER, COMPARE})


class Outcome(NamedTuple):
    """The result of a tick: the number of the memory after it, its requests, and what was observed of the nodes."""

    memory: int
    started: tuple[int, ...]
    interrupted: tuple[int, ...]
    choices: tuple[Asked, ...]
    touched: frozenset[tuple[int, str]]


@dataclass
class Decision:
    """A question, and the next question or outcome for each answer; ``options`` are empty for an observation."""

    question: Question
    options: tuple[Answer, ...]
    next: dict[Answer, Decision | Outcome] = field(default_factory=dict)

    @property
    def in_breadth(self) -> bool:
        """Return whether few such choices come before many: a node that does one after another reaches most results in many ways."""
        return self.question[0] == DOES


class OneStop:
    """The mission with a single tree that brings the robot to rest: a mission is aborted once."""

    def __init__(self, mission: MissionTrees, stop: Tree | None) -> None:
        self._mission = mission
        self._stop = stop
        self.root = mission.root
        self.conditions = mission.conditions

    @property
    def degraded(self) -> bool:
        """Return whether the mission is degraded."""
        return self._mission.degraded

    @property
    def stopping(self) -> bool:
        """Return whether the mission is stopping."""
        return self._mission.stopping

    def stop_here(self) -> Behaviour:
        """Return the single tree that stops the robot; where the file has none, the halt is all."""
        return self._mission.stop_here() if self._stop is None else self._stop.root


class Ticker:
    """Ticks a mission from any of its memories, which it numbers."""

    def __init__(self, body: Body, oracle: Oracle) -> None:
        self._body = body
        self._oracle = oracle
        self._keeper = Keeper(body)
        self._repeated = Repeated(self._keeper)
        self.leaves = self._keeper.leaves
        self.nodes = body.nodes()
        self.memories: list[TreeMemory] = []
        self.runs = 0
        """How many ticks were done by the engine."""
        self.about_data: dict[Question, None] = {}
        """All that ticks have asked of data."""
        self._numbers: dict[TreeMemory, int] = {}
        self._known: dict[tuple[int, str], Decision | Outcome] = {}
        self._pausing: dict[int, bool] = {}
        self._touched: set[tuple[int, str]] = set()
        self._of = {id(node): number for number, node in enumerate(self.nodes)}
        self.deadline: Deadline | None = None
        """Looked at before each tick of a mission in which one tick can be so many that a look at each group of situations is too few."""
        self._inside: dict[Hashable, tuple[Answer, ...]] = {}
        """By what was so in the middle of a tick, the answers that first led to it."""
        self._doing: tuple[int, str] = (0, TICK)
        body.robot.come_again = self._come_again
        oracle.begin(lambda _: None)
        self.initial = self._number(self._keeper.take())

    def outcomes(self, memory: int, view: View, act: str = TICK) -> Iterator[Outcome]:
        """Yield all outcomes of a tick (or an abort) where observations are as ``view`` answers."""
        todo: deque[tuple[Answer, ...]] = deque([()])
        while todo:
            answers = todo.pop()
            known = self.known(memory, act, view, answers)
            while isinstance(known, Decision):
                if known.options:
                    later = ((*answers, option) for option in known.options[1:])
                    todo.extendleft(later) if known.in_breadth else todo.extend(later)
                    answers = (*answers, known.options[0])
                else:
                    answers = (*answers, view(known.question))
                known = known.next.get(answers[-1]) or self.known(memory, act, view, answers)
            yield known

    def may_pause(self, memory: int) -> bool:
        """Return whether a mission with this memory can be paused."""
        if memory not in self._pausing:
            self._oracle.begin(lambda _: None)
            self._keeper.put(self.memories[memory])
            self._pausing[memory] = not self._body.director.refusal(paused=True)
            self._keeper.leave()
        return self._pausing[memory]

    def known(self, memory: int, act: str, view: View, answers: Sequence[Answer]) -> Decision | Outcome:
        """Return the outcome or next question after the first answers of a tick; tick with ``view`` where it is not known yet."""
        found = self._at(memory, act, answers)
        if found is None:
            self._run(memory, act, view, answers)
            found = self._at(memory, act, answers)
        assert found is not None  # noqa: S101 - the tick was done with these answers
        return found

    def _at(self, memory: int, act: str, answers: Sequence[Answer]) -> Decision | Outcome | None:
        found = self._known.get((memory, act))
        for answer in answers:
            if not isinstance(found, Decision):
                return None
            found = found.next.get(answer)
        return found

    def _run(self, memory: int, act: str, view: View, answers: Sequence[Answer]) -> None:
        """Do a tick, and keep what it came to: as one that has read the same before, else by the engine."""
        if self.deadline is not None:
            self.deadline.check()
        before = self.memories[memory]
        known = self._repeated.find(before, act, view, answers)
        asked, effect = known or self._by_engine(memory, act, view, answers)
        after = self._number(self._repeated.after(before, effect) if known else effect.after)
        choices = tuple(one for one in asked if one.options)
        self.about_data.update(dict.fromkeys(one.question for one in of_data(choices)))
        self._keep(memory, act, asked, Outcome(after, effect.started, effect.interrupted, choices, effect.nodes))

    def _by_engine(self, memory: int, act: str, view: View, answers: Sequence[Answer]) -> tuple[list[Asked], Effect]:
        self.runs += 1
        self._doing = (memory, act)
        self._oracle.begin(view, answers)
        self._keeper.put(self.memories[memory])
        self._touched = set()
        self._watch()
        director = self._body.director
        if act == ABORT:
            director.abort("asked from outside")
        else:
            self._step(director)
        after = self._keeper.take()
        robot, asked = self._body.robot, self._oracle.asked
        effect = Effect(after, self._keeper.looked, tuple(robot.started), tuple(robot.interrupted), frozenset(self._touched))
        self._repeated.keep(self.memories[memory], act, asked, effect, self._keeper.touched)
        return asked, effect

    def _step(self, director: Director) -> None:
        """Do what the driver of a mission does: a tree that can't be ticked is left, and the robot brought to rest.

        Raises UndecidedError where the real value of something unknown might have been one that it can be ticked with, unless it was
        chosen to be none.
        """
        try:
            director.step()
        except UndecidedError:
            raise
        except Exception as error:
            if not _comes_of_misfit(error) and (self._keeper.unknown or self._body.robot.measurements.any):
                raise UndecidedError(str(error)) from error
            director.broken(f"the tree raised {type(error).__name__}: {error}")

    def _come_again(self, begin: int) -> bool:
        """Return whether all is as it was after other answers from the same question on: what follows from here follows from there, too."""
        self._keeper.touched.all()
        asked = self._oracle.asked
        # What is asked of leaves and unknown values is chosen anew each time; all else has one answer for the whole tick.
        lasting = frozenset((one.question, one.answer) for one in asked[begin:] if one.question[0] not in CHOSEN_ANEW)
        answers = tuple(one.answer for one in asked)
        key = (self._doing, begin, answers[:begin], self._keeper.inside(), lasting)
        return self._inside.setdefault(key, answers) != answers

    def _keep(self, memory: int, act: str, asked: Sequence[Asked], outcome: Outcome) -> None:
        if not asked:
            self._known[memory, act] = outcome
            return
        known = self._known.setdefault((memory, act), Decision(asked[0].question, asked[0].options))
        for number, one in enumerate(asked):
            assert isinstance(known, Decision)  # noqa: S101
            assert known.question == one.question, (known.question, one.question)  # noqa: S101 - a tick hangs on nothing else
            if number + 1 == len(asked):
                known.next[one.answer] = outcome
            else:
                following = asked[number + 1]
                known = known.next.setdefault(one.answer, Decision(following.question, following.options))

    def _watch(self) -> None:
        """Have only this watch the nodes: views of the tree are made of them elsewhere."""
        for tree in self._body.trees:
            watchers = tree.root.watchers
            watchers[:] = [self._changed]

    def _changed(self, node: Node, _previous: Status, status: Status) -> None:
        if status is not Status.INVALID and id(node) in self._of:
            self._touched.add((self._of[id(node)], status.value))

    def _number(self, memory: TreeMemory) -> int:
        number = self._numbers.setdefault(memory, len(self.memories))
        if number == len(self.memories):
            self.memories.append(memory)
        return number


def _comes_of_misfit(error: BaseException | None) -> bool:
    """Return whether an error, or what it was raised of, is that of a value which a port can't read."""
    return error is not None and (isinstance(error, MisfitError) or _comes_of_misfit(error.__context__))
