"""From a request to a running function (paper, Figure 5): validated, started in one step, dispatched."""

from __future__ import annotations

from collections.abc import Callable

from skill_model import semantics
from skill_model.execution_state import ExecutionState
from skill_runtime.core.errors import SkillRuntimeError
from skill_runtime.core.execution import Controller, Execution
from skill_runtime.core.floor import Floor, Job
from skill_runtime.core.ledger import Entry
from skill_runtime.core.stops import Stops

Submit = Callable[[Job], None]


def run_at_once(job: Job) -> None:
    """Run a job in the calling thread."""
    job()


class Requests:
    """Takes requests down and runs them; ``tick`` does what has become due, ``controller`` is what executions call."""

    def __init__(self, floor: Floor, stops: Stops, controller: Controller, tick: Callable[[], None]) -> None:
        self._floor = floor
        self._stops = stops
        self._controller = controller
        self._tick = tick

    def register(self, skill: str, inputs: object, execution_id: str) -> Execution:
        """Take down a request without calling a hook; an empty id is counted."""
        floor = self._floor
        floor.skillset.skill(skill)
        with floor.lock:
            execution_id = execution_id or str(floor.ledger.sequence + 1)
            if execution_id in floor.ledger.entries:
                raise SkillRuntimeError(f"skill {skill}: the execution id {execution_id} is in use")
            entry = floor.ledger.add(Execution(self._controller, execution_id, skill, inputs))
            if floor.closed:
                floor.ledger.end_request(entry, ExecutionState.NOT_VALIDATED, floor.closed)
        floor.deliver()
        return entry.execution

    def run(self, execution_id: str, submit: Submit) -> None:
        """Have a registered request validated and started, unless it has ended meanwhile; ``submit`` runs the hooks that may wait."""
        floor = self._floor
        with floor.lock:
            entry = floor.ledger.entries.get(execution_id)
            if entry is None or entry.execution.state is not ExecutionState.REQUESTED:
                return
        if floor.hooks.written(entry.execution.skill, "validate"):
            validated = lambda refusal: self._validated(entry, str(refusal or ""), run_at_once)  # noqa: E731
            submit(lambda: floor.call(entry, "validate", validated))
        else:
            self._validated(entry, "", submit)

    def _validated(self, entry: Entry, refusal: str, submit: Submit) -> None:
        """Refuse the request or take its start step and call ``on_dispatch``."""
        self._tick()
        floor, started = self._floor, False
        stops: list[Entry] = []
        with floor.lock:
            if entry.execution.done:
                return
            if refusal:
                floor.ledger.end_request(entry, ExecutionState.NOT_VALIDATED, refusal)
            else:
                stops, started = self._start(entry)
        floor.after_step([other for other in stops if other is not entry])
        if started and floor.hooks.written(entry.execution.skill, "on_dispatch"):
            submit(lambda: floor.call(entry, "on_dispatch", lambda _: self._stops.hook_returned(entry)))

    def _start(self, entry: Entry) -> tuple[list[Entry], bool]:
        """Take the start step with the lock held; return what is to be stopped, and whether the execution runs."""
        floor = self._floor
        entry.dispatching = floor.hooks.written(entry.execution.skill, "on_dispatch")
        stops = floor.ledger.commit(semantics.start(floor.skillset, floor.ledger.situation, entry.key))
        started = entry.execution.state is ExecutionState.RUNNING
        if not started:
            # Also when its own invariant broke in the very step: nothing was dispatched, nothing is to be stopped.
            floor.ledger.entries.pop(entry.key.id, None)
        return stops, started
