"""Execution of skillsets without ROS: what a step is (``semantics``), and who takes steps (``engine``)."""

from skill_runtime.core.engine import SkillsetEngine, TransitionReply
from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.core.execution import Execution, ExecutionState
from skill_runtime.core.pauses import PauseReply
from skill_runtime.core.records import ExecutionRecord, SkillRecord
from skill_runtime.core.why import Unmet, Why

__all__ = [
    "EngineEvent",
    "Execution",
    "ExecutionEvent",
    "ExecutionRecord",
    "ExecutionState",
    "PauseReply",
    "SkillRecord",
    "SkillsetEngine",
    "TransitionEvent",
    "TransitionReply",
    "Unmet",
    "Why",
]
