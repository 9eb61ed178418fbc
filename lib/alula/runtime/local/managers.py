"""All managers of one skillset in the process that runs the world."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterable, Mapping

from alula.model.json_form import to_json
from alula.model.model import Skillset
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.events import Listener
from alula.runtime.core.replies import TransitionReply
from alula.runtime.hooks import SkillHooks
from alula.runtime.local.clock import VirtualClock
from alula.runtime.local.middleware import Bus, VirtualMiddleware
from alula.runtime.managers import Managers
from alula.runtime.timers import Job, Timer

HooksFactory = Callable[["LocalManagers"], Mapping[str, SkillHooks]]


class LocalManagers:
    """The managers, with what hooks and the functional layer need of the world.

    Hooks are called in jobs of the world's clock, one after another. A job of theirs that raises fails what runs.
    """

    def __init__(self, bus: Bus, skillset: Skillset, make_hooks: HooksFactory | Mapping[str, SkillHooks]) -> None:
        self.skillset = skillset
        self._middleware = VirtualMiddleware(bus, skillset.name, model=skillset, on_raise=self._raised)
        self._hooks = make_hooks(self) if callable(make_hooks) else make_hooks
        self._managers = Managers(self._middleware, skillset, self._hooks, bindings=None)
        self.engine: SkillsetEngine = self._managers.engine
        self.data = self._managers.data

    @property
    def clock(self) -> VirtualClock:
        """The world's clock, which these managers follow."""
        return self._middleware.bus.clock

    @property
    def alive(self) -> bool:
        """Return whether they have not been killed."""
        return self._middleware.alive

    @property
    def errors(self) -> list[str]:
        """The errors that belong to no execution, a line each."""
        return self._middleware.errors

    def soon(self, job: Job) -> None:
        """Run a job at this moment, after all that is due already."""
        self._middleware.submit(job)

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay in seconds; not when the managers have gone by then."""
        return self._middleware.later(delay_s, job)

    def transition(self, resource: str, to: str, reason: str = "") -> TransitionReply:
        """Take an extern transition, or say why not; ``reason``: why the resource is so, in words."""
        return self._managers.resources.transition(resource, to, reason)

    def on_report(self, resources: Iterable[str]) -> None:
        """Take a heartbeat of the reporter of these resources; one with a ``silence`` becomes unknown without another within that time."""
        self._managers.resources.on_report(resources)

    def expect_nothing(self) -> None:
        """Expect no more heartbeats of reporters: no resource becomes unknown for want of one."""
        self._managers.resources.expect_nothing()

    def publish(self, name: str, value: object) -> None:
        """Give a data a new value; raise KeyError when the model has no such data."""
        self.data.receive(name, value)

    def update_data(self, name: str, value: object | None) -> None:
        """Evaluate conditions with this value of a data from now on; None: it has no fresh one any more."""
        self._managers.update_data(name, value)

    def on_step(self, callback: Listener) -> None:
        """Call ``callback(events)`` within each step, before clients receive its events."""
        self._managers.on_step.append(callback)

    def describe(self) -> str:
        """Return the model as JSON."""
        return to_json(self.skillset)

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self._managers.close(reason)

    def vanish(self) -> None:
        """Disappear at once, as a killed process does: stop nothing and publish nothing."""
        self._middleware.close()
        self._middleware.bus.vanish(self.skillset.name)

    def _raised(self, error: Exception) -> None:
        last_line = "".join(traceback.format_exception_only(error)).strip().splitlines()[-1]
        self._middleware.log("".join(traceback.format_exception(error)))
        self.engine.fail_all(f"a callback raised {last_line}")
