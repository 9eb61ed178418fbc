"""Execution of skillsets without ROS: takes the steps of ``skill_model.semantics`` and calls the hooks between them."""

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.core.execution import Execution
from skill_runtime.core.records import ExecutionRecord, SkillRecord
from skill_runtime.core.replies import PauseReply, TransitionReply
from skill_runtime.core.why import Unmet, Why

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
