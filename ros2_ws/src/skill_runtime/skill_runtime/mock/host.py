"""What a mock robot needs of the middleware that serves its skillsets."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Job = Callable[[], None]


class Appointment(Protocol):
    """A job that waits for its moment."""

    def cancel(self) -> None:
        """Let the job not happen; without effect when it has."""
        ...


class MockHost(Protocol):
    """A clock that does jobs, and the functional layer's side of the skillsets; jobs may come from any thread."""

    @property
    def now_s(self) -> float:
        """Mission clock."""
        ...

    @property
    def notes(self) -> list[str]:
        """What went wrong and belongs to no execution."""
        ...

    def after(self, delay_s: float, job: Job) -> Appointment:
        """Have a job done after a delay of mission clock."""
        ...

    def transition(self, skillset: str, resource: str, to: str) -> str:
        """Take an extern transition; return "" or why it was refused."""
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
