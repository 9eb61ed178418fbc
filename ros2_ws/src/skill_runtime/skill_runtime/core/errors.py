"""Errors of the runtime."""

from __future__ import annotations


class SkillRuntimeError(Exception):
    """Root of the errors of this package."""


class EffectError(SkillRuntimeError):
    """An effect is no transition of a resource; the message names skill, effect, resource and states."""


class DataMissingError(SkillRuntimeError):
    """A condition is over a data that has no fresh value."""


class UnsupportedModelError(SkillRuntimeError):
    """The model has something that can't be executed."""
