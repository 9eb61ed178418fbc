"""The error of this room."""

from __future__ import annotations

from alula.common.errors import AlulaError


class RepairError(AlulaError):
    """A repair can't be requested so; the message has the error and the remedy."""
