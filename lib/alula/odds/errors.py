"""The error of this room."""

from __future__ import annotations

from alula.common.errors import AlulaError


class OddsError(AlulaError):
    """The odds can't be computed; the message has the reason, the place, and the remedy."""
