"""Errors of the engine, its managers and its clients, under one root."""

from __future__ import annotations

from alula.common.errors import AlulaError
from alula.common.public import public


@public()
class SkillRuntimeError(AlulaError):
    """Root of the errors of this package."""
