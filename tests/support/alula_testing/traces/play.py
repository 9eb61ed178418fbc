"""Plays a script on a stage and tells what came of it."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

from navigation_managers.hooks import ABSTRACT_HOOKS

from alula.model.execution_state import ExecutionState
from alula.runtime.handle import SkillHandle
from alula_testing.traces.hooks import After, ScriptedHooks
from alula_testing.traces.script import Script, Step
from alula_testing.traces.stage import Client, MakeStage, Stage

Trace = dict[str, Any]
_EVENT_FIELDS = {
    "EXECUTION": ("skill", "id", "state", "result", "message", "inputs", "outputs", "result_kind", "unmet"),
    "TRANSITION": ("resource", "from_state", "to_state", "cause"),
}
_CURTAIN = ("homepoint_status", {"VALID": "INVALID", "INVALID": "VALID"})
"""The resource that is changed at the very end: a client that has heard that has heard everything."""


class Player:
    """One play."""

    def __init__(self, script: Script, make_stage: MakeStage) -> None:
        self._script = script
        self._hooks: dict[str, ScriptedHooks] = {}
        self._handles: dict[str, SkillHandle] = {}
        self._replies: list[Any] = []
        self._stage: Stage = make_stage(self._make_hooks)
        self._clients: dict[int, Client] = {}
        self._do: dict[str, Callable[[Step], None]] = {
            "start": self._start,
            "interrupt": self._interrupt,
            "finish": self._finish,
            "fail": self._fail,
            "transition": self._transition,
            "pause": lambda step: self._set_paused(step, paused=True),
            "resume": lambda step: self._set_paused(step, paused=False),
            "why": lambda step: self._replies.append(self._stage.why(step.skill, step.inputs)),
            "late": self._late,
        }

    def play(self) -> Trace:
        """Play all steps; return the trace."""
        try:
            for step in self._script.steps:
                self._do[step.do](step)
                self._stage.until(self._settled, f"nothing follows any more from {step}")
            self._drop_the_curtain()
            trace: Trace = {
                "events": [self._told(event) for event in self._stage.events()],
                "ends": {label: [h.outcome, h.result, h.message, h.done] for label, h in self._handles.items()},
                "validated": {skill: hooks.validated for skill, hooks in self._hooks.items()},
                "replies": self._replies,
                "resources": self._client(0).resources,
            }
        finally:
            self._stage.close()
        # The last hooks may have come after the last event.
        trace["hooks"] = {label: self._hooks[h.skill].calls.get(h.id, []) for label, h in self._handles.items()}
        return self._with_labels(trace)

    # --- stimuli -----------------------------------------------------------------------------------------------------

    def _start(self, step: Step) -> None:
        self._handles[step.label] = self._client(step.client).start(step.skill, **step.inputs)

    def _interrupt(self, step: Step) -> None:
        handle = self._handles[step.label]
        handle.interrupt()
        self._stage.until(lambda: handle.done, f"{handle} ends")

    def _finish(self, step: Step) -> None:
        handle = self._handles[step.label]
        self._replies.append([self._stage.engine.terminate(handle.id, step.result)])
        self._stage.until(lambda: handle.done, f"{handle} ends")

    def _fail(self, step: Step) -> None:
        handle = self._handles[step.label]
        self._replies.append([self._stage.engine.fail(handle.id, "asked to")])
        self._stage.until(lambda: handle.done, f"{handle} ends")

    def _transition(self, step: Step) -> None:
        self._replies.append(list(self._stage.transition(step.resource, step.state)))

    def _set_paused(self, step: Step, *, paused: bool) -> None:
        self._replies.append(self._stage.set_paused(self._handles[step.label].id, paused=paused))

    def _late(self, step: Step) -> None:
        client, skills = self._stage.client(), self._stage.engine.skills
        ended = {skill: record.last.id for skill, record in skills.items() if record.last is not None}

        def is_told() -> bool:
            told = {skill: self._stage.last(client, skill) for skill in skills}
            return {skill: last[0] for skill, last in told.items() if last is not None} == ended

        self._stage.until(is_told, f"the last results are known to a client that comes {step.do}")
        self._replies.append([client.resources, {skill: self._stage.last(client, skill) for skill in ended}])

    # --- what follows ------------------------------------------------------------------------------------------------

    def _settled(self) -> bool:
        return all(self._is_settled(handle) for handle in self._handles.values())

    def _is_settled(self, handle: SkillHandle) -> bool:
        """Return whether an execution has ended for both sides, or runs, was dispatched and does not end by itself."""
        if self._stage.engine.execution(handle.id) is None:
            return handle.done
        hooks = self._hooks[handle.skill]
        running = not handle.done and handle.state is not ExecutionState.REQUESTED
        return running and handle.id in hooks.dispatched and handle.id not in hooks.ending

    def _drop_the_curtain(self) -> None:
        resource, other = _CURTAIN
        state = other[self._stage.engine.resources[resource].state]
        self._stage.transition(resource, state)
        # The state, too: the script's own last step may have moved this resource, but not there.
        fallen = (resource, state)
        self._stage.until(
            lambda: any((e.get("resource"), e.get("to_state")) == fallen for e in self._stage.events()[-1:]), "all events are heard"
        )
        client = self._client(0)
        self._stage.until(lambda: client.resources.get(resource) == state, "all changes are known")

    # --- parts -------------------------------------------------------------------------------------------------------

    def _make_hooks(self, after: After) -> dict[str, ScriptedHooks]:
        for skill, abstract in ABSTRACT_HOOKS.items():
            self._hooks[skill] = ScriptedHooks(abstract.inputs_type, self._script.behaviours.get(skill, ()), after)
        return self._hooks

    def _client(self, number: int) -> Client:
        if number not in self._clients:
            self._clients[number] = self._stage.client()
        return self._clients[number]

    @staticmethod
    def _told(event: dict[str, Any]) -> list[Any]:
        return [event["sequence"], *(event[field] for field in _EVENT_FIELDS[event["kind"]])]

    def _with_labels(self, trace: Trace) -> Trace:
        """Return the trace with labels for the ids that each play makes again."""
        text = json.dumps(trace)
        for label, handle in self._handles.items():
            if handle.id:
                text = text.replace(handle.id, label)
        labelled: Trace = json.loads(text)
        return labelled


def play(script: Script, make_stage: MakeStage) -> Trace:
    """Return what comes of a script."""
    return Player(script, make_stage).play()
