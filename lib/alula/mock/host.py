"""What a mock robot needs of the middleware that serves its skillsets."""

from __future__ import annotations

from typing import Protocol

from alula.runtime.timers import Job, Timer


class MockHost(Protocol):
    """A clock that does jobs, and the functional layer's side of the skillsets; jobs may come from any thread."""

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        ...

    @property
    def notes(self) -> list[str]:
        """What went wrong and belongs to no execution."""
        ...

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of mission clock."""
        ...

    def transition(self, skillset: str, resource: str, to: str, reason: str) -> str:
        """Take an extern transition for this reason; return "" or why it was refused."""
        ...

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource, empty when the skillset is not there."""
        ...

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Publish a value of a data; fields of a message are a mapping."""
        ...

    def note(self, error: str) -> None:
        """Tell of what went wrong and belongs to no execution."""
        ...
