"""The root of the errors that a user's program may meet."""

from __future__ import annotations

from alula.common.public import public


@public()
class AlulaError(Exception):
    """Base of Alula's errors: an input can't be used, or an operation has failed; the message says what, where, and the remedy."""
