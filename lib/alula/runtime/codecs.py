"""Between the values of the port and the static messages of the skillset interface, in either ROS world.

The classes of the messages take the same arguments in both worlds. An adapter gives its own, so that nothing here imports ROS.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from alula.common.plain import to_plain
from alula.model.execution_state import ExecutionState
from alula.model.unmet import Unmet
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent, kind_record, read_kind, read_unmet, unmet_record
from alula.runtime.core.records import ExecutionRecord, ResourceStatus, SkillRecord
from alula.runtime.core.replies import PauseReply, TransitionReply
from alula.runtime.core.why import Why
from alula.runtime.middleware import (
    EVENTS,
    REPORTED,
    RESOURCE_STATES,
    SKILL_STATES,
    ResourceStates,
    SkillStates,
    Topic,
    WhyReply,
)
from alula.runtime.mission_clock import MissionClock
from alula.runtime.views import DataReading, Sample

NANOSECONDS = 1_000_000_000


def set_stamp(stamp: Any, stamp_ns: int) -> None:
    """Set a time of either world."""
    seconds, rest = divmod(stamp_ns, NANOSECONDS)
    if hasattr(stamp, "nanosec"):
        stamp.sec, stamp.nanosec = seconds, rest
    else:
        stamp.secs, stamp.nsecs = seconds, rest


def stamp_ns_of(stamp: Any) -> int:
    """Return a time of either world."""
    seconds, rest = (stamp.sec, stamp.nanosec) if hasattr(stamp, "nanosec") else (stamp.secs, stamp.nsecs)
    return int(seconds) * NANOSECONDS + int(rest)


@dataclass(frozen=True)
class TopicCodec:
    """``encode(skillset, value)`` makes a message, ``decode(message)`` the value again."""

    kind: Any
    """The message's class; None where only the graph knows it."""
    encode: Callable[[str, Any], Any]
    decode: Callable[[Any], Any]


@dataclass(frozen=True)
class ServiceCodec:
    """``encode(value, response)`` fills a response, ``decode(response)`` makes the value; a request has the fields of its type."""

    kind: Any
    fields: tuple[str, ...]
    encode: Callable[[Any, Any], None]
    decode: Callable[[Any], Any]


def _encode_transition(reply: TransitionReply, response: Any) -> None:
    response.accepted, response.reason, response.state = reply.accepted, reply.reason, reply.state


def _encode_trigger(reply: TransitionReply | PauseReply, response: Any) -> None:
    response.accepted, response.reason = reply.accepted, reply.reason


def _encode_describe(model_json: str, response: Any) -> None:
    response.model_json = model_json


def event_of(message: Any, stamp_ns: int) -> EngineEvent:
    """Return an event of this moment; inputs and outputs are plain values."""
    if message.kind == type(message).TRANSITION:
        states = (message.resource, message.from_state, message.to_state)
        return TransitionEvent(message.sequence, stamp_ns, *states, message.cause, message.skillset, message.reason, message.instance_id)
    return ExecutionEvent(
        message.sequence,
        stamp_ns,
        message.skill,
        message.id,
        ExecutionState(message.state),
        message.result,
        message.message,
        json.loads(message.inputs_json or "null"),
        json.loads(message.outputs_json or "{}"),
        message.skillset,
        read_kind(message.result_kind),
        read_unmet(json.loads(message.unmet_json or "null")),
        message.instance_id,
    )


