"""Hooks that write down how they are called."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from alula.runtime.core import Execution
from alula.runtime.hooks import SkillHooks


class Recorder(SkillHooks):
    """Writes down the calls; ``acts`` maps a hook's name to what it does with the execution (``validate``: with the inputs)."""

    def __init__(self) -> None:
        self.calls: list[str] = []
        self.acts: dict[str, Callable[[Any], Any]] = {}
        self.dispatched = threading.Event()

    def _note(self, name: str, value: object) -> Any:
        self.calls.append(name)
        return self.acts[name](value) if name in self.acts else None

    def validate(self, inputs: object) -> str:
        """Accept."""
        value = self._note("validate", inputs)
        return value if "validate" in self.acts else ""

    def on_dispatch(self, execution: Execution) -> None:
        """Be dispatched."""
        self._note("on_dispatch", execution)
        self.dispatched.set()

    def progress(self, execution: Execution) -> float:
        """Be half way."""
        value = self._note("progress", execution)
        return 0.5 if value is None else value

    def on_interrupt(self, execution: Execution) -> bool | None:
        """Be interrupted at once."""
        return self._note("on_interrupt", execution)

    def on_emergency(self, execution: Execution) -> None:
        """Be interrupted too late."""
        self._note("on_emergency", execution)

    def on_pause(self, execution: Execution) -> str | None:
        """Pause."""
        return self._note("on_pause", execution)

    def on_resume(self, execution: Execution) -> str | None:
        """Go on."""
        return self._note("on_resume", execution)

    def on_violation(self, execution: Execution) -> None:
        """Be stopped."""
        self._note("on_violation", execution)

    def on_failure(self, execution: Execution) -> None:
        """Be stopped."""
        self._note("on_failure", execution)
