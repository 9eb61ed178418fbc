"""A counterexample as values: the steps of a run, each with what is done, what it changes, and what it ends.

A step can be told (``text``), written as JSON, and played: the same done to running managers shows the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from types import SimpleNamespace
from typing import Any

Value = float | str | bool
Path = tuple[str, ...]
"""The name of a data and, where its type has fields, of the field: ``("battery", "level")``."""
Values = Mapping[Path, Value]


class StepKind(Enum):
    """What a step does; the value is its name in JSON."""

    INITIALLY = "initially"
    EXTERN = "extern"
    OUTSIDE = "outside"
    """A transition that is not extern and that nothing in the model takes (see ``outside``)."""
    EVENT = "event"
    START = "start"
    RESULT = "result"
    INTERRUPT = "interrupt"
    DATA = "data"
    TIME = "time"
    BREAK = "break"
    """Data or time break an invariant; no values were found that show how."""


@dataclass(frozen=True)
class StateChange:
    """A resource went from one state to another."""

    resource: str
    source: str
    target: str


@dataclass(frozen=True)
class NumberedExecution:
    """An execution of a skill; ``number`` counts the starts of the skill in the run, from 1."""

    skill: str
    number: int

    @staticmethod
    def from_json(plain: Mapping[str, Any]) -> NumberedExecution:
        """Return the execution that a step's JSON names."""
        return NumberedExecution(plain["skill"], plain["execution"])


@dataclass(frozen=True)
class CounterexampleEnd:
    """An execution ended. ``name`` is the result or the invariant, empty where there is none; ``state`` as in Figure 5."""

    execution: NumberedExecution
    state: str
    name: str = ""


@dataclass(frozen=True)
class CounterexampleStep:
    """One step. ``subject`` names what is done: resource and state, event, skill, result, data, or invariant.

    ``data`` has the values that are received (None: no fresh value any more), ``time_s`` how much mission time passes before
    the step, ``states`` and ``running`` what is the case after it. ``loop`` marks the steps that are repeated for ever.
    """

    kind: StepKind
    text: str
    subject: tuple[str, ...] = ()
    execution: NumberedExecution | None = None
    changes: tuple[StateChange, ...] = ()
    ended: tuple[CounterexampleEnd, ...] = ()
    refused: bool = False
    data: tuple[tuple[Path, Value | None], ...] = ()
    time_s: float = 0.0
    states: tuple[tuple[str, str], ...] = ()
    running: tuple[NumberedExecution, ...] = ()
    loop: bool = False

    def as_json(self) -> dict[str, object]:
        """Return the step as plain values for tools."""
        return {
            "kind": self.kind.value,
            "text": self.text,
            "subject": list(self.subject),
            "skill": self.execution.skill if self.execution else None,
            "execution": self.execution.number if self.execution else None,
            "result": self.subject[-1] if self.kind is StepKind.RESULT else None,
            "refused": self.refused,
            "changes": [{"resource": c.resource, "from": c.source, "to": c.target} for c in self.changes],
            "ended": [{"skill": e.execution.skill, "execution": e.execution.number, "state": e.state, "name": e.name} for e in self.ended],
            "data": {".".join(path): value for path, value in self.data},
            "time_s": self.time_s,
            "states": dict(self.states),
            "running": [{"skill": e.skill, "execution": e.number} for e in self.running],
            "loop": self.loop,
        }

    @staticmethod
    def from_json(plain: Mapping[str, Any]) -> CounterexampleStep:
        """Return the step of the JSON that ``as_json`` made; its values are not checked."""
        return CounterexampleStep(
            StepKind(plain["kind"]),
            plain["text"],
            subject=tuple(plain["subject"]),
            execution=NumberedExecution.from_json(plain) if plain["skill"] else None,
            changes=tuple(StateChange(one["resource"], one["from"], one["to"]) for one in plain["changes"]),
            ended=tuple(CounterexampleEnd(NumberedExecution.from_json(one), one["state"], one["name"]) for one in plain["ended"]),
            refused=plain["refused"],
            data=tuple((tuple(path.split(".")), value) for path, value in plain["data"].items()),
            time_s=plain["time_s"],
            states=tuple(plain["states"].items()),
            running=tuple(NumberedExecution.from_json(one) for one in plain["running"]),
            loop=plain["loop"],
        )


@dataclass(frozen=True)
class Counterexample:
    """The steps of a run; ``stops``: nothing more can happen after the last."""

    steps: tuple[CounterexampleStep, ...] = ()
    stops: bool = False

    @property
    def lines(self) -> tuple[str, ...]:
        """Return a numbered line for each step, and what comes of the run where it goes on for ever."""
        told = [f"{number}. {step.text}" for number, step in enumerate(self.steps, 1)]
        loop = next((index for index, step in enumerate(self.steps) if step.loop), None)
        if loop is not None:
            told.insert(loop, "and then for ever:")
        return (*told, *(["and nothing more can happen"] if self.stops else []))


NO_COUNTEREXAMPLE = Counterexample()


def messages(values: Values) -> dict[str, object]:
    """Return each data's value as a message: the value itself, or an object with the fields."""
    found: dict[str, object] = {}
    for (name, *fields), value in values.items():
        if not fields:
            found[name] = value
            continue
        message: Any = found.setdefault(name, SimpleNamespace())
        for part in fields[:-1]:
            if not hasattr(message, part):
                setattr(message, part, SimpleNamespace())
            message = getattr(message, part)
        setattr(message, fields[-1], value)
    return found
