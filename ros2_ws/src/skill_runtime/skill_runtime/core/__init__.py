"""Execution of skillsets without ROS: what a step is (``semantics``), and who takes steps (``engine``)."""

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, ExecutionEvent, TransitionEvent
from skill_runtime.core.execution import Execution, ExecutionState

__all__ = ["EngineEvent", "Execution", "ExecutionEvent", "ExecutionState", "SkillsetEngine", "TransitionEvent"]
