"""What is needed of a mission together with its models: which situations there are, and what can happen in each."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Generic, Protocol, TypeVar

State = TypeVar("State", bound=Hashable)

DEPARTURE = "departure"
"""The use that the robot's departure is."""


class Kind(Enum):
    """What decides when a step is taken."""

    NOW = "now"
    """The software takes it, as soon as it can: a tick, a message, an answer of a manager."""
    END = "end"
    """An execution ends with a result; its skill's figures give the time, and the probability of each result."""
    FAULT = "fault"
    """A fault comes."""
    MENDED = "mended"
    """A fault is over."""
    WAIT = "wait"
    """The tree has waited long enough: for a time that its file says, or for the progress of a skill."""
    SOON = "soon"
    """It comes some time, if nothing else does; no figure gives the time."""
    ANY = "any"
    """It may come at any time, or never; no figure is for it."""


class Outcome(Enum):
    """How a mission has ended."""

    ACCOMPLISHED = "accomplished"
    DEGRADED = "degraded"
    GIVEN_UP = "given_up"


@dataclass(frozen=True)
class Step(Generic[State]):
    """One way from a situation to the next.

    Attributes:
        name: of the skill that ends, ``skillset.skill``, or of the fault; of the others, what a reader calls it.
        result: how an execution ends, or the precondition by which a request is refused.
        uses: what is used from here on: skills that start, as ``skillset.skill``, and DEPARTURE.
        seconds: how long a WAIT is; 0: the figures of the skill ``name`` say so.
        failing: what is taken to fail though no fault says so: an action of the robot's own of which nobody knows what it does, or data
            of which no fresh value is there.
    """

    kind: Kind
    name: str
    target: State
    result: str = ""
    uses: tuple[str, ...] = ()
    seconds: float = 0.0
    failing: str = ""


class LabelledSystem(Protocol[State]):
    """A mission with its models, as a labelled transition system."""

    def initial(self) -> Iterable[State]:
        """Return the situations in which the system can begin."""

    def steps(self, state: State) -> Iterable[Step[State]]:
        """Return the steps out of a situation: none where the mission has ended, or waits for ever."""

    def outcome(self, state: State) -> Outcome | None:
        """Return how the mission has ended; None: it has not, or in none of these ways."""
