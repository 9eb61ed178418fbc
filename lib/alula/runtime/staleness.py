"""Decide when reports of the functional layer are too old: values of data, and states of resources."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from alula.model.model import Skillset

if TYPE_CHECKING:
    from alula.runtime.middleware import Middleware

STALE_PERIODS = 3.0
"""A value is stale when it is older than so many of the periods that the model promises."""


def limit_ns(period_s: float | None) -> int | None:
    """Return the age at which a value is stale; None: one without a promised period never is."""
    return None if period_s is None else round(STALE_PERIODS * period_s * 1e9)


def is_stale(age_ns: int, period_s: float | None) -> bool:
    """Return whether a value of this age is stale."""
    limit = limit_ns(period_s)
    return limit is not None and age_ns > limit


def with_silences(skillset: Skillset, given_s: Callable[[str, float], float]) -> Skillset:
    """Return the skillset as a deployment has it: ``given_s(resource, model_s)`` returns a resource's silence, seconds."""
    return replace(
        skillset,
        resources=tuple(
            one if one.silence_s is None else replace(one, silence_s=given_s(one.name, one.silence_s)) for one in skillset.resources
        ),
    )


class StalenessWatch:
    """Reports once when a source that has sent something falls silent; it is watched again from its next message on.

    There is one timer a source at a time, for the moment at which its last message would be stale.

    Args:
        middleware: its clock and timers.
        on_stale: called with the source's name, on the middleware's loop.
    """

    def __init__(self, middleware: Middleware, on_stale: Callable[[str], None]) -> None:
        self._middleware = middleware
        self._on_stale = on_stale
        self._sampled_ns: dict[str, int] = {}
        self._watched: set[str] = set()
        self._lock = threading.Lock()

    def on_sample(self, name: str, stamp_ns: int, limit_ns: int) -> None:
        """Note that a source has sent something at ``stamp_ns``; without more within ``limit_ns`` it is stale; from any thread."""
        with self._lock:
            self._sampled_ns[name] = stamp_ns
            first = name not in self._watched
            self._watched.add(name)
        if first:
            self._look_at(name, stamp_ns, limit_ns)

    def silent_ns(self, name: str) -> int | None:
        """Return for how long a stale source has sent nothing; None: it is not stale."""
        with self._lock:
            return None if name in self._watched or name not in self._sampled_ns else self._middleware.now_ns() - self._sampled_ns[name]

    def forget(self) -> None:
        """Watch no source until it sends something again."""
        with self._lock:
            self._sampled_ns.clear()
            self._watched.clear()

    def _look_at(self, name: str, stamp_ns: int, limit_ns: int) -> None:
        def look() -> None:
            with self._lock:
                latest_ns = self._sampled_ns.get(name)
                stale = latest_ns is not None and latest_ns <= stamp_ns
                if stale:
                    self._watched.discard(name)
            if latest_ns is None:
                return
            if stale:
                self._on_stale(name)
            else:
                self._look_at(name, latest_ns, limit_ns)

        self._middleware.at(stamp_ns + limit_ns + 1, look)
