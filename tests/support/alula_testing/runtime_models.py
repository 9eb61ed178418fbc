"""Models and hooks for tests of the runtime and of its adapters."""

from __future__ import annotations

from alula.model.expressions import ResourceIs
from alula.model.model import (
    Assignment,
    Effect,
    Interrupt,
    Invariant,
    Parameter,
    Precondition,
    Progress,
    Resource,
    Result,
    Skill,
    Skillset,
    Transition,
)
from alula.runtime.core import SkillsetEngine
from alula.runtime.core.events import ExecutionEvent, TransitionEvent
from alula_testing.recorder import Recorder

TAKE = Effect("take_control", (Assignment("axes", "USED"),))
RELEASE = Effect("release_control", (Assignment("axes", "AVAILABLE"),))
RESET = Effect("reset")
AXES_FREE = ResourceIs("axes", "AVAILABLE")
AXES_USED = ResourceIs("axes", "USED")
SDK = ResourceIs("sdk", "AVAILABLE")


def flying_skill(name: str, **changes: object) -> Skill:
    """The shape of the paper's Listing 3."""
    values: dict = {
        "name": name,
        "inputs": (Parameter("height", "float64"),),
        "outputs": (Parameter("reached", "float64"),),
        "preconditions": (Precondition("sdk_authority", SDK), Precondition("not_moving", AXES_FREE)),
        "start": TAKE,
        "invariants": (Invariant("keep_sdk", SDK, RESET), Invariant("in_control", AXES_USED, RESET)),
        "progress": Progress(0.1),
        "interrupt": Interrupt(effect=RELEASE),
        "results": (
            Result("DONE", effect=RELEASE),
            Result("BLOCKED", effect=RELEASE),
            Result("SAFE", effect=RELEASE, postcondition=AXES_USED),
        ),
    }
    return Skill(**{**values, **changes})


def resources() -> tuple[Resource, ...]:
    both = (Transition("UNAVAILABLE", "AVAILABLE", extern=True), Transition("AVAILABLE", "UNAVAILABLE", extern=True))
    inner = (Transition("AVAILABLE", "USED"), Transition("USED", "AVAILABLE"))
    return (
        Resource("sdk", ("UNAVAILABLE", "AVAILABLE"), "UNAVAILABLE", both),
        Resource("axes", ("AVAILABLE", "USED"), "AVAILABLE", inner),
    )


def flying_skillset(*skills: Skill, **changes: object) -> Skillset:
    return Skillset(**{"name": "flying", "resources": resources(), "skills": skills or (flying_skill("takeoff"),), **changes})


class Bench:
    """An engine with recorders for hooks, its events in a list, a clock that counts."""

    def __init__(self, skillset: Skillset | None = None, *, authority: bool = True, **options: object) -> None:
        self.skillset = skillset or flying_skillset()
        self.hooks = {skill.name: Recorder() for skill in self.skillset.skills}
        self.events: list = []
        self.steps: list = []
        self.errors: list[str] = []
        self.now_ns = 0
        self.engine = SkillsetEngine(self.skillset, self.clock, self.hooks, self.listen, on_error=self.errors.append, **options)
        if authority:
            assert self.engine.transition("sdk", "AVAILABLE").accepted

    def clock(self) -> int:
        self.now_ns += 1
        return self.now_ns

    def listen(self, events) -> None:
        self.steps.append(tuple(events))
        self.events.extend(events)

    def run(self, skill: str = "takeoff", **inputs: object):
        return self.engine.request(skill, inputs)

    def progress(self, execution) -> float | None:
        """Have the execution's progress asked for; return the answer of hooks that answer at once."""
        told: list[float | None] = []
        self.engine.ask_progress(execution.id, told.append)
        return told[0]

    def states(self) -> dict[str, str]:
        return {name: status.state for name, status in self.engine.resources.items()}

    def story(self) -> list[str]:
        """The events, a word each: ``RUNNING`` or ``axes USED``."""
        told = []
        for event in self.events:
            if isinstance(event, TransitionEvent):
                told.append(f"{event.resource} {event.to_state}")
            else:
                assert isinstance(event, ExecutionEvent)
                told.append(event.state.value)
        return told
