"""Logs of random models: an engine is given random stimuli, and what it tells is the log."""

from __future__ import annotations

import random

from prove_models import VALUES

from alula.runtime.core import SkillsetEngine
from alula_testing.recorder import Recorder

LIKELY = {"request": 5, "extern": 4, "event": 3, "value": 5, "time": 4, "terminate": 3, "interrupt": 2, "interrupted": 2}
LIKELY |= {"fail": 1, "pause": 1, "resume": 1, "refuse": 1, "register": 1}


class Walk:
    """An engine on a clock of its own, and its events."""

    def __init__(self, skillset, seed):
        self.skillset = skillset
        self.chance = random.Random(seed)  # noqa: S311 - nothing here is secret
        self.now_ns = 0
        self.events = []
        self._refusing = False
        hooks = {skill.name: Recorder() for skill in skillset.skills}
        for hook in hooks.values():
            hook.acts = {"validate": lambda _: "no" if self._refusing else "", "on_interrupt": lambda _: self.chance.random() < 0.5}
        self.engine = SkillsetEngine(skillset, lambda: self.now_ns, hooks, self.events.extend)

    def go(self, steps):
        for _ in range(steps):
            (kind,) = self.chance.choices(list(LIKELY), list(LIKELY.values()))
            getattr(self, f"_{kind}")()
        return self.events

    def _pick(self, several):
        return self.chance.choice(several) if several else None

    def _some(self):
        return self._pick(self.engine.executions)

    def _request(self):
        self.engine.request(self._pick(self.skillset.skills).name, {})

    def _register(self):
        """Ask, and have it end before it runs."""
        execution = self.engine.register(self._pick(self.skillset.skills).name, {})
        self._pick([self.engine.interrupt, lambda one: self.engine.fail(one, "x"), lambda _: None])(execution.id)

    def _refuse(self):
        self._refusing = True
        self._request()
        self._refusing = False

    def _extern(self):
        resource = self._pick(self.skillset.resources)
        self.engine.transition(resource.name, self._pick(resource.states))

    def _event(self):
        if self.skillset.events:
            self.engine.trigger(self._pick(self.skillset.events).name)

    def _value(self):
        for data in self.skillset.data:
            self.engine.update_data(data.name, self._pick([*VALUES, *VALUES, None]))

    def _time(self):
        self.now_ns += self._pick([0, 100_000_000, 400_000_000, 3_000_000_000])
        self.engine.tick()

    def _terminate(self):
        if (one := self._some()) is not None:
            self.engine.terminate(one.id, self._pick(["NOSUCH", *(r.name for r in self.skillset.skill(one.skill).results)]))

    def _fail(self):
        if (one := self._some()) is not None:
            self.engine.fail(one.id, "asked to")

    def _interrupt(self):
        if (one := self._some()) is not None:
            self.engine.interrupt(one.id)

    def _interrupted(self):
        if (one := self._some()) is not None:
            self.engine.interrupted(one.id)

    def _pause(self):
        if (one := self._some()) is not None:
            self.engine.pause(one.id)

    def _resume(self):
        if (one := self._some()) is not None:
            self.engine.resume(one.id)