class Codecs:
    """The codecs of one skillset's topics and services, for the messages of one ROS world.

    Most of what the messages of states hold is what the one before has held: with many skills, to rebuild it would take most of the
    time. Of each name the last is kept, here and not in the module: robots and threads of one process share nothing.

    Args:
        messages: the module ``skillset_interfaces.msg`` of the world, ``services`` its ``skillset_interfaces.srv``.
        message_class: returns the class of ``package/Name``.
        clock: converts the stamps.
    """

    def __init__(self, messages: Any, services: Any, message_class: Callable[[str], Any], clock: MissionClock) -> None:
        self._messages = messages
        self._message_class = message_class
        self._clock = clock
        # What is kept is true as long as the wall clock is not set.
        self._set_ns = clock.set_ns
        self._resources: dict[str, tuple[ResourceStatus, Any]] = {}
        self._encoded: dict[str, tuple[SkillRecord, Any]] = {}
        self._decoded: dict[str, tuple[tuple[Any, ...], SkillRecord]] = {}
        self._topics: Mapping[str, TopicCodec] = {
            EVENTS.name: TopicCodec(messages.Event, self._event_message, self._event_of),
            RESOURCE_STATES.name: TopicCodec(messages.ResourceStates, self._states_message, self._states_of),
            REPORTED.name: TopicCodec(messages.ResourceStates, self._states_message, self._states_of),
            SKILL_STATES.name: TopicCodec(messages.SkillStates, self._skills_message, self._skills_of),
        }
        self.services: Mapping[str, ServiceCodec] = self._service_codecs(services)
        """By name of the service."""

    def topic(self, topic: Topic) -> TopicCodec:
        """Return the codec of a topic: its own, or that of a data, whose values are ``Sample``s."""
        if topic.name in self._topics:
            return self._topics[topic.name]
        kind: Any = self._message_class(topic.type_name) if topic.type_name else None
        if topic.wrapped:
            return TopicCodec(kind, lambda _, sample: kind(data=sample.value), lambda message: Sample(message.data, None))
        return TopicCodec(kind, lambda _, sample: sample.value, lambda message: Sample(message, None))

    # --- topics ------------------------------------------------------------------------------------------------------

    def _stamp(self, message: Any, moment_ns: int) -> None:
        set_stamp(message.header.stamp, self._clock.stamp_ns(moment_ns))

    def _moment_of(self, message: Any) -> int:
        return self._clock.moment_ns(stamp_ns_of(message.header.stamp))

    def _forget_where_set(self) -> None:
        """Keep nothing that was made before the wall clock was set: its stamps would be of another time."""
        set_ns = self._clock.set_ns
        if set_ns != self._set_ns:
            self._set_ns = set_ns
            for kept in (self._resources, self._encoded, self._decoded):
                kept.clear()

    def _event_of(self, message: Any) -> EngineEvent:
        return event_of(message, self._moment_of(message))

    def _event_message(self, skillset: str, event: EngineEvent) -> Any:
        """Return an event as a message; its outputs are there when it is the last of its execution."""
        kind = self._messages.Event
        message = kind(skillset=skillset, instance_id=event.instance_id, sequence=event.sequence)
        self._stamp(message, event.stamp_ns)
        if isinstance(event, ExecutionEvent):
            message.kind = kind.EXECUTION
            message.skill, message.id, message.state = event.skill, event.id, event.state.value
            message.result, message.result_kind, message.message = event.result, kind_record(event.result_kind), event.message
            if event.unmet:
                message.unmet_json = json.dumps(unmet_record(event.unmet))
            message.inputs_json = json.dumps(to_plain(event.inputs))
            if event.state.terminal:
                message.outputs_json = json.dumps(to_plain(event.outputs))
        else:
            message.kind = kind.TRANSITION
            message.resource, message.cause, message.reason = event.resource, event.cause, event.reason
            message.from_state, message.to_state = event.from_state, event.to_state
        return message

    def _states_message(self, skillset: str, states: ResourceStates) -> Any:
        """Return resource states as a message."""
        self._forget_where_set()
        resources = [self._resource(name, one) for name, one in states.resources.items()]
        message = self._messages.ResourceStates(
            skillset=skillset, instance_id=states.instance_id, sequence=states.sequence, resources=resources
        )
        self._stamp(message, states.stamp_ns)
        return message

    def _states_of(self, message: Any) -> ResourceStates:
        values = {
            one.name: ResourceStatus(one.state, one.previous_state, self._clock.moment_ns(one.stamp_ns), one.reason)
            for one in message.resources
        }
        return ResourceStates(message.instance_id, message.sequence, self._moment_of(message), values)

    def _skills_message(self, skillset: str, states: SkillStates) -> Any:
        self._forget_where_set()
        skills = [self._skill(name, one) for name, one in states.skills.items()]
        message = self._messages.SkillStates(skillset=skillset, instance_id=states.instance_id, skills=skills)
        self._stamp(message, states.stamp_ns)
        return message

    def _skills_of(self, message: Any) -> SkillStates:
        """Return skill states; inputs and outputs are plain values."""
        self._forget_where_set()
        skills = {one.name: self._skill_of(one) for one in message.skills}
        return SkillStates(message.instance_id, self._moment_of(message), skills)

    def _resource(self, name: str, value: ResourceStatus) -> Any:
        kept, message = self._resources.get(name, (None, None))
        if kept != value:
            message = self._resource_state(name, value.state, value)
            self._resources[name] = (value, message)
        return message

    def _resource_state(self, name: str, state: str, status: ResourceStatus) -> Any:
        return self._messages.ResourceState(
            name=name, state=state, previous_state=status.previous, stamp_ns=self._clock.stamp_ns(status.stamp_ns), reason=status.reason
        )

    def _skill(self, name: str, skill: SkillRecord) -> Any:
        kept, message = self._encoded.get(name, (None, None))
        if kept is not skill:
            last = [] if skill.last is None else [self._execution(skill.last)]
            message = self._messages.SkillState(name=name, open=[self._execution(record) for record in skill.open], last=last)
            self._encoded[name] = (skill, message)
        return message

    def _skill_of(self, message: Any) -> SkillRecord:
        executions = (*message.open, *message.last)
        # An execution of the same state and stamps holds the same.
        now = (len(message.last), *((e.id, e.state, e.requested_ns, e.started_ns, e.ended_ns) for e in executions))
        kept = self._decoded.get(message.name)
        if kept is None or kept[0] != now:
            last = [self._record_of(message.name, execution) for execution in message.last]
            record = SkillRecord(tuple(self._record_of(message.name, one) for one in message.open), last[0] if last else None)
            kept = self._decoded[message.name] = (now, record)
        return kept[1]

    def _execution(self, record: ExecutionRecord) -> Any:
        return self._messages.SkillExecution(
            id=record.id,
            state=record.state.value,
            result=record.result,
            message=record.message,
            inputs_json=json.dumps(to_plain(record.inputs)),
            outputs_json=json.dumps(to_plain(record.outputs) if record.state.terminal else {}),
            requested_ns=self._clock.stamp_ns(record.requested_ns),
            started_ns=-1 if record.started_ns is None else self._clock.stamp_ns(record.started_ns),
            ended_ns=-1 if record.ended_ns is None else self._clock.stamp_ns(record.ended_ns),
        )

    def _record_of(self, skill: str, message: Any) -> ExecutionRecord:
        return ExecutionRecord(
            message.id,
            skill,
            ExecutionState(message.state),
            message.result,
            message.message,
            json.loads(message.inputs_json or "null"),
            json.loads(message.outputs_json or "{}"),
            self._clock.moment_ns(message.requested_ns),
            self._happened(message.started_ns),
            self._happened(message.ended_ns),
        )

    def _happened(self, stamp_ns: int) -> int | None:
        """Return the moment of a stamp; one below 0: it has not happened."""
        return None if stamp_ns < 0 else self._clock.moment_ns(stamp_ns)

    # --- services ----------------------------------------------------------------------------------------------------

    def _service_codecs(self, services: Any) -> Mapping[str, ServiceCodec]:
        return {
            "describe": ServiceCodec(services.Describe, (), _encode_describe, lambda response: response.model_json),
            "get_data": ServiceCodec(services.GetData, ("name",), self._encode_data, self._decode_data),
            "pause": ServiceCodec(services.SetPaused, ("id", "paused"), _encode_trigger, lambda r: PauseReply(r.accepted, r.reason)),
            "transition": ServiceCodec(
                services.Transition,
                ("resource", "to", "reason"),
                _encode_transition,
                lambda r: TransitionReply(r.accepted, r.reason, r.state),
            ),
            "trigger": ServiceCodec(
                services.TriggerEvent, ("event",), _encode_trigger, lambda r: TransitionReply(r.accepted, r.reason, "")
            ),
            "why": ServiceCodec(services.Why, ("skill", "inputs_json"), self._encode_why, self._decode_why),
        }

    def _encode_data(self, reading: DataReading, response: Any) -> None:
        response.known, response.received, response.stale = reading.known, reading.received, reading.stale
        response.stamp_ns = self._clock.stamp_ns(reading.stamp_ns) if reading.received else 0
        response.value_json = reading.value_json

    def _decode_data(self, response: Any) -> DataReading:
        moment_ns = self._clock.moment_ns(response.stamp_ns)
        return DataReading(response.known, response.received, response.stale, moment_ns, response.value_json)

    def _encode_why(self, reply: WhyReply, response: Any) -> None:
        response.known = reply.why is not None
        if reply.why is None:
            response.reason = reply.error
            return
        why = reply.why
        response.ready, response.reason, response.refusal = why.ready, why.reason, why.refusal
        response.unmet = [self._unmet(one, reply) for one in why.unmet]
        response.history = [
            self._messages.ResourceTransition(
                stamp_ns=self._clock.stamp_ns(one.stamp_ns),
                resource=one.resource,
                from_state=one.from_state,
                to_state=one.to_state,
                cause=one.cause,
                reason=one.reason,
            )
            for one in why.history
        ]

    def _decode_why(self, response: Any) -> WhyReply:
        if not response.known:
            return WhyReply(response.reason)
        found = tuple(
            Unmet(
                one.name,
                one.condition,
                one.reason,
                {resource.name: resource.state for resource in one.resources},
                {data.name: json.loads(data.value_json) if data.value_json else None for data in one.data},
            )
            for one in response.unmet
        )
        history = tuple(
            TransitionEvent(
                0, self._clock.moment_ns(one.stamp_ns), one.resource, one.from_state, one.to_state, one.cause, reason=one.reason
            )
            for one in response.history
        )
        return WhyReply("", Why("", response.ready, response.reason, response.refusal, found, history))

    def _unmet(self, one: Unmet, reply: WhyReply) -> Any:
        values = {name: "" if value is None else json.dumps(to_plain(value)) for name, value in one.data.items()}
        return self._messages.Unmet(
            name=one.name,
            condition=one.condition,
            reason=one.reason,
            resources=[self._resource_state(name, state, reply.resources[name]) for name, state in one.states.items()],
            data=[self._messages.DataValue(name=name, value_json=text) for name, text in values.items()],
        )
