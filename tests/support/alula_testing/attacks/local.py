"""The managers and their clients in virtual time: nothing to freeze, nothing to start."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET

from alula.runtime.local import LocalWorld
from alula_testing.attacks.hooks import tame_hooks

TIMEOUT_S = 60.0


class LocalGraph:
    """One world."""

    def __init__(self) -> None:
        self.world = LocalWorld()
        self.world.serve(SKILLSET, tame_hooks(ABSTRACT_HOOKS))
        self._client = self.world.client(SKILLSET.name)

    def client(self) -> Any:
        """Return the one client of this world."""
        assert self._client.wait_ready(TIMEOUT_S)
        return self._client

    def until(self, condition: Callable[[], object], what: str) -> None:
        """Let virtual time pass until the condition holds."""
        assert self.world.run_until(lambda: bool(condition()), timeout_s=TIMEOUT_S), what
