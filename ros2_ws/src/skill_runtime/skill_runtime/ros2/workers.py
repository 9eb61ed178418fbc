"""The threads for hooks, which are the same over every middleware."""

from skill_runtime.workers import Job, Workers

__all__ = ["Job", "Workers"]
