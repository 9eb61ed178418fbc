"""A robot that follows a behaviour: the mocks of all its skillsets, what happens by the clock, faults, data."""

from __future__ import annotations

import functools
import random
from collections.abc import Callable, Mapping, Sequence

from alula.common.faults import FaultRequest
from alula.mock.behaviour import Behaviour, DataScript, MockFault, Place, Rule
from alula.mock.formula import Formula, FormulaError
from alula.mock.host import MockHost
from alula.mock.skill import MockSkill
from alula.mock.state import MockState
from alula.model.model import Skill, Skillset
from alula.runtime.timers import Job

MakeSkill = Callable[[MockState, str, Skill, Sequence[Rule], random.Random], MockSkill]


class MockRobot(MockState):
    """A robot whose skills, faults and data follow a behaviour; the same seed makes the same one.

    ``hooks_of`` gives the hooks for each skillset's managers; ``begin`` is to be called once all of them are there, ``on_state``
    at every state that a resource enters.
    """

    def __init__(self, behaviour: Behaviour, host: MockHost, *, seed: int = 0) -> None:
        super().__init__(behaviour.memory, host, random.Random(f"{seed} timeline"))  # noqa: S311 - a mock, not a secret
        self.faults: dict[str, float] = {}
        """When which fault happened, seconds of mission clock."""
        self._beside = [MockRobot(one, host, seed=seed) for one in behaviour.beside]
        for other in self._beside:
            other.faults = self.faults
        self.behaviour = behaviour
        self._seed = seed
        self._skills: list[MockSkill] = []
        self._resources: dict[str, tuple[str, ...]] = {}
        self._began_s = 0.0
        self._before: dict[str, dict[Place, str]] = {}
        """What the resources of a fault were before it."""
        self._awaited: dict[tuple[Place, str], list[tuple[float, Job]]] = {}
        self._entered_s: dict[tuple[Place, str], float] = {}

    def hooks_of(self, skillset: Skillset, make: MakeSkill = MockSkill) -> dict[str, MockSkill]:
        """Make the hooks of a skillset's skills; ``make`` by default makes those that follow the rules alone."""
        other = next((one for one in self._beside if one.behaviour.about(skillset.name)), None)
        if other is not None:
            return other.hooks_of(skillset, make)
        made = {}
        self._resources[skillset.name] = tuple(resource.name for resource in skillset.resources)
        for skill in skillset.skills:
            rules = self.behaviour.rules.get((skillset.name, skill.name), ())
            chance = random.Random(f"{self._seed} {skillset.name}.{skill.name}")  # noqa: S311
            made[skill.name] = make(self, skillset.name, skill, rules, chance)
        self._skills += made.values()
        self._moving += [skill.move for skill in made.values()]
        return made

    def begin(self) -> None:
        """Schedule the timeline and the data, from now on."""
        self._began_s = self.host.now_s
        for event in self.behaviour.timeline:
            self._schedule(event.anchor, self.number(event.after_s, {}), functools.partial(self.take, event.states))
        for place, script in self.behaviour.data.items():
            self._do(0.0, functools.partial(self._publish, place, script))
        for other in self._beside:
            other.begin()

    def fail(self, request: FaultRequest) -> None:
        """Inject a fault of the behaviour at its time, at the beginning where it has none, and end it where the request has an end.

        A fault may be written for one way of failing, ``zed:dark``, or for all, ``zed``.

        Raises:
            SkillRuntimeError: there is no such fault.
        """
        name, fault = self.behaviour.fault(request)
        other = next((one for one in self._beside if name in one.behaviour.faults), None)
        if other is not None:
            other.fail(request)
            return
        anchor = None if request.begin_s is None else fault.anchor
        self._schedule(anchor, request.begin_s or 0.0, functools.partial(self._break, name, fault))
        if request.end_s is not None:
            self._schedule(anchor, request.end_s, functools.partial(self._mend, name, fault))

    def on_state(self, skillset: str, resource: str, state: str) -> None:
        """Note that a resource has entered a state; only the first time counts."""
        for other in self._beside:
            other.on_state(skillset, resource, state)
        entered = ((skillset, resource), state)
        if entered in self._entered_s:
            return
        self._entered_s[entered] = self.host.now_s
        for delay_s, job in self._awaited.pop(entered, ()):
            self._do(delay_s, job)

    def holds(self, skillset: str) -> bool:
        """Return whether a fault holds a resource of this skillset."""
        return any(place[0] == skillset for place in self._held) or any(other.holds(skillset) for other in self._beside)

    # --- the clock's part --------------------------------------------------------------------------------------------

    def _schedule(self, anchor: tuple[Place, str] | None, delay_s: float, job: Job) -> None:
        """Run a job some seconds after a resource first enters a state; None: from now."""
        if anchor is None:
            self._do(delay_s, job)
        elif anchor in self._entered_s:
            self._do(self._entered_s[anchor] + delay_s - self.host.now_s, job)
        else:
            self._awaited.setdefault(anchor, []).append((delay_s, job))

    def _do(self, delay_s: float, job: Job) -> None:
        """Run a job after a delay; report a formula in it that has no value, and go on."""

        def safely() -> None:
            try:
                job()
            except FormulaError as error:
                self.host.note(str(error))

        self.host.after(max(0.0, delay_s), safely)

    def _break(self, name: str, fault: MockFault) -> None:
        self.faults.setdefault(name, self.host.now_s)
        self._do(self.number(fault.delay, {}), lambda: self._hold(name, fault))

    def _mend(self, name: str, fault: MockFault) -> None:
        self._do(self.number(fault.delay, {}), lambda: self._release(name))

    def _hold(self, name: str, fault: MockFault) -> None:
        self._before.setdefault(name, {place: self.host.state(*place) for place in fault.states})
        self._held |= fault.states
        reason = fault.reason or f"mock fault {name}"
        self.take(fault.states, reason)
        for skill in self._skills:
            if skill.place in fault.ends:
                skill.end(fault.ends[skill.place], f"the fault {name}")
        for change in fault.changes:
            self._do(self.number(change.after_s, {}), functools.partial(self.take, change.states, reason))

    def _release(self, name: str) -> None:
        before = self._before.pop(name, {})
        for place in before:
            self._held.pop(place, None)
        self.take(before, f"the mock fault {name} is over")

    def _publish(self, place: Place, script: DataScript) -> None:
        self._do(script.period_s, lambda: self._publish(place, script))
        now_s = self.host.now_s - self._began_s
        value = next((value for from_s, value in reversed(script.steps) if from_s <= now_s), None)
        if value is not None:
            states = {resource: self.host.state(place[0], resource) for resource in self._resources.get(place[0], ())}
            self.host.publish(*place, self._filled(value, {"t": now_s, **states}))

    def _filled(self, value: object, names: Mapping[str, object]) -> object:
        if isinstance(value, Mapping):
            return {name: self._filled(part, names) for name, part in value.items()}
        if isinstance(value, list | tuple):
            return [self._filled(part, names) for part in value]
        return self.value(value, names) if isinstance(value, Formula) or callable(value) else value
