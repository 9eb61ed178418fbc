"""What a script is made of; everything goes through JSON, for the middlewares are played in processes of their own."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

Inputs = dict[str, Any]


@dataclass(frozen=True)
class Behaviour:
    """What a skill's hooks do in one call of the skill; without anything else it runs until it is told to end."""

    refuse: str = ""
    """What ``validate`` refuses with."""
    raises: str = ""
    """Name of the hook that raises."""
    ends: str = ""
    """The result that the function ends with by itself, ``after_s`` seconds of mission clock after the dispatch."""
    after_s: float = 0.05
    message: str = ""
    """Goes with the result."""
    pauses: bool = False
    """Whether it can be paused."""
    misbehaves: str = ""
    """Name of the misbehaviour of ``alula_testing.misbehaviours`` that it shows."""


@dataclass(frozen=True)
class Step:
    """One stimulus; the next comes when nothing more follows from it.

    ``start`` (label, skill, inputs, client), ``interrupt`` (label), ``finish`` (label, result), ``fail`` (label), ``transition``
    (resource, state), ``pause`` and ``resume`` (label), ``why`` (skill, inputs), ``late``: a client that comes now and tells what
    it sees.
    """

    do: str
    label: str = ""
    skill: str = ""
    inputs: Inputs = field(default_factory=dict)
    client: int = 0
    result: str = ""
    resource: str = ""
    state: str = ""


@dataclass(frozen=True)
class Script:
    """Stimuli in order; ``behaviours`` has those of each skill by its calls, and beyond the last call the default."""

    steps: tuple[Step, ...]
    behaviours: dict[str, tuple[Behaviour, ...]] = field(default_factory=dict)

    def to_plain(self) -> dict[str, Any]:
        """Return what ``json`` can write."""
        return asdict(self)

    @staticmethod
    def from_plain(plain: dict[str, Any]) -> Script:
        """Return the script that ``to_plain`` was made of."""
        behaviours = {skill: tuple(Behaviour(**call) for call in calls) for skill, calls in plain["behaviours"].items()}
        return Script(tuple(Step(**step) for step in plain["steps"]), behaviours)
