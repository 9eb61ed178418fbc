"""Plays a behaviour: memory and chance of all skillsets' mocks, what happens by the clock, faults, data."""

from __future__ import annotations

import functools
import random
import threading
from collections.abc import Callable, Mapping

from skill_model.model import Skillset
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.mock.behaviour import Behaviour, DataScript, Fault, Happening, Place, Value
from skill_runtime.mock.formula import Formula, FormulaError
from skill_runtime.mock.skill import MockSkill
from skill_runtime.mock.stage import Stage


class Play:
    """One performance of a behaviour; the same seed makes the same one.

    ``hooks_of`` gives the hooks for each skillset's managers; ``begin`` is to be called once all of them are there, ``on_state``
    at every state that a resource enters.
    """

    def __init__(self, behaviour: Behaviour, stage: Stage, *, seed: int = 0) -> None:
        self.memory: dict[str, object] = dict(behaviour.memory)
        self.lock = threading.RLock()
        self.stage = stage
        self.faults: dict[str, float] = {}
        """When which fault happened, seconds of mission clock."""
        self._behaviour = behaviour
        self._seed = seed
        self._chance = random.Random(f"{seed} timeline")  # noqa: S311 - a play, not a secret
        self._skills: list[MockSkill] = []
        self._began_s = 0.0
        self._held: dict[Place, str] = {}
        """What faults hold resources at, whatever else the script says of them."""
        self._awaited: dict[tuple[Place, str], list[tuple[float, Happening | tuple[str, Fault]]]] = {}
        self._entered_s: dict[tuple[Place, str], float] = {}

    def hooks_of(self, skillset: Skillset) -> dict[str, MockSkill]:
        """Make the hooks of a skillset's skills."""
        made = {}
        for skill in skillset.skills:
            rules = self._behaviour.rules.get((skillset.name, skill.name), ())
            chance = random.Random(f"{self._seed} {skillset.name}.{skill.name}")  # noqa: S311
            made[skill.name] = MockSkill(self, skillset.name, skill, rules, chance)
        self._skills += made.values()
        return made

    def begin(self) -> None:
        """Let the clock's part of the play begin."""
        self._began_s = self.stage.now_s
        for happening in self._behaviour.timeline:
            delay_s = self.number(happening.after_s, {})
            if happening.anchor is None:
                self._later(delay_s, happening)
            else:
                self._await(happening.anchor, delay_s, happening)
        for place, script in self._behaviour.data.items():
            self._do(0.0, functools.partial(self._publish, place, script))

    def fail(self, name: str, after_s: float | None = None) -> None:
        """Have a fault of the behaviour happen, seconds after its anchor; None: at the beginning.

        Raises:
            SkillRuntimeError: there is no such fault.
        """
        fault = self._behaviour.faults.get(name)
        if fault is None:
            raise SkillRuntimeError(f"there is no fault '{name}' in the behaviour; it has {', '.join(self._behaviour.faults) or 'none'}")
        if after_s is None:
            self._later(0.0, (name, fault))
        elif fault.anchor is None:
            self._later(after_s, (name, fault))
        else:
            self._await(fault.anchor, after_s, (name, fault))

    def on_state(self, skillset: str, resource: str, state: str) -> None:
        """Note that a resource has entered a state; only the first time counts."""
        entered = ((skillset, resource), state)
        if entered in self._entered_s:
            return
        self._entered_s[entered] = self.stage.now_s
        for delay_s, what in self._awaited.pop(entered, ()):
            self._later(delay_s, what)

    # --- for the skills ----------------------------------------------------------------------------------------------

    def take(self, states: Mapping[Place, str]) -> None:
        """Have resources be in these states, as far as they are not."""
        for (skillset, resource), wanted in states.items():
            state = self._held.get((skillset, resource), wanted)
            if self.stage.state(skillset, resource) == state:
                continue
            refusal = self.stage.transition(skillset, resource, state)
            if refusal:
                self.stage.note(f"the mock can't have {skillset}.{resource} be {state}: {refusal}")

    def number(self, value: Value, names: Mapping[str, object], chance: random.Random | None = None) -> float:
        """Return a value that is a number; raise FormulaError when it is none."""
        result = self.value(value, names, chance)
        if isinstance(result, bool) or not isinstance(result, int | float):
            raise FormulaError(f"{value!r} is {result!r}, not a number")
        return float(result)

    def value(self, value: Value, names: Mapping[str, object], chance: random.Random | None = None) -> object:
        """Return what a value is now; ``names`` go before the memory."""
        if isinstance(value, bool | int | float | str):
            return value
        if isinstance(value, Formula):
            return value(names if value.names <= names.keys() else self._known(names), chance or self._chance)
        return value(self._known(names))

    def _known(self, names: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names with the memory as it is now behind them."""
        with self.lock:
            for skill in self._skills:
                skill.move()
            return {**self.memory, **names}

    # --- the clock's part --------------------------------------------------------------------------------------------

    def _await(self, anchor: tuple[Place, str], delay_s: float, what: Happening | tuple[str, Fault]) -> None:
        if anchor in self._entered_s:
            self._later(self._entered_s[anchor] + delay_s - self.stage.now_s, what)
        else:
            self._awaited.setdefault(anchor, []).append((delay_s, what))

    def _later(self, delay_s: float, what: Happening | tuple[str, Fault]) -> None:
        self._do(delay_s, lambda: self._happen(what))

    def _do(self, delay_s: float, job: Callable[[], None]) -> None:
        """Have a job done after a delay; a formula in it that has no value is told, and the play goes on."""

        def safely() -> None:
            try:
                job()
            except FormulaError as error:
                self.stage.note(str(error))

        self.stage.after(max(0.0, delay_s), safely)

    def _happen(self, what: Happening | tuple[str, Fault]) -> None:
        if isinstance(what, Happening):
            self.take(what.states)
            return
        name, fault = what
        self.faults.setdefault(name, self.stage.now_s)
        self._do(self.number(fault.delay, {}), lambda: self._hold(fault))

    def _hold(self, fault: Fault) -> None:
        self._held |= fault.states
        self.take(fault.states)

    def _publish(self, place: Place, script: DataScript) -> None:
        self._do(script.period_s, lambda: self._publish(place, script))
        now_s = self.stage.now_s - self._began_s
        value = next((value for from_s, value in reversed(script.steps) if from_s <= now_s), None)
        if value is not None:
            self.stage.publish(*place, self._filled(value, {"t": now_s}))

    def _filled(self, value: object, names: Mapping[str, object]) -> object:
        if isinstance(value, Mapping):
            return {name: self._filled(part, names) for name, part in value.items()}
        if isinstance(value, list | tuple):
            return [self._filled(part, names) for part in value]
        return self.value(value, names) if isinstance(value, Formula) or callable(value) else value
