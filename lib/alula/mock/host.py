"""What a mock robot needs of the middleware that serves its skillsets."""

from __future__ import annotations

from typing import Protocol

from alula.runtime.timers import Job, Timer


class MockHost(Protocol):
    """A clock that runs jobs, and the functional layer's interface to the skillsets; methods may be called in any thread."""

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        ...

    @property
    def notes(self) -> list[str]:
        """Errors that belong to no execution."""
        ...

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of mission clock."""
        ...

    def transition(self, skillset: str, resource: str, to: str, reason: str) -> str:
        """Request an extern transition; return "" or why it was refused."""
        ...

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource, empty when the skillset is not there."""
        ...

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Publish a value of a data; fields of a message are a mapping."""
        ...

    def note(self, error: str) -> None:
        """Report an error that belongs to no execution."""
        ...
