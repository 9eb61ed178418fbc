"""Errors of the engine, its managers and its clients, under one root."""

from __future__ import annotations


class SkillRuntimeError(Exception):
    """Root of the errors of this package."""
