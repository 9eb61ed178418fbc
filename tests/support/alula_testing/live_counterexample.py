"""The worlds of counterexamples over a real middleware have this in common: real managers and client, on a mission clock of their own.

Each is a process: it takes models and the steps of counterexamples as lines of JSON, and answers with the differences at each step.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable
from types import ModuleType

from alula.language.counterexamples import Counterexample, CounterexampleStep
from alula.model.json_form import from_json, to_json
from alula.model.model import Skillset
from alula.model.ros_types import camel
from alula.prove.skillset.play import PlayedStep, play
from alula.prove.skillset.play_world import Hooks, MakeWorld
from alula.runtime.client import Client
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.managers import Managers
from alula.runtime.middleware import Middleware

SETTLE_S = 10.0
"""How long (wall clock) a condition is waited for."""
CLOCK_S = 30.0
LOOK_S = 0.005
NANOSECONDS = 1_000_000_000
NO_TOPIC = "std_msgs/msg/String"
"""Of data's topics, which carry nothing in a play: the managers get a counterexample's values directly, whatever their types."""


class LiveWorld:
    """Serves a skillset; ends with ``close``.

    Args:
        serving: the managers' side of the middleware.
        calling: the client's side.
        tell_time: sends a mission time, ns, to both sides.
    """

    def __init__(
        self, serving: Middleware, calling: Middleware, tell_time: Callable[[int], None], skillset: Skillset, hooks: Hooks
    ) -> None:
        self._sides = (serving, calling)
        self._tell_time = tell_time
        self._now_ns = max(side.now_ns() for side in self._sides)
        self.pass_time(1.0)
        bindings = {data.name: (f"{skillset.name}/counterexample/{data.name}", NO_TOPIC) for data in skillset.data}
        self.managers = Managers(serving, skillset, hooks, bindings=bindings)
        self.client = Client(calling, skillset.name)

    @property
    def now_ns(self) -> int:
        """Mission clock."""
        return self._now_ns

    def pass_time(self, seconds: float) -> None:
        """Have mission time pass; raise SkillRuntimeError when the clock does not arrive."""
        self._now_ns += round(seconds * NANOSECONDS)
        end_s = time.monotonic() + CLOCK_S
        while any(side.now_ns() < self._now_ns for side in self._sides):
            if time.monotonic() > end_s:
                raise SkillRuntimeError(f"the mission clock has not arrived within {CLOCK_S:g} s")
            self._tell_time(self._now_ns)
            time.sleep(LOOK_S)

    def settle(self, condition: Callable[[], bool]) -> None:
        """Wait (wall clock) until a condition holds, a bounded time."""
        end_s = time.monotonic() + SETTLE_S
        while not condition() and time.monotonic() < end_s:
            time.sleep(LOOK_S)

    def close(self) -> None:
        """End the managers and the client."""
        self.managers.close("the play is over")
        self.client.close("the play is over")
        self._sides[0].close()


def interfaces_of(skillset: Skillset, messages: object, kinds: tuple[str, ...]) -> ModuleType:
    """Return actions for the skills of any model: each is ``Play``, which has neither inputs nor outputs."""
    interfaces = ModuleType(f"{skillset.name}_interfaces")
    for skill in skillset.skills:
        for kind in kinds:
            setattr(interfaces, f"{camel(skill.name)}{kind}", getattr(messages, f"Play{kind}"))
    return interfaces


def to_line(skillset: Skillset, counterexample: Counterexample) -> str:
    """Return the line that ``serve`` reads."""
    return json.dumps({"model": to_json(skillset), "steps": [step.as_json() for step in counterexample.steps]}) + "\n"


def from_line(counterexample: Counterexample, answer: str) -> list[PlayedStep]:
    """Return what ``serve`` has answered for a counterexample."""
    return [PlayedStep(step, tuple(differences)) for step, differences in zip(counterexample.steps, json.loads(answer), strict=False)]


def serve(make_world: MakeWorld) -> None:
    """Play the counterexamples that come as lines on stdin, each in a world of its own; answer each with a line on stdout."""
    # Whatever prints to stdout goes to stderr: that line belongs to the answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    for line in sys.stdin:
        asked = json.loads(line)
        counterexample = Counterexample(tuple(CounterexampleStep.from_json(step) for step in asked["steps"]))
        played = play(from_json(asked["model"]), counterexample, make_world)
        answers.write(json.dumps([one.differences for one in played]) + "\n")
        answers.flush()
