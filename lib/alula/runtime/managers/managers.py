"""All managers of one skillset: the engine, and the managers that connect it to the middleware."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from alula.model.model import Skillset
from alula.runtime.core.engine import DEFAULT_TIMEOUT_S, HOOK_TIMEOUT_S, SkillsetEngine
from alula.runtime.core.errors import SkillRuntimeError
from alula.runtime.core.events import EngineEvent, ExecutionEvent, Listener
from alula.runtime.core.hook_calls import HookCaller
from alula.runtime.hooks import SkillHooks
from alula.runtime.managers.data import DataBindings, DataManager
from alula.runtime.managers.engine_timer import EngineTimer
from alula.runtime.managers.records import SkillStatesPublisher
from alula.runtime.managers.resources import ResourceManager
from alula.runtime.managers.services import SkillsetServices
from alula.runtime.managers.skill import SkillManager
from alula.runtime.middleware import EVENTS, Middleware

FLUSH_S = 1.0
UNKNOWN_YET = "not known: the managers have just started, and what ran before has yet to be stopped"
HOOKS_RETURN_S = 5.0
"""How long (wall clock) the end of the managers waits for hooks that have not returned."""
MakeInputs = Callable[[str, Mapping[str, object]], object]
"""Makes what the hooks of a skill get from the values of its inputs."""


class Managers:
    """The data manager, the resource manager and the skill managers.

    Hooks are called on threads of their own; nothing of the middleware's loop waits for one.

    Args:
        middleware: serves them.
        skillset: the model.
        hooks: one a skill, or the caller of hooks in other processes.
        bindings: the topic that each data comes from; None: values come by ``data.receive`` only.
        make_inputs: by default the hooks' own ``make_inputs``; the plain values where the hooks are elsewhere.
        interrupt_timeout_s: how long a stop may take where the model does not say.
        hook_timeout_s: how long a hook may take to return, in time that this process could run.
        on_rival: called with the reason when other managers of this skillset are there.

    Raises:
        SkillRuntimeError: a skill has no hooks, a data no binding, or the time-out is no time.
    """

    def __init__(
        self,
        middleware: Middleware,
        skillset: Skillset,
        hooks: Mapping[str, SkillHooks] | HookCaller,
        *,
        bindings: DataBindings | None,
        make_inputs: MakeInputs | None = None,
        interrupt_timeout_s: float = DEFAULT_TIMEOUT_S,
        hook_timeout_s: float = HOOK_TIMEOUT_S,
        on_rival: Callable[[str], None] | None = None,
    ) -> None:
        if not interrupt_timeout_s > 0:
            raise SkillRuntimeError(f"parameter interrupt_timeout_s is {interrupt_timeout_s:g}; a stop needs a positive time")
        if not hook_timeout_s > 0:
            raise SkillRuntimeError(f"parameter hook_timeout_s is {hook_timeout_s:g}; a hook needs a positive time")
        self.skillset = skillset
        self.middleware = middleware
        self.instance_id = middleware.new_id()
        self._closed = False
        self.on_step: list[Listener] = []
        """Called at each step, within it, before it is published."""
        make = make_inputs or _maker(hooks)
        self.engine = SkillsetEngine(
            skillset,
            middleware.now_ns,
            hooks,
            self._on_events,
            instance_id=self.instance_id,
            defer=middleware.defer,
            on_error=middleware.log,
            interrupt_timeout_s=interrupt_timeout_s,
            hook_timeout_s=hook_timeout_s,
        )
        self._timer = EngineTimer(middleware, self.engine)
        self.data = DataManager(middleware, skillset, bindings, self.update_data)
        self.resources = ResourceManager(middleware, self.engine, self.instance_id)
        self._events = middleware.advertise(EVENTS)
        self.skills = {skill.name: SkillManager(middleware, self.engine, skill, make) for skill in skillset.skills}
        self._records = SkillStatesPublisher(middleware, skillset, self.instance_id)
        # Served once all are made: clients of managers that were here before ask at once, on other threads.
        self.data.serve()
        self.resources.serve()
        servers = {name: manager.serve() for name, manager in self.skills.items()}
        SkillsetServices(middleware, self.engine, servers, make)
        self._announce: Callable[[], None] = lambda: middleware.announce(self.instance_id, on_rival or self._on_rival)
        self._start()

    def _start(self) -> None:
        """Announce the managers once what ran before has been stopped: a client that hears the heartbeat finds everything there."""
        skills = self.engine.skills_to_start
        if skills:
            self.resources.doubt(UNKNOWN_YET)
        self.engine.start(skills, self.middleware.defer, (lambda: self.middleware.submit(self._started)) if skills else self._announce)

    def _started(self) -> None:
        self.resources.doubt("")
        if not self._closed:
            self._announce()

    def close(self, reason: str) -> None:
        """Fail whatever runs for this reason, so that functions are stopped, and take no more requests."""
        self._closed = True
        self.engine.close(reason)
        if not self.middleware.close_hooks(HOOKS_RETURN_S):
            self.middleware.log(f"a hook has not returned within {HOOKS_RETURN_S:g} s; its thread is abandoned")
        self._records.publish()
        self._events.flush(FLUSH_S)

    def _on_events(self, events: Sequence[EngineEvent]) -> None:
        """Pass on one step: resources before events before results, so that a client that sees a result sees its effects."""
        for on_step in self.on_step:
            on_step(events)
        self.resources.on_events(events)
        for event in events:
            self._events.publish(event)
        for event in events:
            if isinstance(event, ExecutionEvent):
                self.skills[event.skill].on_event(event)
        self._records.on_events(events)
        self._timer.update()

    def update_data(self, name: str, value: object | None) -> None:
        """Let conditions use a value of a data, or None: there is no fresh one any more."""
        self.engine.update_data(name, value)
        self._timer.update()

    def _on_rival(self, reason: str) -> None:
        self.middleware.log(reason)
        self.close(reason)


def _maker(hooks: Mapping[str, SkillHooks] | HookCaller) -> MakeInputs:
    if isinstance(hooks, Mapping):
        return lambda skill, values: hooks[skill].make_inputs(values)
    return lambda _, values: dict(values)
