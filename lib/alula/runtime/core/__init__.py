"""Execution of skillsets without ROS: takes the steps of ``alula.model.semantics`` and calls the hooks between them."""

from alula.model.unmet import Unmet
from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from alula.runtime.core.execution import Execution
from alula.runtime.core.records import ExecutionRecord, SkillRecord
from alula.runtime.core.replies import PauseReply, TransitionReply
from alula.runtime.core.why import Why

__all__ = [
    "EngineEvent",
    "Execution",
    "ExecutionEvent",
    "ExecutionRecord",
    "PauseReply",
    "SkillRecord",
    "SkillsetEngine",
    "TransitionEvent",
    "TransitionReply",
    "Unmet",
    "Why",
]
