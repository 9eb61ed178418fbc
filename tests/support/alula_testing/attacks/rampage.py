"""Clients that do anything at any time, hooks that misbehave at random, managers that are killed: in virtual time, by a seed.

``python -m alula_testing.attacks.rampage [ROUNDS] [SEED]`` prints what was found, as JSON.
"""

from __future__ import annotations

import json
import random
import sys
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula_testing.misbehaviours import MISBEHAVIOURS, Misbehaviour
from alula_testing.navigation import FLYING
from skill_runtime.core import Execution
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.handle import SkillHandle
from skill_runtime.hooks import SkillHooks
from skill_runtime.local import LocalManagers, LocalWorld

CLIENTS = 8
TAME = Misbehaviour("", lambda _: None)
CALLS: Mapping[str, Mapping[str, object]] = {
    "goto": {"target": (1, 2, 3), "speed": 1},
    "goto_straight": {"target": (1, 2, 3), "speed": 1},
    "hover": {"duration": 1},
    "rotate_head": {"heading": 1, "rate": 0.5},
}
"""Not the takeoff: its violation keeps the axes, as in the paper."""


class RandomHooks(SkillHooks):
    """Each execution misbehaves in a way of its own, in one hook; every other one ends by itself."""

    def __init__(self, inputs_type: type, managers: LocalManagers, chance: random.Random) -> None:
        self.inputs_type = inputs_type  # type: ignore[misc]  # a class variable where hooks are written by hand
        self._managers = managers
        self._chance = chance
        self._next = TAME
        self._of: dict[str, Misbehaviour] = {}

    def validate(self, inputs: object) -> str:
        """Choose the misbehaviour."""
        self._next = self._chance.choice([TAME, self._chance.choice(list(MISBEHAVIOURS.values()))])
        answer: str = self._next.act(inputs) if self._next.hook == "validate" else ""
        return answer

    def on_dispatch(self, execution: Execution) -> None:
        """Start."""
        self._of[execution.id] = self._next
        if self._chance.random() < 0.5:
            self._managers.after(self._chance.uniform(0.0, 2.0), lambda: execution.terminate("DONE"))
        self._do("on_dispatch", execution)

    def progress(self, execution: Execution) -> float:
        """Tell of some progress."""
        answer: float = self._do("progress", execution, self._chance.random())
        return answer

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Stop, at once or not; never, perhaps."""
        answer: bool | None = self._do("on_interrupt", execution, self._chance.choice([None, False]))
        return answer

    def on_pause(self, execution: Execution) -> str | None:
        """Rest."""
        answer: str | None = self._do("on_pause", execution, "")
        return answer

    def on_resume(self, execution: Execution) -> str | None:
        """Go on."""
        answer: str | None = self._do("on_resume", execution, "")
        return answer

    def on_violation(self, execution: Execution) -> None:
        """Stop."""
        self._do("on_violation", execution)

    def on_failure(self, execution: Execution) -> None:
        """Stop."""
        self._do("on_failure", execution)

    def _do(self, hook: str, execution: Execution, otherwise: object = None) -> Any:
        misbehaviour = self._of.get(execution.id, TAME)
        return misbehaviour.act(execution) if misbehaviour.hook == hook else otherwise


class Rampage:
    """One world, eight clients, and what became of everything that they asked for."""

    def __init__(self, seed: int) -> None:
        self._chance = random.Random(seed)  # noqa: S311 - the same seed makes the same run
        self._world = LocalWorld(latency_s=0.01)
        self._managers = self._serve()
        self._clients = [self._world.client(SKILLSET.name) for _ in range(CLIENTS)]
        self._handles: list[SkillHandle] = []
        self._answers: list[Any] = []
        self._ends: Counter[str] = Counter()
        self._errors: list[str] = []
        self._kills = 0
        self._clients[0].on_event(self._hear)
        self._world.run_for(1.0)

    def run(self, rounds: int) -> dict[str, Any]:
        """Do so many things, end everything, and return what is wrong (empty lists: nothing) and how much there was."""
        moves: list[Callable[[], None]] = [self._start] * 8 + [self._interrupt] * 3 + [self._pause] * 2 + [self._transition] * 2
        for number in range(rounds):
            self._chance.choice(moves)()
            if number % 500 == 499:
                self._kill()
            self._world.run_for(self._chance.choice([0.0, 0.0, 0.3]))
        for handle in self._handles:
            handle.interrupt()
        self._world.run_for(30.0)
        self._errors += self._managers.errors
        return {
            "open": [str(handle) for handle in self._handles if not handle.done],
            "ended twice": [execution for execution, times in self._ends.items() if times > 1],
            "running on": [str(execution) for execution in self._managers.engine.executions],
            "unanswered": sum(not answer.done for answer in self._answers),
            "not told": [error for error in self._errors if "listener" in error],
            "held": {name: status.state for name, status in self._managers.engine.resources.items() if status.state == "USED"},
            "executions": len(self._handles),
            "outcomes": dict(sorted(Counter(handle.outcome for handle in self._handles).items())),
            "kills": self._kills,
        }

    def _serve(self) -> LocalManagers:
        make = lambda managers: {n: RandomHooks(h.inputs_type, managers, self._chance) for n, h in ABSTRACT_HOOKS.items()}  # noqa: E731
        managers = self._world.serve(SKILLSET, make)
        for resource, state in FLYING.items():
            managers.transition(resource, state)
        return managers

    def _hear(self, event: EngineEvent) -> None:
        if isinstance(event, ExecutionEvent) and event.state.terminal:
            self._ends[event.id] += 1

    def _start(self) -> None:
        skill = self._chance.choice(list(CALLS))
        self._handles.append(self._chance.choice(self._clients).start(skill, **CALLS[skill]))

    def _interrupt(self) -> None:
        if self._handles:
            self._chance.choice(self._handles[-CLIENTS:]).interrupt()

    def _pause(self) -> None:
        if self._handles:
            handle = self._chance.choice(self._handles[-CLIENTS:])
            self._answers.append(self._chance.choice([handle.pause, handle.resume])())

    def _transition(self) -> None:
        state = self._chance.choice(["AVAILABLE", "AVAILABLE", "UNAVAILABLE"])
        self._answers.append(self._chance.choice(self._clients).transition("SDK_authority", state))

    def _kill(self) -> None:
        self._errors += self._managers.errors
        self._world.kill(SKILLSET.name)
        self._kills += 1
        self._world.run_for(self._chance.uniform(0.0, 2.0))
        self._managers = self._serve()
        self._world.run_for(1.0)


def main() -> None:
    """Run for a while."""
    rounds, seed = (int(word) for word in (*sys.argv[1:], "10000", "0")[:2])
    sys.stdout.write(json.dumps(Rampage(seed).run(rounds), indent=1) + "\n")


if __name__ == "__main__":
    main()
