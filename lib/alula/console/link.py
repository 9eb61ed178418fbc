"""What the page needs of a robot whose run is under way, whatever it is reached over. An adapter makes it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from threading import Lock
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

from alula.common.runs import Run

if TYPE_CHECKING:
    from alula.console.view import SkillsetView
    from alula.runtime.client import Client
    from alula.runtime.handle import SkillHandle


class ActError(Exception):
    """A request can't be executed; the message has the reason."""


class Closable(Protocol):
    """A subscription or connection, open until it is closed."""

    def close(self) -> None:
        """Close it; what runs on the robot keeps running, and calls that wait for an answer raise ActError."""
        ...


class Mission(Closable, Protocol):
    """The mission of a run. Its methods wait for the answer and may be called from any thread; asking again changes nothing."""

    def abort(self) -> str:
        """Abort the mission; return its answer. Raises ActError where it does not answer."""
        ...

    def set_paused(self, *, paused: bool) -> str:
        """Pause or resume the mission; return its answer. Raises ActError where it refuses, or does not answer."""
        ...


class Skillset(Protocol):
    """One skillset that has described itself."""

    @property
    def root(self) -> str:
        """Namespace and name, as ``/navigation``."""
        ...

    @property
    def client(self) -> Client:
        """The client of its managers."""
        ...

    @property
    def view(self) -> SkillsetView | None:
        """What was received from its managers."""
        ...

    def start(self, skill: str, inputs: dict[str, object]) -> SkillHandle:
        """Start a skill; raise ValueError."""
        ...


class Skillsets(Closable, Protocol):
    """The skillsets of one run, subscribed to until closed."""

    @property
    def watched(self) -> Sequence[Skillset]:
        """The skillsets that have described themselves."""
        ...

    @property
    def problems(self) -> Sequence[str]:
        """What keeps others from being shown, a sentence each."""
        ...

    @property
    def now_ns(self) -> int:
        """Mission clock, nanoseconds."""
        ...


class Link(Protocol):
    """How robots are reached: by their run. Both methods take up to a second; what they return is used many times."""

    def connect(self, run: Run) -> Mission:
        """Return the mission of a run, which may come later, end, and come again. Raises ActError where nothing can be reached at all."""
        ...

    def listen(self, run: Run) -> Skillsets:
        """Return the skillsets of a run. Raises ActError where nothing can be reached at all."""
        ...


T = TypeVar("T", bound=Closable)


class PerRun(Generic[T]):
    """A connection for each run, made by ``make(run)`` at its first use and closed when the run is no longer wanted.

    A run that is started anew, be it in another domain, is another run.
    """

    def __init__(self, make: Callable[[Run], T]) -> None:
        self._make = make
        self._open: dict[Run, T] = {}
        self._lock = Lock()

    def of(self, run: Run) -> T:
        """Return the connection of a run; the first call opens it."""
        with self._lock:
            if run not in self._open:
                self._open[run] = self._make(run)
            return self._open[run]

    def keep(self, runs: set[Run]) -> None:
        """Close the connections of all runs but these."""
        with self._lock:
            leaving = [self._open.pop(run) for run in set(self._open) - runs]
        for one in leaving:
            one.close()
