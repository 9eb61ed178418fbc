"""Clients that do anything at any time, hooks that misbehave at random, managers that are killed and frozen.

``python -m alula_testing.attacks.rampage [local|ros1|ros2] [--rounds N] [--kills N] [--freezes N] [--seed N]`` prints what was found,
as JSON, and ends with 1 when something is wrong. In virtual time the same seed makes the same run.
"""

from __future__ import annotations

import argparse
import json
import random
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.handle import SkillHandle
from alula_testing.attacks.stages import LiveStage, LocalStage, Stage
from alula_testing.attacks.worlds import WORLDS

CLIENTS = 8
END_S = 60.0
"""How long all that is asked to end may take; a hook that hangs twice and a stop that is never done take 12 s."""
FREEZE_S = (0.2, 6.0)
CALLS: Mapping[str, Mapping[str, object]] = {
    "goto": {"target": (1, 2, 3), "speed": 1},
    "goto_straight": {"target": (1, 2, 3), "speed": 1},
    "hover": {"duration": 1},
    "rotate_head": {"heading": 1, "rate": 0.5},
}
"""Not the takeoff: its violation keeps the axes, as in the paper."""
WRONG = ("open", "ended twice", "running on", "unanswered", "held", "not done", "died")


class Rampage:
    """One stage, its clients, and what became of everything that they asked for."""

    def __init__(self, stage: Stage, chance: random.Random) -> None:
        self._stage = stage
        self._chance = chance
        self._clients = stage.clients
        self._handles: list[SkillHandle] = []
        self._answers: list[Any] = []
        self._ends: Counter[str] = Counter()
        self._clients[0].on_event(self._hear)

    def run(self, rounds: int, *, kills: int = 0, freezes: int = 0) -> dict[str, Any]:
        """Do so many things, end everything, and return what is wrong (empty: nothing) and how much there was."""
        moves: list[Callable[[], None]] = [self._start] * 8 + [self._interrupt] * 3 + [self._pause] * 2 + [self._transition] * 2
        disasters = [self._stage.kill] * kills + [self._freeze] * freezes
        when = dict(zip(sorted(self._chance.sample(range(rounds), len(disasters))), self._shuffled(disasters), strict=True))
        for number in range(rounds):
            self._chance.choice(moves)()
            if number in when:
                when[number]()
            self._stage.rest(self._chance.choice([0.0, 0.0, 0.3]))
        return self._judge() | {"kills": kills, "freezes": freezes}

    def _judge(self) -> dict[str, Any]:
        """End everything, and see what does not."""
        for handle in self._handles:
            handle.interrupt()
        self._stage.until(lambda: all(handle.done for handle in self._handles), END_S)
        # What callers believe ended has ended: clients hear of it a moment later.
        self._stage.until(lambda: not self._open() and not self._held(), END_S)
        self._stage.until(lambda: all(answer.done for answer in self._answers), END_S)
        return {
            "open": [str(handle) for handle in self._handles if not handle.done],
            "ended twice": [execution for execution, times in self._ends.items() if times > 1],
            "running on": self._open(),
            "unanswered": sum(not answer.done for answer in self._answers),
            "held": self._held(),
            **self._stage.close(),
            "executions": len(self._handles),
            "outcomes": dict(sorted(Counter(handle.outcome for handle in self._handles).items())),
        }

    def _open(self) -> list[str]:
        """Return the executions that the managers have open, as every client knows it."""
        known = [record for client in self._clients for skill in client.skills.values() for record in skill.open]
        return sorted({f"{record.skill} {record.id} {record.state.value}" for record in known})

    def _held(self) -> dict[str, str]:
        return {name: state for client in self._clients for name, state in client.resources.items() if state == "USED"}

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
        state = self._chance.choice(["AVAILABLE"] * 4 + ["UNAVAILABLE"])
        self._answers.append(self._chance.choice(self._clients).transition("SDK_authority", state))

    def _freeze(self) -> None:
        self._stage.freeze(self._chance.uniform(*FREEZE_S))

    def _shuffled(self, disasters: list[Callable[[], None]]) -> list[Callable[[], None]]:
        return self._chance.sample(disasters, len(disasters))


def rampage(world: str, rounds: int, *, kills: int, freezes: int = 0, seed: int = 0) -> dict[str, Any]:
    """Run one in a world and return what was found."""
    chance = random.Random(seed)  # noqa: S311 - the same seed makes the same run
    if world == "local":
        return Rampage(LocalStage(CLIENTS, chance), chance).run(rounds, kills=kills)
    with WORLDS[world]() as graph:
        began_s = time.monotonic()
        stage = LiveStage(graph, CLIENTS, chance)
        try:
            found = Rampage(stage, chance).run(rounds, kills=kills, freezes=freezes)
        finally:
            stage.end()
        return found | {"minutes": round((time.monotonic() - began_s) / 60.0, 1)}


def main() -> None:
    """Run for a while."""
    parser = argparse.ArgumentParser(prog="python -m alula_testing.attacks.rampage", description=__doc__)
    parser.add_argument("world", nargs="?", choices=["local", *WORLDS], default="local")
    parser.add_argument("--rounds", type=int, default=10_000, help="things that clients do")
    parser.add_argument("--kills", type=int, default=20, help="SIGKILLs of the managers")
    parser.add_argument("--freezes", type=int, default=10, help=f"SIGSTOPs of the managers, for {FREEZE_S[0]:g} to {FREEZE_S[1]:g} s")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    found = rampage(options.world, options.rounds, kills=options.kills, freezes=options.freezes, seed=options.seed)
    sys.stdout.write(json.dumps(found, indent=1) + "\n")
    sys.exit(1 if any(found.get(what) for what in WRONG) else 0)


if __name__ == "__main__":
    main()
