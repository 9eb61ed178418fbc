"""What this room complains of."""

from __future__ import annotations

from alula.common.errors import AlulaError


class OddsError(AlulaError):
    """The odds can't be had; the message says why, where, and what would be right."""
