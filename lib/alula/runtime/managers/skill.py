"""A skill manager (paper, section 4.2): one skill as an action that takes any number of goals at a time.

Each goal is taken, and every end of its execution is its result, so that the caller always gets the reason. No thread waits while
a skill runs: the goal is kept, and finished when the engine tells of the end.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from alula.model.model import Skill
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.middleware import ActionServer, Goal, Middleware


class SkillManager:
    """Serves one skill; a goal's id is the execution's."""

    server: ActionServer
    """The action, once it is served."""

    def __init__(
        self,
        middleware: Middleware,
        engine: SkillsetEngine,
        skill: Skill,
        make_inputs: Callable[[str, Mapping[str, object]], object],
    ) -> None:
        self._middleware = middleware
        self._engine = engine
        self._skill = skill
        self._make_inputs = make_inputs
        self._goals: dict[str, Goal] = {}
        self._reported: set[str] = set()

    def serve(self) -> ActionServer:
        """Serve the skill's action; return its server."""
        self.server = self._middleware.serve_action(self._skill.name, self._on_goal, self._on_cancel)
        return self.server

    def on_event(self, event: ExecutionEvent) -> None:
        """Follow an execution of this skill."""
        goal = self._goals.get(event.id)
        if goal is None:
            return
        if event.state.terminal:
            del self._goals[event.id]
            self._reported.discard(event.id)
            goal.finish(event)
        elif event.state.active:
            execution = self._engine.execution(event.id)
            goal.report(0.0 if execution is None else execution.progress, event.state, event.outputs)
            if event.id not in self._reported:
                self._reported.add(event.id)
                self._report_later(event.id)

    def _on_goal(self, goal: Goal) -> None:
        self._goals[goal.id] = goal
        inputs, problem = self._inputs(goal)
        # Registered here, on the loop that also brings cancellations: none finds its execution unknown.
        self._engine.register(self._skill.name, inputs, execution_id=goal.id)
        if problem:
            self._engine.fail(goal.id, problem)
        else:
            self._engine.run(goal.id, self._middleware.defer)

    def _inputs(self, goal: Goal) -> tuple[object, str]:
        """Return what hooks get; or the plain inputs, and the error of the developer's class that makes what hooks get."""
        try:
            return self._make_inputs(self._skill.name, goal.inputs), ""
        except Exception as error:  # noqa: BLE001 - it is the reason that the caller gets
            return dict(goal.inputs), f"the request could not be taken down: {type(error).__name__}: {error}"

    def _on_cancel(self, goal_id: str) -> None:
        self._middleware.defer(lambda: self._engine.interrupt(goal_id))

    def _report_later(self, goal_id: str) -> None:
        if self._skill.progress is not None:
            due_ns = self._middleware.now_ns() + round(self._skill.progress.period_s * 1e9)
            self._middleware.at(due_ns, lambda: self._middleware.defer(lambda: self._report(goal_id)))

    def _report(self, goal_id: str) -> None:
        """Send the progress of a goal, and again after a period; not before the hook has answered."""
        if goal_id in self._goals:
            self._engine.ask_progress(goal_id, lambda progress: self._told(goal_id, progress))

    def _told(self, goal_id: str, progress: float | None) -> None:
        goal, execution = self._goals.get(goal_id), self._engine.execution(goal_id)
        if goal is None or execution is None:
            return
        if progress is not None:
            goal.report(progress, execution.state, dict(execution.outputs))
        self._report_later(goal_id)
