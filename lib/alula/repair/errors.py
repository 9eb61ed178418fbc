"""What keeps a repair from being asked for."""

from __future__ import annotations

from alula.common.errors import AlulaError


class RepairError(AlulaError):
    """A repair can't be asked for so; the message says what is wrong and what to write."""
