"""The static messages of the skillset interface, made in either ROS world: their classes take the same words in both."""

from __future__ import annotations

import json
from typing import Any

from skillset_interfaces.msg import DataValue, Event, ResourceState, ResourceTransition, SkillExecution, SkillState, Unmet

from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.core.records import ExecutionRecord, SkillRecord
from skill_runtime.core.why import Unmet as UnmetPrecondition
from skill_runtime.core.why import Why
from skill_runtime.plain import to_plain


def event_message(skillset: str, event: EngineEvent) -> Any:
    """Return an engine's event as a message, without its header."""
    message = Event(skillset=skillset, sequence=event.sequence)
    if isinstance(event, ExecutionEvent):
        message.kind = Event.EXECUTION
        message.skill, message.id, message.state = event.skill, event.id, event.state.value
        message.result, message.message = event.result, event.message
        message.inputs_json = json.dumps(to_plain(event.inputs))
        if event.state.terminal:
            message.outputs_json = json.dumps(to_plain(event.outputs))
    else:
        message.kind = Event.TRANSITION
        message.resource, message.cause = event.resource, event.cause
        message.from_state, message.to_state = event.from_state, event.to_state
    return message


def skill_message(name: str, skill: SkillRecord) -> Any:
    """Return what is known of a skill as a message."""
    last = [] if skill.last is None else [execution_message(skill.last)]
    return SkillState(name=name, open=[execution_message(record) for record in skill.open], last=last)


def execution_message(record: ExecutionRecord) -> Any:
    """Return an execution's record as a message."""
    return SkillExecution(
        id=record.id,
        state=record.state.value,
        result=record.result,
        message=record.message,
        inputs_json=json.dumps(to_plain(record.inputs)),
        outputs_json=json.dumps(to_plain(record.outputs) if record.state.terminal else {}),
        requested_ns=record.requested_ns,
        started_ns=record.started_ns,
        ended_ns=record.ended_ns,
    )


def fill_why(response: Any, why: Why, resources: Any) -> Any:
    """Fill the response of the service ``why``; return it."""
    response.known, response.ready, response.reason, response.refusal = True, why.ready, why.reason, why.refusal
    for one in why.unmet:
        states = [(name, state, resources[name]) for name, state in one.states.items()]
        response.unmet.append(
            Unmet(
                name=one.name,
                condition=one.condition,
                reason=one.reason,
                resources=[
                    ResourceState(name=name, state=state, previous_state=s.previous, stamp_ns=s.stamp_ns) for name, state, s in states
                ],
                data=[data_message(name, value) for name, value in one.data.items()],
            )
        )
    response.history = [
        ResourceTransition(stamp_ns=e.stamp_ns, resource=e.resource, from_state=e.from_state, to_state=e.to_state, cause=e.cause)
        for e in why.history
    ]
    return response


def data_message(name: str, value: object) -> Any:
    """Return a data's value as a message; None for no fresh value."""
    return DataValue(name=name, value_json="" if value is None else json.dumps(to_plain(value)))


def why_of(skill: str, response: Any) -> Why:
    """Return the managers' answer to ``why`` as they have it themselves."""
    found = tuple(
        UnmetPrecondition(
            one.name,
            one.condition,
            one.reason,
            {resource.name: resource.state for resource in one.resources},
            {data.name: json.loads(data.value_json) if data.value_json else None for data in one.data},
        )
        for one in response.unmet
    )
    history = tuple(TransitionEvent(0, e.stamp_ns, e.resource, e.from_state, e.to_state, e.cause) for e in response.history)
    return Why(skill, response.ready, response.reason, response.refusal, found, history)
