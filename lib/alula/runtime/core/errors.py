"""Errors of the runtime."""

from __future__ import annotations


class SkillRuntimeError(Exception):
    """Root of the errors of this package."""
