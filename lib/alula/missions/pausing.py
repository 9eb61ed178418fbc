"""A pause of the mission: the tree is not ticked, and what can hold holds."""

from __future__ import annotations

from functools import partial

from py_trees.behaviour import Behaviour

from alula.common.errors import AlulaError
from alula.missions.leaves import skill_leaf
from alula.runtime.handle import SkillHandle
from alula.runtime.waiting import Pending

TRIES = 3
AGAIN_S = 0.5
"""A skill that is just being started refuses; it is asked again after so long, mission clock."""


class PauseRefusedError(AlulaError):
    """The mission can't be paused, or can't go on, now; the message says why."""


class Pause:
    """Holds the executions that a tree has open; ``step`` is to be called as often as the tree was ticked.

    Not every skill can be paused: those that refuse go on to their end, so a climb ends at its height and a sensor stays on. What ends
    meanwhile the tree sees when it is ticked again.
    """

    def __init__(self, tree: Behaviour, now_s: float) -> None:
        leaves = [leaf for node in tree.iterate() if (leaf := skill_leaf(node)) is not None]
        self._holds = [_Hold(leaf.skill_name, leaf.handle, now_s) for leaf in leaves if leaf.handle is not None and not leaf.handle.done]
        self._told = ""

    def step(self, now_s: float) -> str:
        """Ask again those that refused; return what holds and what goes on, in words, when that has changed and all have answered."""
        for hold in self._holds:
            hold.step(now_s)
        words = self.words()
        if words == self._told or any(hold.asked for hold in self._holds):
            return ""
        self._told = words
        return words

    def words(self) -> str:
        """Return what holds and what goes on."""
        return "; ".join(hold.words() for hold in self._holds) or "No skill runs."

    def end(self) -> None:
        """Have all go on, also those whose answer got lost; what held and can't go on is interrupted, so that the tree sees its end."""
        for hold in self._holds:
            hold.end()


class _Hold:
    """One execution that is to hold."""

    def __init__(self, name: str, handle: SkillHandle, now_s: float) -> None:
        self._name = name
        self._handle = handle
        self._asked_s = now_s
        self._tries = 1
        self._answer = handle.pause()

    @property
    def asked(self) -> bool:
        """Return whether its answer is still to come, or it is to be asked again."""
        return not self._handle.done and (not self._answer.done or (self._refused and self._tries < TRIES))

    @property
    def _refused(self) -> bool:
        return self._answer.done and bool(self._answer.failure or self._answer.value)

    def step(self, now_s: float) -> None:
        if self._refused and not self._handle.done and self._tries < TRIES and now_s - self._asked_s >= AGAIN_S:
            self._tries, self._asked_s = self._tries + 1, now_s
            self._answer = self._handle.pause()

    def words(self) -> str:
        if self._handle.done:
            return f"{self._name} has ended"
        if not self._answer.done:
            return f"{self._name} is asked to hold"
        return f"{self._name} goes on ({self._answer.failure or self._answer.value})" if self._refused else f"{self._name} holds"

    def end(self) -> None:
        if self._handle.done:
            return
        answer = self._handle.resume()
        if not self._refused:
            answer.add_done_callback(partial(_went_on, self._handle))


def _went_on(handle: SkillHandle, answer: Pending[str]) -> None:
    """Interrupt what refuses to go on: it would stay as it is for ever. One that gives no answer may have gone on."""
    if not answer.failure and answer.value and not handle.done:
        handle.interrupt()
