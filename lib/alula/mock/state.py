"""The state that the skills of a mock robot share: memory, random numbers, states of resources."""

from __future__ import annotations

import random
import threading
from collections.abc import Callable, Mapping

from alula.mock.behaviour import Place, Value
from alula.mock.formula import Formula, FormulaError
from alula.mock.host import MockHost


class MockState:
    """Memory and resources of a mock robot.

    Args:
        memory: the values that formulas know by name, at the start.
        host: the middleware that serves the robot's skillsets.
        chance: what is drawn where no skill draws.
    """

    def __init__(self, memory: Mapping[str, object], host: MockHost, chance: random.Random) -> None:
        self.memory: dict[str, object] = dict(memory)
        self.lock = threading.RLock()
        self.host = host
        self._chance = chance
        self._moving: list[Callable[[], None]] = []
        """What brings the memory up to date, called with the lock held."""
        self._held: dict[Place, str] = {}
        """The states at which faults hold resources, whatever else is requested."""

    def take(self, states: Mapping[Place, str], reason: str = "") -> None:
        """Put resources into these states by extern transitions, each with this ``reason``."""
        for (skillset, resource), wanted in states.items():
            state = self._held.get((skillset, resource), wanted)
            if self.host.state(skillset, resource) == state:
                continue
            refusal = self.host.transition(skillset, resource, state, reason)
            if refusal:
                self.host.note(f"the mock can't have {skillset}.{resource} be {state}: {refusal}")

    def number(self, value: Value, names: Mapping[str, object], chance: random.Random | None = None) -> float:
        """Return a value that is a number; raise FormulaError when it is none."""
        result = self.value(value, names, chance)
        if isinstance(result, bool) or not isinstance(result, int | float):
            raise FormulaError(f"{value!r} is {result!r}, not a number")
        return float(result)

    def value(self, value: Value, names: Mapping[str, object], chance: random.Random | None = None) -> object:
        """Evaluate a value; ``names`` take precedence over the memory."""
        if isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, Formula):
            return value(names if value.names <= names.keys() else self._known(names), chance or self._chance)
        return value(self._known(names))

    def _known(self, names: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names over the current memory."""
        with self.lock:
            for move in self._moving:
                move()
            return {**self.memory, **names}
