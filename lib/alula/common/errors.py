"""The root of the errors that a user's program may meet."""

from __future__ import annotations

from alula.common.public import public


@public()
class AlulaError(Exception):
    """Something that was given to Alula can't be used, or did not work; the message says what, where, and what to do about it."""
